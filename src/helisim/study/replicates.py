"""Runs of a campaign, their dataset and its summary."""

import math
import shutil
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from helisim.base.errors import HelisimError, InputError, StorageError, WorkerError, check_known
from helisim.base.files import atomic_write, make_folder, parse_object, read_bytes
from helisim.base.settings import grouped
from helisim.design.exact import air_met
from helisim.ident import ClosedLoopWarning, CrossControlWarning
from helisim.records.record import (
    AXES,
    IN1,
    FlightRecord,
    difference,
    made_by,
    one_blas_thread,
    one_line,
    plain,
    versions,
)
from helisim.records.storage import read_table
from helisim.sim import Recorder, Weather, fly
from helisim.sim.rigs import RigTest, run_rigs
from helisim.study.campaign import MODEL_NAMES, Campaign, Method, Replicate
from helisim.study.comparison import ComparisonTable, comparison_table, identify_model
from helisim.study.executors import Executor, local
from helisim.study.experiment import servo_test
from helisim.study.models import SERVOS, ModelSpec
from helisim.vehicle import Vehicle

Row = dict[str, Any]

FORMAT = ("campaign", 1)  # format's name and version, in the schema's metadata
_METADATA = b"helisim"
_PARTS, _NAME = "parts", "dataset.parquet"
COLUMNS: dict[str, pa.DataType] = {
    "flights": pa.int64(),
    "flight_time": pa.float64(),
    "model": pa.string(),
    "method": pa.string(),
    "parameter": pa.string(),
    "unit": pa.string(),
    "truth": pa.float64(),
    "estimate": pa.float64(),
    "cramer_rao": pa.float64(),
    "insensitivity": pa.float64(),
    "standard_error": pa.float64(),
    "cost": pa.float64(),
    "converged": pa.bool_(),
    "at_bound": pa.bool_(),
    "flags": pa.string(),
    "failure": pa.string(),
}
"""Columns after replicate, point, seed and varied keys; a row is one parameter identified once.

`flights` were used on each axis, `flight_time` s in all. The truth is that in the air met.
Truth and estimates are null where `failure` states a reason. `flags` are warnings of the fit."""
_TRUTH = "mean over the air met"
_Z = 1.96  # half width of a 95 % interval in standard errors


class _Task(NamedTuple):
    flights: int
    method: Method
    model: ModelSpec

    def row(self, parameter: str, unit: str, **found: Any) -> Row:
        given = {"flights": self.flights, "model": self.model.name, "method": self.method}
        return dict.fromkeys(COLUMNS) | given | {"parameter": parameter, "unit": unit, **found}

    def failed(self, reason: object) -> list[Row]:
        return [
            self.row(one.name, one.unit, failure=str(reason))
            for one in self.model.structure.free
            if one.name not in self.model.given
        ]


def fly_and_identify(campaign: Campaign, one: Replicate) -> list[Row]:
    """Fly a replicate, identify its models; return a row of `COLUMNS` for each parameter."""
    tasks = [
        _Task(count, method, model)
        for count in campaign.identified_after
        for method in campaign.methods
        for model in campaign.chosen
    ]
    try:
        vehicle = one.load()
        own = Recorder.of(vehicle)
        recorder = one.changed("recorder", own)
        plans = {axis: one.plan(axis, vehicle.parameters, own) for axis in campaign.axes}
        air = air_met(vehicle, one.changed("weather", Weather()))  # the truth is of the hover in it
        ground = _ground_tests(campaign.chosen, vehicle, one.seed, recorder)
    except HelisimError as error:
        return [row for task in tasks for row in task.failed(error)]
    flown: dict[str, list[FlightRecord] | HelisimError] = {}
    for axis, plan in plans.items():
        seed = one.seed * len(AXES) + AXES.index(axis)
        try:
            flown[axis] = fly(vehicle, plan, count=campaign.flights, seed=seed, jobs=1)
        except HelisimError as error:
            flown[axis] = error
    rows: list[Row] = []
    found: dict[tuple[int, Method], dict[str, ComparisonTable]] = {}
    for task in tasks:
        model = task.model
        before = found.setdefault((task.flights, task.method), {})
        try:
            flights = {axis: _done(flown[axis])[: task.flights] for axis in model.sweeps}
            estimated = by_method(model, task.method)
            with warnings.catch_warnings():  # the fit keeps them as flags
                for kind in (ClosedLoopWarning, CrossControlWarning):
                    warnings.simplefilter("ignore", kind)
                fit = identify_model(estimated, flights, before=before, ground=ground)
            table = comparison_table(vehicle, estimated, fit, recorder, air=air, ground=ground)
        except HelisimError as error:
            rows += task.failed(error)
            continue
        before[model.name] = table
        time = sum(record.duration for records in flights.values() for record in records)
        rows += [
            task.row(
                row.name,
                row.unit,
                flight_time=time,
                truth=row.truth,
                estimate=row.identified,
                cramer_rao=fit[row.name].cramer_rao,
                insensitivity=fit[row.name].insensitivity,
                standard_error=fit[row.name].standard_error,
                cost=fit.cost,
                converged=fit.converged,
                at_bound=fit[row.name].at_bound,
                flags="; ".join(fit.data.flags) or None,
            )
            for row in table.parameters
            if not fit[row.name].fixed
        ]
    return rows


