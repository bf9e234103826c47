"""Keys, gamepads and transmitters on USB as the four sticks of a flight by hand."""

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from helisim.base.errors import InputError, UnknownNameError


class Deflection(NamedTuple):
    """Four sticks' positions, -1 to 1: up, back (nose up), right, and nose right are positive."""

    col: float = 0.0
    lon: float = 0.0
    lat: float = 0.0
    ped: float = 0.0


MODES = {
    1: ("ped", "lon", "lat", "col"),
    2: ("ped", "col", "lat", "lon"),
    3: ("lat", "lon", "ped", "col"),
    4: ("lat", "col", "ped", "lon"),
}  # Sticks of a transmitter's modes: left thumb across, left up, right across, right up
# Keys that move each thumb, towards -1 and towards 1.
KEYS = (("a", "d"), ("s", "w"), ("left", "right"), ("down", "up"))
_CHANNELS = {"A": "lat", "E": "lon", "T": "col", "R": "ped"}
# s, in which a key moves a thumb from the middle to the stop, and back.
_PRESS, _RELEASE = 0.3, 0.12
_COLLECTIVE_RATE = 0.8  # 1/s, at which a thumb at its stop moves the collective, from -1 to 1
# Share of the travel that a key gives; a joystick's cubic share and rest about the middle.
_KEY_RATE, _EXPO, _DEADBAND = 0.35, 0.3, 0.02


class Joystick(NamedTuple):
    """A joystick that is plugged in: GLFW's number and name, and whether GLFW knows its thumbs."""

    number: int
    name: str
    is_gamepad: bool = False


class Sticks:
    """The four sticks of a joystick, or of a keyboard if it is None.

    `collective` is where thumbs that centre have put it.
    """

    def __init__(
        self, joystick: Joystick | None = None, *, mode: int = 2, order: str = "AETR"
    ) -> None:
        """Take a joystick, or the keyboard if None, with a transmitter's mode (1 to 4).

        `order` is of its channels. Raises UnknownNameError or InputError.
        """
        if mode not in MODES:
            raise UnknownNameError("transmitter mode", mode, map(str, MODES))
        if sorted(order.upper()) != sorted(_CHANNELS):
            raise InputError(f"the order of channels must be A, E, T, R, each once, got {order!r}")
        self.joystick, self.mode, self.collective = joystick, mode, 0.0
        self.name = "keyboard" if joystick is None else joystick.name
        thumbs = joystick is None or joystick.is_gamepad
        self._stays = not thumbs  # a transmitter's collective has no spring
        self._names = MODES[mode] if thumbs else [_CHANNELS[one] for one in order.upper()]
        self._thumbs = np.zeros(4)

    def deflection(
        self,
        held: Collection[str],
        axes: Sequence[float] | None,
        seconds: float,
        *,
        climbs: bool,
    ) -> Deflection | None:
        """Return the positions of the sticks, None if the joystick is gone.

        `axes` are -1 to 1, up and to the right; where a joystick `climbs`, the collective's middle
        is level flight. Raises InputError for fewer than four axes.
        """
        if self.joystick is None:
            wanted = np.array([(high in held) - (low in held) for low, high in KEYS], dtype=float)
            back = (abs(wanted) < abs(self._thumbs)) | (wanted * self._thumbs < 0.0)
            step = seconds / np.where(back, _RELEASE, _PRESS)
            self._thumbs = np.clip(wanted, self._thumbs - step, self._thumbs + step)
            axes = tuple(map(float, self._thumbs))
        elif axes is None:
            return None
        elif len(axes) < 4:
            raise InputError(
                f"a joystick needs 4 axes, one each stick; {self.name} has {len(axes)}"
            )
        readings = dict(zip(self._names, axes))
        found = {name: self._felt(one) for name, one in readings.items()}
        if climbs or self._stays:
            found["col"] = readings["col"]
        else:
            moved = self.collective + found["col"] / self._felt(1.0) * seconds * _COLLECTIVE_RATE
            found["col"] = self.collective = min(1.0, max(-1.0, moved))
        found["lon"] = -found["lon"]  # away from the pilot is nose down
        return Deflection(**found)

    def _felt(self, one: float) -> float:
        if self.joystick is None:
            return _KEY_RATE * one
        beyond = max(0.0, abs(one) - _DEADBAND) / (1.0 - _DEADBAND)
        return float(np.copysign((1.0 - _EXPO) * beyond + _EXPO * beyond**3, one))


def choose(glfw: Any, wanted: str) -> Joystick:
    """Return the joystick of a number or part of a name, the only one for "", or raise."""
    there = [
        Joystick(n, glfw.get_joystick_name(n).decode(errors="replace"), glfw.joystick_is_gamepad(n))
        for n in filter(glfw.joystick_present, range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1))
    ]
    found = [one for one in there if wanted in ("", str(one.number)) or wanted in one.name]
    if len(found) != 1:
        listed = ", ".join(f"{one.number} {one.name!r}" for one in there) or "none"
        raise InputError(
            f"{'several joysticks fit' if found else 'no joystick'} {wanted!r}: there are "
            f"{listed}; say which by number or name, plug one in, or fly with keys"
        )
    return found[0]


def read_axes(glfw: Any, joystick: Joystick) -> tuple[float, ...] | None:
    """Return the readings of a joystick's axes, 1 up and to the right; None if it is gone."""
    if joystick.is_gamepad:
        state = glfw.get_gamepad_state(joystick.number)
        return state and tuple(np.multiply(state.axes[:4], (1, -1, 1, -1)).tolist())
    pointer, count = glfw.get_joystick_axes(joystick.number)
    return tuple(pointer[:count]) if count else None
