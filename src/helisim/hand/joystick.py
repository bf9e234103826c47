"""Which axis of a joystick is which stick, and what it reads at the stops; as a TOML file."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import atomic_write, read_toml, toml_value
from helisim.hand.sticks import MODES, Deflection, check_mode

STICKS = Deflection._fields
ORDERS = ("AETR", "TAER", "RETA", "TREA", "ETAR", "EATR")
"""Usual orders of a transmitter's channels; any other order of the four letters will do."""
_LETTERS = {"A": "lat", "E": "lon", "T": "col", "R": "ped"}
_LEAST_MOVE = 0.5
"""Of a reading, by which a stick at its stop must differ from the middle to be told."""


@dataclass(frozen=True)
class Axis:
    """One axis of a joystick as a stick.

    Attributes:
        number: of the axis, from 0.
        low: reading where the stick's deflection is -1.
        centre: reading in the middle.
        high: reading where it is 1; below `low`, the axis is reversed.
    """

    number: int
    low: float = -1.0
    centre: float = 0.0
    high: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.number, int) or isinstance(self.number, bool) or self.number < 0:
            raise InputError(f"the number of an axis must be 0 or more, got {self.number!r}")
        readings = (self.low, self.centre, self.high)
        if not all(isinstance(one, int | float) and np.isfinite(one) for one in readings):
            raise InputError(f"low, centre and high of an axis must be numbers, got {readings}")
        if not (self.low < self.centre < self.high or self.low > self.centre > self.high):
            raise InputError(
                f"the centre of axis {self.number} must lie between low and high, got "
                f"{self.low:g}, {self.centre:g}, {self.high:g}"
            )

    def deflection(self, axes: Sequence[float]) -> float:
        """Return the stick's deflection, -1 to 1. Raises InputError: there is no such axis."""
        if self.number >= len(axes):
            raise InputError(
                f"the joystick has {len(axes)} axes, 0 to {len(axes) - 1}, and no axis "
                f"{self.number}; say which is which with --map FILE, or make one with --calibrate"
            )
        off = axes[self.number] - self.centre
        span = self.high if off * (self.high - self.centre) >= 0.0 else self.low
        return min(1.0, abs(off / (span - self.centre))) * (1.0 if span == self.high else -1.0)


@dataclass(frozen=True, kw_only=True)
class JoystickMap:
    """The axes of all four sticks.

    Attributes:
        col: collective.
        lon: longitudinal.
        lat: lateral.
        ped: pedals.
        centring: whether the collective's stick goes back to the middle, as a gamepad's does;
            then it moves the collective on instead of being it.
    """

    col: Axis
    lon: Axis
    lat: Axis
    ped: Axis
    centring: bool = False

    @classmethod
    def transmitter(cls, order: str = "AETR") -> "JoystickMap":
        """Return the map of a radio transmitter on USB, by the order of its channels.

        Each axis reads 1 with its stick up, away from the pilot, or to the right.

        Args:
            order: A, E, T and R for aileron, elevator, throttle and rudder.

        Raises:
            InputError: not each of the four letters once.
        """
        if sorted(order.upper()) != sorted(_LETTERS):
            raise InputError(
                f"the order of channels must be each of A, E, T and R once, such as "
                f"{', '.join(ORDERS[:2])}, got {order!r}"
            )
        names = [_LETTERS[letter] for letter in order.upper()]
        axes = {name: _axis_of(n, turned=name == "lon") for n, name in enumerate(names)}
        return cls(centring=False, **axes)

    @classmethod
    def gamepad(cls, mode: int = 2) -> "JoystickMap":
        """Return the map of a gamepad whose axes are left x, y, right x, y, y down.

        Raises:
            UnknownNameError: no such mode.
        """
        axes = {}
        for number, name in enumerate(MODES[check_mode(mode)]):
            turned = (number % 2 == 1) != (name == "lon")  # a stick back is a nose up
            axes[name] = _axis_of(number, turned=turned)
        return cls(centring=True, **axes)

    def deflection(self, axes: Sequence[float]) -> Deflection:
        """Return where the sticks are. Raises InputError: there is no such axis."""
        return Deflection(*(getattr(self, name).deflection(axes) for name in STICKS))

    def write(self, path: str | PathLike[str]) -> None:
        """Write the map as TOML, which `read` reads. Raises StorageError."""
        lines = [f"centring = {toml_value(self.centring)}"]
        for name in STICKS:
            axis = asdict(getattr(self, name))
            lines.append(f"\n[{name}]")
            lines += [f"{key} = {toml_value(value)}" for key, value in axis.items()]
        with atomic_write(path) as temporary:
            temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: str | PathLike[str]) -> "JoystickMap":
        """Read a map from TOML.

        Raises:
            StorageError: the file can't be read.
            InputError: a stick is missing, or its readings can't be.
        """
        try:
            return cls.from_dict(read_toml(path))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "JoystickMap":
        """Return the map that plain data describe. Raises InputError."""
        for key in data:
            if key not in (*STICKS, "centring"):
                raise UnknownNameError("key of a joystick's map", key, (*STICKS, "centring"))
        missing = [name for name in STICKS if name not in data]
        if missing:
            raise InputError(f"a joystick's map needs [{missing[0]}], with number = 0, say")
        centring = data.get("centring", False)
        if not isinstance(centring, bool):
            raise InputError(f"centring must be true or false, got {centring!r}")
        return cls(**{name: _axis(name, data[name]) for name in STICKS}, centring=centring)


def _axis_of(number: int, *, turned: bool) -> Axis:
    return Axis(number, 1.0, 0.0, -1.0) if turned else Axis(number)


def _axis(name: str, data: Any) -> Axis:
    known = tuple(Axis.__dataclass_fields__)
    if not isinstance(data, Mapping) or "number" not in data:
        raise InputError(f"[{name}] needs number, and may have low, centre and high")
    for key in data:
        if key not in known:
            raise UnknownNameError(f"key of [{name}]", key, known)
    try:
        return Axis(**data)
    except InputError as error:
        raise InputError(f"[{name}]: {error}") from None


def calibrated(
    middle: Sequence[float],
    stops: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    *,
    centring: bool = False,
) -> JoystickMap:
    """Return the map of a joystick from what it reads with one stick after the other at its stops.

    Args:
        middle: readings of all axes with all sticks in the middle.
        stops: by stick, readings of all axes with it at -1 and at 1, the others in the middle.
        centring: whether the collective's stick goes back to the middle.

    Raises:
        InputError: no axis moved for a stick, or one moved for two.
    """
    axes: dict[str, Axis] = {}
    for name in STICKS:
        low, high = (np.asarray(one, dtype=float) for one in stops[name])
        number = int(np.argmax(np.abs(high - low)))
        if abs(high[number] - low[number]) < 2.0 * _LEAST_MOVE:
            raise InputError(
                f"no axis moved by its whole travel with the {name} stick; do it again"
            )
        taken = [other for other, axis in axes.items() if axis.number == number]
        if taken:
            raise InputError(
                f"axis {number} moved with {taken[0]} and with {name}: move one stick at a time"
            )
        axes[name] = Axis(
            number, *(round(float(one[number]), 4) for one in (low, np.asarray(middle), high))
        )
    return JoystickMap(**axes, centring=centring)
