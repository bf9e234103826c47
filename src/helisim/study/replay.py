"""Repeats a run from its own provenance and compares: records byte by byte, then every number."""

import math
import tempfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from helisim.base.errors import HelisimError, InputError
from helisim.base.files import read_json
from helisim.base.settings import from_plain, is_number, placed, to_plain
from helisim.records.record import FlightRecord, difference
from helisim.records.storage import read_record
from helisim.study.experiment import Arguments, reproduce
from helisim.study.results import FITS, FLIGHTS, RESULTS, read_models, read_results

_APART = ("versions", "made_by", "model_digest", "marks", "spans")
"""Left out of the numbers: versions are compared apart, marks and spans only say which records a
fit has seen."""
_SHOWN = 10
"""Lines of differences that are printed; the count says how many there are."""


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
    arguments: Arguments
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
        names = {"other_bytes": "records_of_other_bytes", "numbers": "numbers_compared"}
        said: dict[str, Any] = to_plain(self)
        said = {names.get(name, name): one for name, one in said.items()}
        return {**said, "same": self.same}

    def __str__(self) -> str:
        alike = len(self.records) - len(self.other_bytes)
        lines = [
            f"{self.folder}: seed {self.arguments.seed}, {self.arguments.flights} flights "
            "an axis, flown and identified again",
            f"records: {alike} of {len(self.records)} are the same to the byte",
            *_listed(self.other_bytes),
            f"results: {self.numbers} numbers compared; "
            + ("all are the same" if self.same else f"{len(self.other_numbers)} places differ"),
            *_listed(self.other_numbers),
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
        on_progress: called with a word after each flight and each model.

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
        reproduce(out=again, jobs=jobs, on_progress=on_progress, **vars(arguments))
        return compare_runs(folder, again)


def arguments_of(folder: Path) -> Arguments:
    """Return the arguments of `reproduce` that a run was made with.

    Raises:
        StorageError: the folder has no readable results.
        InputError: they don't say it.
    """
    path = folder / RESULTS
    configuration = read_json(path).get("configuration")
    stated = configuration.get("arguments") if isinstance(configuration, Mapping) else None
    if not isinstance(stated, Mapping):
        raise InputError(
            f"{path}: doesn't say in configuration.arguments how the run was made; another "
            "version wrote it"
        )
    with placed(path):
        return from_plain(Arguments, stated, "configuration.arguments")


def compare_runs(before: Path, now: Path) -> Repetition:
    """Compare two folders of runs: records byte by byte, then each number of results and fits.

    Raises:
        StorageError: a file of results can't be read.
        InputError: a folder doesn't say how it was made.
    """
    arguments = arguments_of(before)
    names = sorted(
        {path.name for run in (before, now) for path in (run / FLIGHTS).glob("[!.]*.parquet")}
    )
    records = {
        name: _record_difference(before / FLIGHTS / name, now / FLIGHTS / name) for name in names
    }
    then, again = map(_numbers, (before, now))
    return Repetition(
        folder=before,
        arguments=arguments,
        changed=_changed(read_json(before / RESULTS), read_json(now / RESULTS)),
        records=tuple(names),
        other_bytes={name: message for name, (message, _) in records.items() if message},
        other_numbers={
            **{name: message for name, (message, numbers) in records.items() if numbers},
            **changes(then, again),
        },
        numbers=len(then),
    )


def _numbers(run: Path) -> dict[str, Any]:
    """Return the leaves of a run's results and fits by their place, as this version writes them."""
    fits = {"models": [model.to_dict() for model in read_models(run / FITS)]}
    results = leaves(read_results(run / RESULTS).to_dict(), "results", _APART)
    return results | leaves(fits, "fits", _APART)


def _changed(then: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Return what two runs were made with, where it differs: then and now."""
    first, second = (
        {**run.get("versions", {}), "model": run.get("configuration", {}).get("model_digest")}
        for run in (then, now)
    )
    pairs = {name: (str(first.get(name)), str(second.get(name))) for name in first | second}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def leaves(data: Any, place: str, without: Collection[str] = ()) -> dict[str, Any]:
    """Return every number and text of JSON data by its place, such as "results.tables[heave].cost".

    Keys `without` are left out wherever they stand.
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
    return str(item.get("name", item.get("flight", k)) if isinstance(item, dict) else k)


def changes(then: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, str]:
    """Return how the leaves of two pieces of data differ, by place."""
    places = dict.fromkeys((*then, *now))
    differ = (at for at in places if at not in then or at not in now or then[at] != now[at])
    return {at: _change(then.get(at), now.get(at)) for at in differ}


def _change(then: Any, now: Any) -> str:
    if not (is_number(then) and is_number(now)):
        return f"{then!r} before, {now!r} now"
    share = abs(now - then) / max(abs(then), abs(now), math.ulp(0.0))
    return f"{then!r} before, {now!r} now, {100.0 * share:.2g} % apart"


def _record_difference(before: Path, now: Path) -> tuple[str, bool]:
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


def _listed(found: Mapping[str, str]) -> list[str]:
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