def by_method(model: ModelSpec, method: Method) -> ModelSpec:
    """Return a model as identified by a method; "joint" has sticks as reference of servos."""
    if method == "direct":
        return replace(model, reference=())
    if method == "joint" and not model.reference and model.input == "IN1":
        signals = (*model.inputs, *model.conditioning)
        return replace(model, reference=tuple(name.upper() for name in signals if name in IN1))
    return model


def _ground_tests(
    models: Sequence[ModelSpec], vehicle: Vehicle, seed: int, recorder: Recorder
) -> dict[str, RigTest]:
    sources = {given.source for model in models for given in model.given.values()}
    needed = sources.difference(MODEL_NAMES)
    tests = [servo_test(vehicle, seed=seed, recorder=recorder)] if SERVOS in needed else []
    if needed.difference({SERVOS}):
        tests += run_rigs(vehicle, seed=seed, recorder=recorder)
    return {test.rig: test for test in tests}


def _done(work: list[FlightRecord] | HelisimError) -> list[FlightRecord]:
    if isinstance(work, HelisimError):
        raise work
    return work


def _schema(campaign: Campaign) -> pa.Schema:
    """Return columns, and as provenance the plan and the versions that compute its numbers."""
    columns = [(name, pa.int64()) for name in ("replicate", "point", "seed")]
    types = {bool: pa.bool_(), str: pa.string(), tuple: pa.list_(pa.float64())}
    columns += [(one.key, types.get(type(one.values[0]), pa.float64())) for one in campaign.varied]
    name, version = FORMAT
    made = dict(plain(made_by("campaign", campaign=campaign.to_dict(), truth=_TRUTH)))
    header = {"format": name, "version": version, "provenance": made}
    return pa.schema([*columns, *COLUMNS.items()], metadata={_METADATA: one_line(header)})


def read_dataset(path: str | Path) -> tuple[pa.Table, dict[str, Any]]:
    """Return table and provenance of a campaign's dataset or folder. Raises StorageError."""
    # a campaign writes its dataset when it is complete
    path = Path(path) / _NAME if Path(path).is_dir() else Path(path)
    table = _read(path)
    return table, _header(path, table.schema)


def _write(table: pa.Table, path: Path) -> None:
    with atomic_write(path) as temporary:
        pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)


def _read(path: Path) -> pa.Table:
    return read_table(path, read_bytes(path))


def _header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    metadata = (schema.metadata or {}).get(_METADATA, b"{}")
    header = parse_object(metadata, f"{path}: the metadata 'helisim'")
    found = (header.get("format"), header.get("version"))
    if found != FORMAT or not isinstance(header.get("provenance"), dict):
        raise StorageError(
            f"{path}: not a campaign's dataset: it holds {found!r:.80}, expected {FORMAT} with "
            "provenance"
        )
    return header["provenance"]


def run_campaign(
    campaign: Campaign,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    on_replicate: Callable[[], None] | None = None,
) -> Path:
    """Fly and identify every replicate that the folder lacks; return the path of the dataset.

    Its bytes depend on campaign and library versions only, not on the executor, `local()` if None.
    Raises InputError where the folder holds another campaign, StorageError, or WorkerError.
    """
    path, parts, schema = Path(folder) / _NAME, Path(folder) / _PARTS, _schema(campaign)
    files = [parts / f"{number:06d}.parquet" for number in range(len(campaign))]
    whole = _holds(path, schema)
    missing = [one for one in campaign if not whole and not _holds(files[one.number], schema)]
    on_replicate = on_replicate or (lambda: None)
    for _ in range(len(campaign) - len(missing)):
        on_replicate()
    if missing:
        make_folder(parts)
        work = partial(_work, campaign, versions())
        with closing((executor or local())(work, missing)) as finished:  # stops what still runs
            for number, rows in finished:
                one = campaign.replicate(number)
                own = {"replicate": number, "point": one.point, "seed": one.seed, **one.values}
                table = pa.Table.from_pylist([own | row for row in rows], schema=schema)
                _write(table, files[number])
                on_replicate()
    if not whole:
        _write(pa.concat_tables([_read(file) for file in files]).combine_chunks(), path)
    shutil.rmtree(parts, ignore_errors=True)
    return path


