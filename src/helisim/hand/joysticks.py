"""Joysticks of this machine, as GLFW reports them: found by number or name, read, calibrated."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from helisim.base.errors import InputError
from helisim.hand import JoystickMap, calibrated
from helisim.hand.joystick import STICKS

_STICK_AXES = 4
"""Of a gamepad: left x, y, right x, y; then come its triggers."""


@dataclass(frozen=True)
class Joystick:
    """A joystick that is plugged in.

    Attributes:
        number: by which GLFW knows it, from 0.
        name: as it calls itself.
        is_gamepad: whether GLFW knows which of its axes is which stick.
    """

    number: int
    name: str
    is_gamepad: bool = False


def joysticks(glfw: Any) -> list[Joystick]:
    """Return the joysticks that are plugged in."""
    return [
        Joystick(number, _text(glfw.get_joystick_name(number)), glfw.joystick_is_gamepad(number))
        for number in range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1)
        if glfw.joystick_present(number)
    ]


def choose(wanted: str, there: list[Joystick]) -> Joystick:
    """Return the joystick of a number or of a part of its name; the only one if "" is wanted.

    Raises:
        InputError: there is none such, or there are several.
    """
    listed = ", ".join(f"{one.number} {one.name!r}" for one in there)
    if not there:
        raise InputError(
            "no joystick: looked for any that the system reports, found none; plug one in (a "
            "transmitter in its USB joystick mode) and see that you may read it, or fly with "
            "--keyboard"
        )
    if wanted.isdecimal():
        found = [one for one in there if one.number == int(wanted)]
    else:
        found = [one for one in there if wanted.casefold() in one.name.casefold()]
    if len(found) == 1:
        return found[0]
    what = f"no joystick {wanted!r}" if wanted and not found else "several joysticks"
    raise InputError(f"{what}: there are {listed}; say which by number or name")


def read_axes(glfw: Any, joystick: Joystick) -> tuple[float, ...] | None:
    """Return what a joystick's axes read, None if it is gone."""
    if joystick.is_gamepad:
        state = glfw.get_gamepad_state(joystick.number)
        return None if state is None else tuple(state.axes[:_STICK_AXES])
    pointer, count = glfw.get_joystick_axes(joystick.number)
    return tuple(pointer[:count]) if count else None


_STOPS = {
    "col": ("all the way down", "all the way up"),
    "lon": ("forward (nose down)", "back (nose up)"),
    "lat": ("to the left", "to the right"),
    "ped": ("to the left (nose left)", "to the right (nose right)"),
}
_CALLED = {"col": "collective", "lon": "longitudinal", "lat": "lateral", "ped": "pedal"}


def calibrate(
    read: Callable[[], tuple[float, ...] | None], ask: Callable[[str], object]
) -> JoystickMap:
    """Return the map of a joystick whose pilot moves one stick after the other as asked.

    Args:
        read: what its axes read now.
        ask: shows a text and waits until the pilot has done so.

    Raises:
        InputError: the joystick is gone, no axis moved, or one moved for two sticks.
    """

    def reading(text: str) -> tuple[float, ...]:
        ask(text)
        axes = read()
        if axes is None:
            raise InputError("the joystick is gone; plug it in and calibrate again")
        return axes

    middle = reading("All sticks in the middle, the collective too; then Enter")
    stops: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
        name: (
            reading(f"Hold the {_CALLED[name]} stick {_STOPS[name][0]}; then Enter"),
            reading(f"Hold it {_STOPS[name][1]}; then Enter"),
        )
        for name in STICKS
    }
    let_go = reading("Let go of all sticks, and leave the collective up; then Enter")
    found = calibrated(middle, stops)
    centring = abs(found.deflection(let_go).col) < _LET_GO
    return calibrated(middle, stops, centring=centring)


_LET_GO = 0.5
"""Deflection below which a collective that was up has gone back by itself."""


def _text(name: Any) -> str:
    return name.decode(errors="replace") if isinstance(name, bytes) else str(name)
