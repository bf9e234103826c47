"""Frequency sweeps by ArduPilot's SystemID mode: a second's wait, SID_T_REC, and a rest.

Two periods of SID_T_REC are held at the start frequency; the rest lasts them and both fades.
Source: ArduPilot's pages of the mode and SID_AXIS to SID_T_FADE_OUT.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from helisim.base.errors import AutopilotError, InputError, item_of
from helisim.base.settings import check, setting
from helisim.sitl.pilot import Hold, Pilot, Steps

HEIGHT = 50.0  # m, where sweeps are flown, far from the ground's effect
# _DELAY: s that the mode waits before it sweeps
# _AFTER: s after a sweep until the pilot takes over
_DELAY, _AFTER = 1.0, 2.0
# _FARTHEST: m from its beginning, at which a sweep is ended
# _FADES: s, in and out
_FARTHEST, _FADES = 30.0, (5.0, 2.0)

# Axis -> SID_AXIS of a sweep on the mixer's command, and its usual magnitude.
_OTHER_NAMES = {"lat": "roll", "lon": "pitch", "ped": "yaw", "col": "thrust", "heave": "thrust"}
AXES = {"roll": (10, 0.06), "pitch": (11, 0.06), "yaw": (12, 0.07), "thrust": (13, 0.06)}


@dataclass(frozen=True)
class Sweep:
    """One sweep of SystemID, added to the mixer's command, whose full is 1; frequencies in Hz."""

    axis: str = setting(choices=AXES)
    magnitude: float = setting(above=0.0, high=1.0)
    start_hz: float = setting(0.2, unit="Hz", above=0.0)
    stop_hz: float = setting(12.0, unit="Hz", high=100.0)
    seconds: float = setting(90.0, unit="s", high=255.0)

    def __post_init__(self) -> None:
        check(self)
        least = max(2.0 / self.start_hz, sum(_FADES))
        if not (self.start_hz < self.stop_hz and least < self.seconds):
            raise InputError(
                f"a sweep goes to a higher frequency than its start, and lasts longer than two "
                f"periods of that and both fades, here {least:g} s; got {self.start_hz:g} to "
                f"{self.stop_hz:g} Hz in {self.seconds:g} s"
            )

    @property
    def parameters(self) -> dict[str, float]:
        """ArduPilot's, by name."""
        return {
            "SID_AXIS": AXES[self.axis][0],
            "SID_MAGNITUDE": self.magnitude,
            "SID_F_START_HZ": self.start_hz,
            "SID_F_STOP_HZ": self.stop_hz,
            "SID_T_REC": self.seconds,
            "SID_T_FADE_IN": _FADES[0],
            "SID_T_FADE_OUT": _FADES[1],
        }

    def __str__(self) -> str:
        return (
            f"SystemID axis {AXES[self.axis][0]}, {self.axis}: {self.magnitude:g} of the mixer's "
            f"1, {self.start_hz:g} to {self.stop_hz:g} Hz in {self.seconds:g} s"
        )


def sweeps(axes: Sequence[str], **changes: float) -> list[Sweep]:
    """Return usual sweeps of axes, with changed fields. Raises UnknownNameError, InputError."""
    if not axes:
        raise InputError(f"no axis is swept; expected some of {', '.join(AXES)}")
    known = {**{name: name for name in AXES}, **_OTHER_NAMES}
    names = [item_of(known, axis, "axis") for axis in axes]
    return [replace(Sweep(name, AXES[name][1]), **changes) for name in names]


def fly_sweeps(wanted: Sequence[Sweep]) -> Callable[[Pilot], Steps]:
    """Return a script that takes off, flies sweeps in one place, and lands."""

    def script(pilot: Pilot) -> Steps:
        yield from pilot.take_off(HEIGHT)
        for k, sweep in enumerate(wanted, 1):
            yield from pilot.go_to(0.0, 0.0, HEIGHT)
            pilot.say(f"sweep {k} of {len(wanted)}: {sweep}")
            yield from fly_sweep(pilot, sweep)
        yield from pilot.go_to(0.0, 0.0, HEIGHT)
        yield from pilot.go_to(0.0, 0.0, 5.0)
        yield from pilot.land()

    return script


def fly_sweep(pilot: Pilot, sweep: Sweep) -> Steps:
    """Fly a sweep from the hover. Raises AutopilotError if stopped, refused, landed or far away."""
    yield from pilot.set(**sweep.parameters)
    hold = Hold(pilot)
    yield from hold.learn()
    yield from hold.fly(0.0)
    yield from pilot.mode("stabilize")
    yield from hold.fly(2.0)
    begun = pilot.sensed.position.copy()
    heard = len(pilot.telemetry.said)
    yield from pilot.mode("systemid")
    end = pilot.time + _DELAY + sweep.seconds + _AFTER
    while pilot.time < end:
        stopped = [text for text in pilot.telemetry.said[heard:] if "SystemID Stopped" in text]
        far = math.dist(begun, pilot.sensed.position) > _FARTHEST
        if stopped or far or pilot.aircraft.stands:
            why = stopped[0] if stopped else f"it went {_FARTHEST:g} m away" if far else "it landed"
            raise AutopilotError(f"{sweep}: {why}; try a smaller magnitude or a higher start")
        yield from hold.fly(0.0)
    pilot.sticks.roll, pilot.sticks.pitch, pilot.sticks.throttle = 0.0, 0.0, 0.5
