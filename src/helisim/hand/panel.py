"""What a pilot sees beside the helicopter, as a value: sticks, numbers, keys, a message."""

from dataclasses import dataclass

from helisim.hand import MODES, Deflection, Gimbals, StickDevice
from helisim.hand.devices import FINE_KEY
from helisim.hand.sticks import gimbals_of

_ACROSS = {"lat": "roll", "ped": "yaw"}
_UPWARDS = {"lon": "pitch", "col": "lift"}


@dataclass(frozen=True)
class Panel:
    """What is drawn over a picture.

    Attributes:
        deflection: of the sticks.
        hover_collective: where the collective is in the hover, -1 to 1.
        mode: of the transmitter.
        readout: names and values.
        legend: keys and what they do.
        message: for the pilot, "" if there is none.
        recorded: s that the running recording has, None if none runs.
    """

    deflection: Deflection
    hover_collective: float
    mode: int
    readout: tuple[tuple[str, str], ...]
    legend: tuple[tuple[str, str], ...]
    message: str = ""
    recorded: float | None = None

    @property
    def gimbals(self) -> Gimbals:
        """Where both thumbs are."""
        return gimbals_of(self.deflection, self.mode)

    @property
    def labels(self) -> tuple[str, str, str, str]:
        """What left and right gimbal move across and upwards, in the order of `Gimbals`."""
        left_x, left_y, right_x, right_y = MODES[self.mode]
        return _ACROSS[left_x], _UPWARDS[left_y], _ACROSS[right_x], _UPWARDS[right_y]


def legend(device: StickDevice) -> tuple[tuple[str, str], ...]:
    """Return the keys and what they do, those of the sticks first where keys are sticks."""
    left_x, left_y, right_x, right_y = MODES[device.mode]
    sticks = (
        ("W S", _UPWARDS[left_y]),
        ("A D", _ACROSS[left_x]),
        ("up down", _UPWARDS[right_y]),
        ("left right", _ACROSS[right_x]),
        (FINE_KEY.capitalize(), "small moves"),
    )
    keys = (
        ("R", "record, stop"),
        ("P", "pause"),
        ("Backspace", "start again"),
        ("H", "next assist"),
        ("G", "gyro on, off"),
        ("C", "camera"),
        ("F1", "hide keys"),
        ("Esc", "leave"),
    )
    return (*sticks, *keys) if device.uses_keys else keys
