"""Records as tables of pandas and xarray, and back from pandas; imported when asked for."""

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, RecordError, UnknownNameError
from helisim.base.unit_names import check_same
from helisim.base.unit_names import unit as unit_of
from helisim.records.channels import CHANNELS, Channel
from helisim.records.record import FlightRecord

_KEYS = ("units", "kinds", "meanings", "provenance")


def to_pandas(record: FlightRecord) -> Any:
    """Return a DataFrame with a column a channel over `time`; see `FlightRecord.to_pandas`."""
    pandas = _package("pandas", "to_pandas")
    time = pandas.Index(np.array(record.time), name="time")
    frame = pandas.DataFrame(np.array(record.values), index=time, columns=list(record.names))
    frame.attrs.update(
        units={one.name: one.unit for one in record.channels},
        kinds={one.name: one.kind for one in record.channels},
        meanings={one.name: one.meaning for one in record.channels},
        provenance=dict(record.provenance),
    )
    return frame


def to_xarray(record: FlightRecord) -> Any:
    """Return a Dataset with a variable a channel over `time`; see `FlightRecord.to_xarray`."""
    xarray = _package("xarray", "to_xarray")
    variables = {
        one.name: (
            "time",
            np.array(values),
            {"units": one.unit, "long_name": one.meaning, "kind": one.kind},
        )
        for one, values in zip(record.channels, record.values.T)
    }
    time = ("time", np.array(record.time), {"units": "s", "long_name": "time"})
    about = {"provenance": json.dumps(dict(record.provenance), allow_nan=False)}
    return xarray.Dataset(variables, coords={"time": time}, attrs=about)


def from_pandas(
    frame: Any, *, units: Mapping[str, str] | None, provenance: Mapping[str, Any] | None
) -> FlightRecord:
    """Return the record of a DataFrame; see `FlightRecord.from_pandas`."""
    kept = getattr(frame, "attrs", None)
    if kept is None or not hasattr(frame, "columns"):
        raise InputError(f"from_pandas takes a DataFrame, got {type(frame).__name__}")
    facts = {key: dict(kept[key]) for key in _KEYS if isinstance(kept.get(key), Mapping)}
    if "time" in frame.columns:
        frame = frame.set_index("time")
    elif frame.index.name != "time" and type(frame.index).__name__ == "RangeIndex":
        raise RecordError(
            "the DataFrame has no times: its index numbers the rows; give it a column 'time', in "
            "s, or such an index"
        )
    names = [str(name) for name in frame.columns]
    for name in units or {}:
        if name not in names:
            raise UnknownNameError("column with a unit", name, names)
    found = [_channel(name, units or {}, facts) for name in names]
    columns = [
        factor * _numbers(frame.iloc[:, k], name)
        for k, (name, (_, factor)) in enumerate(zip(names, found))
    ]
    values = np.column_stack(columns) if columns else np.zeros((len(frame), 0))
    origin = facts.get("provenance", {}) if provenance is None else provenance
    return FlightRecord(
        _numbers(frame.index, "time"), values, tuple(one for one, _ in found), origin
    )


def _channel(
    name: str, units: Mapping[str, str], facts: Mapping[str, Mapping[str, Any]]
) -> tuple[Channel, float]:
    """Return the channel of a column, and SI per unit of the column."""
    if name not in units and all(name in facts.get(key, {}) for key in _KEYS[:3]):
        unit, kind, meaning = (facts[key][name] for key in _KEYS[:3])
        return Channel(name, unit, kind, meaning), 1.0
    known = CHANNELS.get(name)
    if name not in units:
        if known is None:
            raise InputError(
                f"column {name!r} has no unit, and no standard channel has its name: give it, such "
                f"as units={{{name!r}: 'rad/s'}}"
            )
        return known, 1.0
    given = unit_of(units[name])
    if known is None:
        return Channel(name, given.si, "OTHER"), given.factor
    check_same(name, known.unit, units[name], given.si)
    return known, given.factor


def _numbers(column: Any, name: str) -> NDArray[np.float64]:
    """Return a column or an index as numbers, (n_time,)."""
    kind = getattr(column, "dtype", np.dtype(object))
    if getattr(kind, "kind", "O") in "mM":
        raise RecordError(
            f"column {name!r} holds {kind}; a record's time is seconds: "
            "(index - index[0]).total_seconds()"
        )
    try:
        return np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError):
        raise RecordError(f"column {name!r} holds {kind}, expected numbers") from None


def _package(name: str, wanted_by: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"{wanted_by} needs {name}, which isn't installed: pip install {name}"
        ) from None
