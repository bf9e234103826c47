"""Repeats a run from its own provenance and compares: records byte by byte, then every number."""

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from helisim.errors import HelisimError, InputError
from helisim.records.files import read_json
from helisim.records.provenance import difference
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record
from helisim.study.reproduce import reproduce
from helisim.study.run import FITS, FLIGHTS, RESULTS

_ARGUMENTS: dict[str, tuple[type, ...]] = {
    "flights": (int,),
    "seed": (int,),
    "parameters": (dict,),
    "timestep": (float, int, type(None)),
    "rotor": (bool,),
}
"""What a run says of how it was called, by name and type."""

_TOLD = ("versions", "made_by", "model_digest", "marks", "spans")
"""Left out of the numbers: versions are compared apart, marks and spans only say which records a
fit has seen."""

_SHOWN = 10
"""Differences that are printed; the count says how many there are."""


@dataclass(frozen=True)
class Repetition:
    """A run that was repeated, beside what it was before.

    Attributes:
        folder: of the run.
        arguments: how it was called, both times.
        changed: versions, and the model's digest, that aren't those of the run: then and now.
        records: names of the records that were compared.
        other_bytes: record -> what differs, where its file isn't the same to the byte.
        other_numbers: record, or place in a file of results -> how its numbers differ.
        numbers: how many were compared in results and fits.
    """

    folder: Path
    arguments: Mapping[str, Any]
    changed: Mapping[str, tuple[str, str]]
    records: tuple[str, ...]
    other_bytes: Mapping[str, str]
    other_numbers: Mapping[str, str]
    numbers: int

    @property
    def same(self) -> bool:
        """Whether every number came out the same, to the last bit."""
        return not self.other_numbers

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "folder": str(self.folder),
            "arguments": dict(self.arguments),
            "same": self.same,
            "changed": {name: list(pair) for name, pair in self.changed.items()},
            "records": list(self.records),
            "records_of_other_bytes": dict(self.other_bytes),
            "numbers_compared": self.numbers,
            "other_numbers": dict(self.other_numbers),
        }

    def __str__(self) -> str:
        alike = len(self.records) - len(self.other_bytes)
        lines = [
            f"{self.folder}: seed {self.arguments['seed']}, {self.arguments['flights']} flights "
            "an axis, flown and identified again",
            f"records: {alike} of {len(self.records)} are the same to the byte",
            *_shown(self.other_bytes),
            f"results: {self.numbers} numbers compared; "
            + ("all are the same" if self.same else f"{len(self.other_numbers)} places differ"),
            *_shown(self.other_numbers),
        ]
        if self.changed:
            lines.append("the run was made with something else than is here:")
            pairs = sorted(self.changed.items())
            lines += [f"  {name}: {then} then, {now} now" for name, (then, now) in pairs]
        return "\n".join(lines)


