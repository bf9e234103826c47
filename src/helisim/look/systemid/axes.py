"""The axes of ArduPilot's mode SystemID: where each injects its sweep, and in what unit.

Source: ArduPilot's documentation of the parameter SID_AXIS, and of the mode ("System ID Mode").
"""

from dataclasses import dataclass
from typing import Literal

Place = Literal["input", "recovery", "rate", "mixer", "disturbance", "velocity"]

PLACES: dict[Place, str] = {
    "input": "added to the pilot's command",
    "recovery": "added to the pilot's command, which isn't fed forward meanwhile",
    "rate": "added to the commanded rate",
    "mixer": "added to the command of the actuators",
    "disturbance": "added to the measured position or velocity",
    "velocity": "added to the commanded velocity",
}
"""Where a sweep is injected -> what that is."""


@dataclass(frozen=True)
class SidAxis:
    """One value of SID_AXIS.

    Attributes:
        number: the value.
        place: where the sweep is injected, of `PLACES`.
        word: what it moves, such as "roll".
        control: whose command it moves, as `handling.axis` calls it: "lat", "lon", "ped" or "col".
        unit: of the sweep in the log.
    """

    number: int
    place: Place
    word: str
    control: str
    unit: str

    @property
    def name(self) -> str:
        """The channel of what is injected, such as "mixer_roll"."""
        return f"{self.place}_{self.word}"

    @property
    def identifies(self) -> bool:
        """Whether the sweep is fast enough for the vehicle itself: not where positions are held."""
        return self.place in ("input", "recovery", "rate", "mixer")

    @property
    def meaning(self) -> str:
        """Where it is injected, in words."""
        return PLACES[self.place]

    def __str__(self) -> str:
        return f"{self.place} {self.word.replace('_', ' ')}"


def _three(first: int, place: Place, units: tuple[str, str, str]) -> list[SidAxis]:
    words = (("roll", "lat"), ("pitch", "lon"), ("yaw", "ped"))
    return [
        SidAxis(first + k, place, word, control, unit)
        for k, ((word, control), unit) in enumerate(zip(words, units))
    ]


_ALL = (
    # of yaw it is a rate that is commanded, though its name says angle
    *_three(1, "input", ("deg", "deg", "deg/s")),
    *_three(4, "recovery", ("deg", "deg", "deg/s")),
    *_three(7, "rate", ("deg/s", "deg/s", "deg/s")),
    *_three(10, "mixer", ("1", "1", "1")),
    SidAxis(13, "mixer", "thrust", "col", "1"),
    SidAxis(14, "disturbance", "right_position", "lat", "m"),
    SidAxis(15, "disturbance", "forward_position", "lon", "m"),
    SidAxis(16, "disturbance", "right_velocity", "lat", "m/s"),
    SidAxis(17, "disturbance", "forward_velocity", "lon", "m/s"),
    SidAxis(18, "velocity", "right", "lat", "m/s"),
    SidAxis(19, "velocity", "forward", "lon", "m/s"),
)

SID_AXES: dict[int, SidAxis] = {one.number: one for one in _ALL}
"""SID_AXIS -> what is swept."""
