"""What differs between two pieces of JSON data, leaf by leaf, and between two records."""

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import HelisimError
from helisim.records.provenance import difference
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record

_SHOWN = 10
"""Lines of differences that are printed; the count says how many there are."""


def leaves(data: Any, place: str, without: Collection[str] = ()) -> dict[str, Any]:
    """Return every number and text of JSON data by its place, such as "results.tables[heave].cost".

    Args:
        data: objects, lists and leaves.
        place: of the data.
        without: keys that are left out wherever they stand.
    """
    if isinstance(data, dict):
        inner = {f"{place}.{key}": one for key, one in data.items() if key not in without}
    elif isinstance(data, list):
        inner = {f"{place}[{_name(one, k)}]": one for k, one in enumerate(data)}
    else:
        return {place: data}
    return {
        at: leaf for where, one in inner.items() for at, leaf in leaves(one, where, without).items()
    }


def _name(item: Any, k: int) -> str:
    named = item.get("name", item.get("flight", k)) if isinstance(item, dict) else k
    return str(named)


def changes(then: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, str]:
    """Return how the leaves of two pieces of data differ, by place."""
    places = dict.fromkeys((*then, *now))
    differ = (at for at in places if at not in then or at not in now or then[at] != now[at])
    return {at: _change(then.get(at), now.get(at)) for at in differ}


def _change(then: Any, now: Any) -> str:
    if not all(isinstance(one, int | float) and not isinstance(one, bool) for one in (then, now)):
        return f"{then!r} before, {now!r} now"
    share = abs(now - then) / max(abs(then), abs(now), math.ulp(0.0))
    return f"{then!r} before, {now!r} now, {100.0 * share:.2g} % apart"


def record_difference(before: Path, now: Path) -> tuple[str, bool]:
    """Return what differs between two records' files, "" for nothing, and whether numbers do."""
    for path, when in ((before, "before"), (now, "now")):
        if not path.is_file():
            return f"there was none {when}", True
    try:
        if before.read_bytes() == now.read_bytes():
            return "", False
        then, again = read_record(before), read_record(now)
    except (OSError, HelisimError) as error:
        return f"can't be read: {error}", True
    message = _other_numbers(then, again)
    if message:
        return message, True
    message = difference(dict(then.provenance), dict(again.provenance))
    return f"the same numbers; provenance: {message or 'the same too'}", False


def _other_numbers(then: FlightRecord, now: FlightRecord) -> str:
    if then.channels != now.channels:
        return f"other channels: {', '.join(then.names)} before, {', '.join(now.names)} now"
    if len(then) != len(now):
        return f"{len(then)} samples before, {len(now)} now"
    if not np.array_equal(then.time, now.time):
        return "other times"
    differs = then.values != now.values
    if not differs.any():
        return ""
    row = int(np.argmax(differs.any(axis=1)))
    names = [name for name, bad in zip(then.names, differs.any(axis=0)) if bad]
    worst = float(np.max(np.abs(then.values - now.values)))
    return f"{', '.join(names)} differ from {then.time[row]:g} s on, by {worst:.2g} at most"


def listed(found: Mapping[str, str]) -> list[str]:
    """Return a line for each difference, those that are the same in one."""
    places: dict[str, list[str]] = {}
    for place, text in found.items():
        places.setdefault(text, []).append(place)
    lines = [
        f"  {at[0]}{f' and {len(at) - 1} more' if len(at) > 1 else ''}: {text}"
        for text, at in places.items()
    ]
    more = len(lines) - _SHOWN
    return [*lines[:_SHOWN], f"  and {more} more"] if more > 0 else lines
