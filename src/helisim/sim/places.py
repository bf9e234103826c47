"""Where a manoeuvre can be added: the signals of each place, their range and their unit."""

import math

from helisim.records.channels import ATTITUDES, AXES, RATES

_SERVOS = (*AXES, "front", "left", "right", "tail")

PLACES: dict[str, tuple[str, ...]] = {
    "sticks": AXES,
    "servos": _SERVOS,
    "actuators": _SERVOS,
    "sensors": (*RATES, *ATTITUDES),
}
"""Where a manoeuvre can be added, and the axes that there are."""

ENOUGH = {"sticks": len(AXES), "servos": len(AXES), "actuators": len(AXES), "sensors": len(RATES)}
"""How many columns are enough of each place, from its first: the others are then zero."""

_TRAVEL, _RATE, _ANGLE = 0.5, 35.0, math.pi


def limit(place: str, axis: str) -> float:
    """Return the greatest |value| that is added to an axis.

    Half a travel, unitised; the range of a gyro's rate sensors, 2000 deg/s, rad/s; half a turn.
    """
    if place != "sensors":
        return _TRAVEL
    return _RATE if axis in RATES else _ANGLE


def unit(place: str, axis: str) -> str:
    """Return the unit of what is added to an axis; "1" is of what is unitised."""
    if place != "sensors":
        return "1"
    return "rad/s" if axis in RATES else "rad"


def reach(place: str, axis: str) -> str:
    """Return what ends at the limit of an axis, for messages."""
    if place != "sensors":
        return "the travel of a stick" if place == "sticks" else "the travel of a servo"
    return "rad/s, the range of the gyro's sensors" if axis in RATES else "rad, half a turn"
