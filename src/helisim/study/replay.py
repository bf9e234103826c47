"""Repeats a run from its own provenance and compares: records byte by byte, then every number."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError
from helisim.base.files import read_json
from helisim.base.settings import from_plain
from helisim.study.differences import changes, leaves, listed, record_difference
from helisim.study.flights import RESULTS
from helisim.study.identified import read_models
from helisim.study.reproduce import Arguments, reproduce
from helisim.study.results import read_results
from helisim.study.run import FITS, FLIGHTS
from helisim.vehicle.parameters import number_of

_APART = ("versions", "made_by", "model_digest", "marks", "spans")
"""Left out of the numbers: versions are compared apart, marks and spans only say which records a
fit has seen."""


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
        return {
            "folder": str(self.folder),
            "arguments": asdict(self.arguments),
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
            f"{self.folder}: seed {self.arguments.seed}, {self.arguments.flights} flights "
            "an axis, flown and identified again",
            f"records: {alike} of {len(self.records)} are the same to the byte",
            *listed(self.other_bytes),
            f"results: {self.numbers} numbers compared; "
            + ("all are the same" if self.same else f"{len(self.other_numbers)} places differ"),
            *listed(self.other_numbers),
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
    stated = configuration.get("arguments") if isinstance(configuration, dict) else None
    names = [one.name for one in fields(Arguments)]
    if not isinstance(stated, dict) or set(stated) != set(names):
        raise InputError(
            f"{path}: doesn't say in configuration.arguments how the run was made "
            f"({', '.join(names)}); another version wrote it"
        )
    try:
        arguments = from_plain(Arguments, stated, "configuration.arguments")
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    for name, value in arguments.parameters.items():
        try:
            number_of(name, value)
        except InputError as error:
            raise InputError(f"{path}: configuration.arguments.parameters: {error}") from None
    return arguments


def compare_runs(before: Path, now: Path) -> Repetition:
    """Compare two folders of runs: records byte by byte, then each number of results and fits.

    Raises:
        StorageError: a file of results can't be read.
        InputError: a folder doesn't say how it was made.
    """
    arguments = arguments_of(before)
    names = sorted({path.name for run in (before, now) for path in _records(run)})
    records = {
        name: record_difference(before / FLIGHTS / name, now / FLIGHTS / name) for name in names
    }
    then, again = (
        leaves(_results(run, before), "results", _APART) | leaves(_fits(run), "fits", _APART)
        for run in (before, now)
    )
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


def _records(run: Path) -> Iterator[Path]:
    return (run / FLIGHTS).glob("[!.]*.parquet")


def _results(run: Path, before: Path) -> dict[str, Any]:
    """Return the results of a run as this version writes them, whichever wrote them.

    Where the run before has sentences of what was left out, sentences are compared.
    """
    results = read_results(run / RESULTS)
    found = results.to_dict()
    if _has_sentences(read_json(before / RESULTS)):
        found["excluded"] = [one.message for one in results.excluded]
    return found


def _fits(run: Path) -> dict[str, Any]:
    return {"models": [model.to_dict() for model in read_models(run / FITS)]}


def _has_sentences(results: Mapping[str, Any]) -> bool:
    excluded = results.get("excluded")
    return isinstance(excluded, list) and any(isinstance(one, str) for one in excluded)


def _changed(then: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Return what two runs were made with, where it differs: then and now."""
    made = [
        {
            **run.get("versions", {}),
            "model": run.get("configuration", {}).get("model_digest"),
            "flights left out": "written as sentences" if _has_sentences(run) else "as values",
        }
        for run in (then, now)
    ]
    pairs = {name: (str(made[0].get(name)), str(made[1].get(name))) for name in made[0] | made[1]}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