def _holds(path: Path, schema: pa.Schema) -> bool:
    """Return whether a file is intact. Raises InputError if it is of another campaign."""
    try:
        found = _header(path, _read(path).schema)
    except StorageError:
        return False
    change = difference(found, _header(path, schema))
    if change:
        raise InputError(
            f"{path} is of another campaign: {change}; choose another folder, or remove it"
        )
    return True


def _work(campaign: Campaign, expected: Mapping[str, str], one: Replicate) -> tuple[int, list[Row]]:
    change = difference(versions(), expected)
    if change:
        raise WorkerError(f"a worker can't give the same numbers: {change} (its version there)")
    with one_blas_thread():  # last bits of a matrix product depend on the number of threads
        return one.number, fly_and_identify(campaign, one)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Statistics of one parameter over the replicates of a group; errors relative to truth.

    `failed` replicates have no estimate. Bias and scatter are mean and standard deviation of the
    error, `stated` and `cramer_rao` the rms of standard errors and bounds. `covered` is the share
    of 95 % intervals, 1.96 standard errors, that hold the truth, `covered_by_cr` of those of one
    bound.
    """

    group: dict[str, Any]
    model: str
    parameter: str
    count: int
    failed: int
    bias: float
    scatter: float
    stated: float
    cramer_rao: float
    covered: float
    covered_by_cr: float


def summarise(table: pa.Table, *, by: Sequence[str] = ()) -> list[Summary]:
    """Summarise a dataset, a row for each parameter of each model in each group of columns `by`.

    Methods and numbers of flights are never mixed. Raises UnknownNameError for no such column.
    """
    check_known("column", by, table.column_names)
    columns = list(dict.fromkeys([*by, "flights", "method"]))

    def key(row: dict[str, Any]) -> tuple[Any, ...]:
        values = (row[name] for name in (*columns, "model", "parameter"))
        return tuple(tuple(value) if isinstance(value, list) else value for value in values)

    return [
        _summary(dict(zip(columns, its)), its[-2], its[-1], rows)
        for its, rows in grouped(table.to_pylist(), key).items()
    ]


def errors(rows: Sequence[dict[str, Any]]) -> NDArray[np.float64]:
    """Return relative errors of the rows with an estimate, (n_estimate,)."""
    return np.array(
        [(row["estimate"] - row["truth"]) / abs(row["truth"]) for row in rows if _judged(row)]
    )


def _judged(row: dict[str, Any]) -> bool:
    return row["estimate"] is not None and row["truth"] is not None


def _summary(
    group: dict[str, Any], model: str, parameter: str, rows: Sequence[dict[str, Any]]
) -> Summary:
    judged = [row for row in rows if _judged(row)]
    error = errors(judged)
    size = np.array([abs(row["truth"]) for row in judged])
    stated = np.array([row["standard_error"] for row in judged]) / size
    bound = np.array([row["cramer_rao"] for row in judged]) / size
    return Summary(
        group=group,
        model=model,
        parameter=parameter,
        count=len(judged),
        failed=sum(row["failure"] is not None for row in rows),
        bias=_mean(error),
        scatter=float(error.std(ddof=1)) if len(judged) > 1 else math.nan,
        stated=math.sqrt(_mean(stated**2)),
        cramer_rao=math.sqrt(_mean(bound**2)),
        covered=_mean(np.abs(error) <= _Z * stated),
        covered_by_cr=_mean(np.abs(error) <= bound),
    )


def _mean(values: NDArray[Any]) -> float:
    return float(np.mean(values)) if values.size else math.nan


_HEADINGS = ("parameter", "n", "failed", "bias %", "scat. %", "SE %", "CR %", "in 95 %", "in CR")


def render(summaries: Sequence[Summary]) -> str:
    """Return summaries as lines of at most 80 columns, a block for each group and model."""
    blocks: dict[str, list[str]] = {}
    for one in summaries:
        where = ", ".join(
            f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
            for name, value in one.group.items()
        )
        percents = (one.bias, one.scatter, one.stated, one.cramer_rao)
        shares = (one.covered, one.covered_by_cr)
        blocks.setdefault(f"{one.model} ({where})", []).append(
            f"  {one.parameter:<12}{one.count:8d}{one.failed:8d}"
            + "".join(f"{100.0 * value:8.2f}" for value in percents)
            + "".join(f"{100.0 * value:7.1f}%" for value in shares)
        )
    heading = f"  {_HEADINGS[0]:<12}" + "".join(f"{text:>8}" for text in _HEADINGS[1:])
    return "\n\n".join("\n".join([title, heading, *lines]) for title, lines in blocks.items())