def repeat(
    folder: Path,
    *,
    out: Path | None = None,
    jobs: int | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> Repetition:
    """Repeat a run as its results say that it was made, and compare all that it wrote.

    Args:
        folder: that `reproduce` wrote.
        out: folder for the repeated run; a temporary one if None.
        jobs: threads, which change nothing.
        on_progress: as for `reproduce`.

    Raises:
        StorageError: a file can't be read or written.
        InputError: the folder doesn't say how it was made, or `out` is the folder itself.
        DivergedError: a flight left the validity of the model.
    """
    arguments = arguments_of(folder)
    if out is not None and out.resolve() == folder.resolve():
        raise InputError(f"{out} is the run that shall be repeated; give another folder")
    with tempfile.TemporaryDirectory(prefix="helisim-") as temporary:
        again = out or Path(temporary)
        reproduce(
            out=again,
            jobs=jobs,
            on_progress=on_progress,
            **arguments,
        )
        return compare(folder, again)


def arguments_of(folder: Path) -> dict[str, Any]:
    """Return the arguments of `reproduce` that a run was made with.

    Raises:
        StorageError: the folder has no readable results.
        InputError: they don't say it.
    """
    path = folder / RESULTS
    configuration = read_json(path).get("configuration")
    told = configuration.get("arguments") if isinstance(configuration, dict) else None
    if not isinstance(told, dict) or set(told) != set(_ARGUMENTS):
        raise InputError(
            f"{path}: doesn't say in configuration.arguments how the run was made "
            f"({', '.join(_ARGUMENTS)}); another version wrote it"
        )
    numbers = told["parameters"].values() if isinstance(told["parameters"], dict) else ()
    for name, kinds in _ARGUMENTS.items():
        if type(told[name]) not in kinds or not all(type(x) in (int, float) for x in numbers):
            raise InputError(f"{path}: configuration.arguments.{name} is {told[name]!r}")
    return told


def compare(before: Path, now: Path) -> Repetition:
    """Compare two folders of runs.

    Raises:
        StorageError: a file of results can't be read.
        InputError: a folder doesn't say how it was made.
    """
    arguments = arguments_of(before)
    other_bytes: dict[str, str] = {}
    other_numbers: dict[str, str] = {}
    names = sorted({path.name for run in (before, now) for path in _records(run)})
    for name in names:
        told, numbers = _compared(before / FLIGHTS / name, now / FLIGHTS / name)
        if told:
            other_bytes[name] = told
        if numbers:
            other_numbers[name] = told
    count = 0
    for name in (RESULTS, FITS):
        then, again = (
            dict(_leaves(read_json(run / name), Path(name).stem)) for run in (before, now)
        )
        count += len(then)
        for place in dict.fromkeys((*then, *again)):
            if place not in then or place not in again or then[place] != again[place]:
                other_numbers[place] = _change(then.get(place), again.get(place))
    return Repetition(
        folder=before,
        arguments=arguments,
        changed=_changed(read_json(before / RESULTS), read_json(now / RESULTS)),
        records=tuple(names),
        other_bytes=other_bytes,
        other_numbers=other_numbers,
        numbers=count,
    )


def _records(run: Path) -> Iterator[Path]:
    return (run / FLIGHTS).glob("[!.]*.parquet")


def _compared(before: Path, now: Path) -> tuple[str, bool]:
    """Return what differs between two records, "" for nothing, and whether numbers do."""
    for path, when in ((before, "before"), (now, "now")):
        if not path.is_file():
            return f"there was none {when}", True
    try:
        if before.read_bytes() == now.read_bytes():
            return "", False
        then, again = read_record(before), read_record(now)
    except (OSError, HelisimError) as error:
        return f"can't be read: {error}", True
    told = _other_numbers(then, again)
    if told:
        return told, True
    told = difference(dict(then.provenance), dict(again.provenance))
    return f"the same numbers; provenance: {told or 'the same too'}", False


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


def _leaves_of(path: Path) -> dict[str, Any]:
    return dict(_leaves(read_json(path), path.stem))


def _leaves(data: Any, place: str) -> Iterator[tuple[str, Any]]:
    """Yield every number and text with its place, but for versions."""
    if isinstance(data, dict):
        for key, item in data.items():
            if key not in _TOLD:
                yield from _leaves(item, f"{place}.{key}")
    elif isinstance(data, list):
        for k, item in enumerate(data):
            yield from _leaves(item, f"{place}[{_name(item, k)}]")
    else:
        yield place, data


def _name(item: Any, k: int) -> str:
    return str(item["name"]) if isinstance(item, dict) and "name" in item else str(k)


def _change(then: Any, now: Any) -> str:
    if not all(isinstance(one, int | float) and not isinstance(one, bool) for one in (then, now)):
        return f"{then!r} before, {now!r} now"
    share = abs(now - then) / max(abs(then), abs(now), math.ulp(0.0))
    return f"{then!r} before, {now!r} now, {100.0 * share:.2g} % apart"


def _changed(then: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Return the versions, and the model's digest, that differ."""
    told = [
        {**run.get("versions", {}), "model": run.get("configuration", {}).get("model_digest")}
        for run in (then, now)
    ]
    names = dict.fromkeys((*told[0], *told[1]))
    pairs = {name: (str(told[0].get(name)), str(told[1].get(name))) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _shown(told: Mapping[str, str]) -> list[str]:
    lines = [f"  {place}: {text}" for place, text in list(told.items())[:_SHOWN]]
    return [*lines, f"  and {len(told) - _SHOWN} more"] if len(told) > _SHOWN else lines
