"""Where a loop is cut: what was injected there, what comes back, and what goes on behind it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from helisim.base.errors import InputError
from helisim.handling.loop import BY_NAME, Axis, axis_of
from helisim.records.channels import IN2
from helisim.records.record import FlightRecord

PLACES = ("actuators", "sensors")
"""Where loops are cut; besides, at one sensor, such as "p"."""

_FAINT = 1e-4
"""A signal that moves less than this share of the largest of its place is taken to be at rest."""


@dataclass(frozen=True)
class Cut:
    """A place where something was injected into a loop.

    Attributes:
        axis: of control, such as "lat", or its word.
        at: "actuators": added to the servo command. "sensors": it turned the attitude that is
            sensed, its derivative added to the rate. Or one sensor, such as "p".
        injected: channel of what was added.
        total: channel of the sum of both, which goes on behind the cut. None: `returned` and what
            was injected, added up.
        returned: channel of what comes back, to which it was added. None: the difference.
        alone: at the actuators, whether the law moves this command by the axis's own attitude and
            rate alone. To turn that attitude is then to add there: what follows the cut is also the
            rejection of disturbances.

    Raises:
        InputError: neither `total` nor `returned` is given.
        UnknownNameError: no such axis or place.
    """

    axis: str
    at: str
    injected: str
    total: str | None = None
    returned: str | None = None
    alone: bool = False

    def __post_init__(self) -> None:
        one = axis_of(self.axis)
        object.__setattr__(self, "axis", one.name)
        places = (*PLACES, *([one.rate] if one.rate else []))
        if self.at not in places:
            raise InputError(f"a loop of {one.name} is cut at {' or '.join(places)}, not {self.at}")
        if self.total is None and self.returned is None:
            raise InputError(
                f"what follows {self.injected!r} is not said: name the channel of what comes back, "
                "or that of its sum with what was injected"
            )

    @property
    def outputs(self) -> tuple[str, ...]:
        """The channels that are measured over what was injected."""
        return tuple(name for name in (self.total, self.returned) if name is not None)


def cuts_by_name(names: Sequence[str]) -> tuple[Cut, ...]:
    """Return the cuts that channels' names say, by helisim's own names of them."""
    found = []
    for axis in BY_NAME.values():
        for at, *signals in _signals(axis):
            injected, *sides = (name if name in names else None for name in signals)
            if injected and any(sides):
                total, returned = sides
                found.append(Cut(axis.name, at, injected, total, returned))
    return tuple(found)


def _signals(axis: Axis) -> list[tuple[str, str, str, str]]:
    """Return where a loop of the axis may be cut, what is injected there, the sum, what returns."""
    name = axis.name
    signals = [
        ("actuators", f"{name}_disturbance", f"{name}_sum", name),
        ("actuators", f"{name}_added", name, f"{name}_gyro"),
    ]
    if axis.rate is not None:
        for at, sensed in (("sensors", axis.angle), (axis.rate, axis.rate)):
            signals.append((at, f"{sensed}_disturbance", f"{sensed}_sum", ""))
    return signals


def moving(records: Sequence[FlightRecord], cuts: Sequence[Cut]) -> list[tuple[str, ...]]:
    """Return which signals drive each record: what was injected, or else the sticks.

    An attitude that is turned has its derivative in the rate, which is no signal of its own.
    """
    return [_driven(record, cuts) for record in records]


def _driven(record: FlightRecord, cuts: Sequence[Cut]) -> tuple[str, ...]:
    places: dict[str, list[str]] = {}
    for cut in cuts:
        place = cut.at if cut.at in PLACES else "rates"
        places.setdefault(place, []).append(cut.injected)
    drives = [name for names in places.values() for name in _moving(record, names)]
    turned = {
        axis_of(cut.axis).rate for cut in cuts if cut.at == "sensors" and cut.injected in drives
    }
    drives = [
        name
        for name in drives
        if not any(cut.injected == name and cut.at in turned for cut in cuts)
    ]
    return tuple(dict.fromkeys(drives)) or _swept(record)


def _moving(record: FlightRecord, names: Sequence[str]) -> list[str]:
    size = {name: float(np.std(record[name])) for name in names if name in record}
    least = _FAINT * max(size.values(), default=0.0)
    return [name for name, one in size.items() if one > least]


_SWEPT = 0.3
"""Sticks that move at least so fast, of the one that moves fastest, were swept too: what holds a
hover is slow."""


def _swept(record: FlightRecord) -> tuple[str, ...]:
    """Return the sticks that move on purpose: those that move fastest."""
    size = {name: float(np.std(np.diff(record[name]))) for name in IN2 if name in record}
    most = max(size.values(), default=0.0)
    return tuple(name for name, one in size.items() if one > 0.0 and one >= _SWEPT * most)


def groups(drives: Sequence[tuple[str, ...]]) -> list[tuple[tuple[str, ...], list[int]]]:
    """Return records that are estimated together: those that have a driving signal in common.

    Args:
        drives: of each record.

    Returns:
        The driving signals, and the numbers of the records.
    """
    found: list[tuple[dict[str, None], list[int]]] = []
    for number, names in enumerate(drives):
        if not names:
            continue
        joined = [one for one in found if any(name in one[0] for name in names)]
        merged = (dict.fromkeys(names), [number])
        for one in joined[::-1]:
            merged = ({**one[0], **merged[0]}, [*one[1], *merged[1]])
            found.remove(one)
        found.append(merged)
    return [(tuple(names), sorted(numbers)) for names, numbers in found]
