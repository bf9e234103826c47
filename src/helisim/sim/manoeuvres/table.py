"""Reads the columns of a CSV or Parquet file that are what a manoeuvre adds."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.logs.mapping import TIME_NAMES, Clock, Column, split_heading
from helisim.logs.read import open_source
from helisim.records.channels import IN1, IN2, SERVOS
from helisim.sim.excitation import split_axes
from helisim.sim.places import PLACES, unit

_CHANNELS = {
    "sticks": dict(zip(PLACES["sticks"], IN2)),
    "servos": dict(zip(PLACES["servos"], (*IN1, *SERVOS))),
    "actuators": dict(zip(PLACES["actuators"], (*IN1, *SERVOS))),
    "sensors": {name: name for name in PLACES["sensors"]},
}
"""Place -> axis -> the channel whose name and unit its column has."""


def read_columns(
    path: Path, axis: str | None, at: str
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Return a file's times, (n_time,) s from the first, and the columns of axes, (n_time,) SI.

    Args:
        path: of the file.
        axis: those wanted, joined as "lat+ped"; all that there are if None.
        at: place, one of `PLACES`.

    Raises:
        StorageError: the file can't be read.
        RecordError: a time is missing.
        InputError: a column is missing, isn't known, or has another unit.
    """
    if at not in PLACES:
        raise UnknownNameError("place for a manoeuvre", at, PLACES)
    source = open_source(path)
    headings = {split_heading(name)[0]: name for name in source.names}
    times = [name for name in headings if name.lower() in TIME_NAMES]
    if not times:
        raise InputError(
            f"{path}: no column is the time: call one time, in s, or state its unit, as in 'time "
            f"[ms]'; it has {', '.join(source.names)}"
        )
    found = {
        one: heading
        for one, channel in _CHANNELS[at].items()
        if (heading := _heading(headings, one, channel)) is not None
    }
    wanted = list(found) if axis is None else list(split_axes(axis))
    for one in wanted:
        if one not in PLACES[at]:
            raise UnknownNameError("axis" if at == "sticks" else f"axis at {at}", one, PLACES[at])
        if one not in found:
            raise InputError(
                f"{path}: no column {_CHANNELS[at][one]}; it has {', '.join(source.names)}"
            )
    others = set(headings) - set(times) - {split_heading(name)[0] for name in found.values()}
    if axis is None and (others or not found):
        names = ", ".join(_CHANNELS[at].values())
        raise InputError(
            f"{path}: of its columns {', '.join(sorted(others))} none is added at {at}, where "
            f"they are {names}; say which are wanted with an axis, such as lat+ped"
        )
    bare = [name for name in source.names if name.lower() in ("time", "t")]
    clock = Clock(bare[0], "s") if bare else None  # else the heading has to state its unit
    stamps, _, _ = source.stamps(source.clock(source.names[0]), clock)
    columns = {}
    for one in wanted:
        channel, stated = _CHANNELS[at][one], source.stated_unit(found[one])
        own = stated or unit(at, one)
        try:
            _, factor = Column(found[one], own).converts(channel, stated)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        columns[one] = factor * source.numbers(found[one])
    return stamps, columns


def _heading(headings: dict[str, str], axis: str, channel: str) -> str | None:
    """Return the heading of an axis's column: called as its channel, or as the axis."""
    return headings.get(channel, headings.get(axis))
