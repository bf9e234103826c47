"""A run read back from its folder: results, the fits behind them, a sweep of each axis."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from helisim.errors import InputError, StorageError
from helisim.records.channels import AXES
from helisim.records.files import read_json
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record
from helisim.study.identified import Evidence, read_evidence
from helisim.study.results import ComparisonTable, ParameterRow

RESULTS = "results.json"
FITS = "fits.json"
FLIGHTS = "flights"
_NEEDED = ("tables", "seed", "versions", "configuration")


@dataclass(frozen=True, eq=False)
class Run:
    """Everything that a report of an experiment shows.

    Attributes:
        results: what `results.json` holds.
        tables: those of the results.
        evidence: the fits behind its tables.
        sweeps: one kept record for each axis that was swept.
    """

    results: Mapping[str, Any]
    tables: tuple[ComparisonTable, ...]
    evidence: tuple[Evidence, ...] = ()
    sweeps: Mapping[str, FlightRecord] = field(default_factory=dict)


def read_run(folder: str | Path) -> Run:
    """Read a run from the folder that `helisim reproduce` wrote.

    Raises:
        StorageError: the folder has no readable results.
        InputError: a file holds something else.
    """
    folder = Path(folder)
    if not (folder / RESULTS).is_file():
        raise StorageError(
            f"{folder} has no {RESULTS}; give the folder that helisim reproduce --out wrote"
        )
    results, tables = _read_results(folder / RESULTS)
    evidence = read_evidence(folder / FITS) if (folder / FITS).is_file() else ()
    left_out = set(re.findall(r"^flight (\S+):", "\n".join(results.get("excluded", [])), re.M))
    sweeps = {}
    for axis in AXES:
        for path in sorted((folder / FLIGHTS).glob(f"{axis}_[0-9]*.parquet")):
            if path.stem not in left_out:
                sweeps[axis] = read_record(path)
                break
    return Run(results, tables, evidence, sweeps)


def _read_results(path: Path) -> tuple[Mapping[str, Any], tuple[ComparisonTable, ...]]:
    results = read_json(path)
    missing = [name for name in _NEEDED if name not in results]
    if missing:
        raise InputError(f"{path}: not the results of a run: it has no {', '.join(missing)}")
    try:
        return results, tuple(_table(data) for data in results["tables"])
    except (KeyError, TypeError, InputError) as error:
        raise InputError(f"{path}: not the results of a run: {error!r}") from None


def _table(data: Mapping[str, Any]) -> ComparisonTable:
    names = ParameterRow.__dataclass_fields__
    rows = [
        ParameterRow(**{name: value for name, value in row.items() if name in names})
        for row in data["parameters"]
    ]
    low, high = data["band_rad_s"]
    return ComparisonTable(
        name=data["name"],
        input=data["input"],
        cost=data["cost"],
        band_rad_s=(low, high),
        parameters=tuple(rows),
    )
