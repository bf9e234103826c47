"""Run a campaign: fly and identify what is missing, make one dataset of it, and summarise that.

A row of the dataset is one parameter of one model, identified once. Its columns are the replicate,
its point and seed, what varied by key, such as "recorder.noise", and the fields of `ReplicateRow`.
The schema's metadata has one key, `helisim`, a JSON object with `format`, `version` and
`provenance`: the plan of the campaign and the versions that computed it.
"""

import math
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from helisim.base.errors import (
    DivergedError,
    HelisimError,
    InputError,
    StorageError,
    UnknownNameError,
    WorkerError,
)
from helisim.base.files import atomic_write, make_folder, parse_object, read_bytes
from helisim.design.exact import air_met
from helisim.ident import ClosedLoopWarning, CrossControlWarning
from helisim.records.record import (
    AXES,
    IN1,
    FlightRecord,
    difference,
    made_by,
    one_line,
    plain,
    versions,
)
from helisim.records.storage import read_table
from helisim.sim import FlightPlan, Recorder, fly
from helisim.sim.rigs import RigTest, run_rigs
from helisim.study.campaign import MODEL_NAMES, Campaign, Levels, Method, Replicate, Variation
from helisim.study.comparison import ComparisonTable, comparison_table, identify_model
from helisim.study.executors import ONE_THREAD, Executor, local
from helisim.study.experiment import servo_test
from helisim.study.models import SERVOS, ModelSpec
from helisim.vehicle import Vehicle

T = TypeVar("T")

FORMAT = ("campaign", 1)
"""Of a dataset, and its version."""
_METADATA = b"helisim"
_PARTS, _NAME = "parts", "dataset.parquet"
_TYPES = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
_Z = 1.96
"""Standard errors to either side of a 95 % interval."""


@dataclass(frozen=True, kw_only=True)
class ReplicateRow:
    """One parameter of one model as one replicate found it: a row of the dataset.

    Attributes:
        flights: on each axis that were used.
        flight_time: s, of all records that the model was identified from.
        model, method, parameter, unit: what was identified, and how.
        truth: of the vehicle that flew, in the air that it met; None if it has none, or the
            flights failed.
        estimate, cramer_rao, insensitivity, standard_error: in `unit`; None if it failed.
        cost: average J of the fit.
        converged: the fit ended at a minimum.
        at_bound: this parameter ended at a bound.
        flags: what the identification warns of, such as coherent inputs; None if nothing.
        failure: why there is no estimate; None if there is one.
    """

    flights: int
    flight_time: float | None = None
    model: str
    method: str
    parameter: str
    unit: str
    truth: float | None = None
    estimate: float | None = None
    cramer_rao: float | None = None
    insensitivity: float | None = None
    standard_error: float | None = None
    cost: float | None = None
    converged: bool | None = None
    at_bound: bool | None = None
    flags: str | None = None
    failure: str | None = None


class _Task(NamedTuple):
    """What is identified: a model, by a method, from the first flights of each axis."""

    flights: int
    method: Method
    model: ModelSpec

    def row(self, parameter: str, unit: str, **found: Any) -> ReplicateRow:
        return ReplicateRow(
            flights=self.flights,
            model=self.model.name,
            method=self.method,
            parameter=parameter,
            unit=unit,
            **found,
        )

    def failed(self, reason: object) -> list[ReplicateRow]:
        return [
            self.row(parameter.name, parameter.unit, failure=str(reason))
            for parameter in self.model.structure.free
            if parameter.name not in self.model.given
        ]


def fly_and_identify(campaign: Campaign, one: Replicate) -> list[ReplicateRow]:
    """Fly a replicate, identify its models, and return a row for each parameter.

    What failed has rows too, with the reason.
    """
    tasks = [
        _Task(count, method, model)
        for count in campaign.identified_after
        for method in campaign.methods
        for model in campaign.chosen
    ]
    try:
        vehicle = one.settings.load()
        plans = {axis: one.settings.plan(axis, vehicle) for axis in campaign.axes}
        recorder = one.settings.recorder(vehicle)
        air = air_met(vehicle, one.settings.weather())  # the truth is of the hover in it
    except HelisimError as error:
        return [row for task in tasks for row in task.failed(error)]
    flown = {axis: _flights(campaign, one, vehicle, plan) for axis, plan in plans.items()}
    ground = _ground_tests(campaign, one, vehicle, recorder)
    rows: list[ReplicateRow] = []
    found: dict[tuple[int, Method], dict[str, ComparisonTable]] = {}
    for task in tasks:
        model = task.model
        before = found.setdefault((task.flights, task.method), {})
        try:
            flights = {axis: _done(flown[axis])[: task.flights] for axis in model.sweeps}
            estimated = by_method(model, task.method)
            needs = any(given.source not in MODEL_NAMES for given in model.given.values())
            tested = _done(ground) if needs else {}
            with warnings.catch_warnings():  # the fit keeps them as flags
                for kind in (ClosedLoopWarning, CrossControlWarning):
                    warnings.simplefilter("ignore", kind)
                fit = identify_model(estimated, flights, before=before, ground=tested)
            table = comparison_table(vehicle, estimated, fit, recorder, air=air, ground=tested)
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
    """Return a model as it is identified by a method.

    The joint method takes the sticks as reference for what servo signals drive; where sticks
    are the inputs they are outside the loop already, and the model stays as it is.
    """
    if method == "direct":
        return replace(model, reference=())
    if method == "joint" and not model.reference and model.input == "IN1":
        signals = (*model.inputs, *model.conditioning)
        return replace(model, reference=tuple(name.upper() for name in signals if name in IN1))
    return model


def _flights(
    campaign: Campaign, one: Replicate, vehicle: Vehicle, plan: FlightPlan
) -> list[FlightRecord] | HelisimError:
    axis = plan.name
    seed = one.seed * len(AXES) + AXES.index(axis)
    try:
        return fly(vehicle, plan, count=campaign.flights, seed=seed, jobs=1)
    except DivergedError as error:
        number = "" if error.record is None else f" {error.record.provenance['flight'] + 1}"
        return DivergedError(f"flight{number} of {axis}: {error}")
    except HelisimError as error:
        return error


def _ground_tests(
    campaign: Campaign, one: Replicate, vehicle: Vehicle, recorder: Recorder
) -> dict[str, RigTest] | HelisimError:
    """Return the tests by rig, none where no model is given what they find."""
    sources = {given.source for model in campaign.chosen for given in model.given.values()}
    needed = sources.difference(MODEL_NAMES)
    tests: list[RigTest] = []
    try:
        if SERVOS in needed:
            tests.append(servo_test(vehicle, seed=one.seed, recorder=recorder))
        if needed.difference({SERVOS}):
            tests += run_rigs(vehicle, seed=one.seed, recorder=recorder)
        return {test.rig: test for test in tests}
    except HelisimError as error:
        return error


def _done(work: T | HelisimError) -> T:
    """Return what work gave, or raise why it failed."""
    if isinstance(work, HelisimError):
        raise work
    return work


class Dataset:
    """The folder of one campaign: a part for each replicate, one Parquet file in the end.

    Args:
        folder: made when something is written.
        campaign: whose dataset it is.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self.folder = folder
        self.campaign = campaign
        self._parts = folder / _PARTS

    @cached_property
    def schema(self) -> pa.Schema:
        """The columns, and the provenance."""
        hints = get_type_hints(ReplicateRow)
        columns = [(name, pa.int64()) for name in ("replicate", "point", "seed")]
        columns += [(one.key, _type_of(one)) for one in self.campaign.varied]
        for one in fields(ReplicateRow):
            kinds = [kind for kind in get_args(hints[one.name]) if kind is not NoneType]
            columns.append((one.name, _TYPES[(kinds or [hints[one.name]])[0]]))
        name, version = FORMAT
        header = {"format": name, "version": version, "provenance": self.provenance}
        return pa.schema(columns, metadata={_METADATA: one_line(header)})

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """The plan and the versions that compute its numbers."""
        truth = {"truth": "mean over the air met"} if self.campaign.turbulent else {}
        return dict(plain(made_by("campaign", campaign=self.campaign.to_dict(), **truth)))

    def missing(self) -> list[Replicate]:
        """Return the replicates that are not there yet; a damaged part counts as not there.

        Raises:
            InputError: the folder holds another campaign.
        """
        if self._holds(self.folder / _NAME):
            return []
        return [one for one in self.campaign if not self._holds(self._part(one.number))]

    def add(self, number: int, rows: Sequence[ReplicateRow]) -> None:
        """Write the part of a replicate, complete or not at all. Raises StorageError."""
        one = self.campaign.replicate(number)
        own = {"replicate": number, "point": one.point, "seed": one.seed, **one.values}
        table = pa.Table.from_pylist([own | vars(row) for row in rows], schema=self.schema)
        _write(table, self._part(number))

    def compact(self) -> Path:
        """Write all parts as one file, in order, and remove them. Raises StorageError."""
        path = self.folder / _NAME
        if not path.exists():
            parts = [self._part(number) for number in range(len(self.campaign))]
            _write(pa.concat_tables([_read(part) for part in parts]).combine_chunks(), path)
        for part in self._parts.glob("*.parquet"):
            part.unlink()
        if self._parts.exists():
            self._parts.rmdir()
        return path

    def _part(self, number: int) -> Path:
        return self._parts / f"{number:06d}.parquet"

    def _holds(self, path: Path) -> bool:
        if not path.exists():
            return False
        try:
            found = _header(path, _read(path).schema)
        except StorageError:
            return False
        change = difference(found, self.provenance)
        if change:
            raise InputError(
                f"{path} is of another campaign: {change}; choose another folder, or remove it"
            )
        return True


def _type_of(variation: Variation) -> pa.DataType:
    """Return the column type of what varies; numbers are doubles, written as integers or not."""
    value = variation.law.values[0] if isinstance(variation.law, Levels) else 0.0
    if isinstance(value, tuple):
        return pa.list_(pa.float64())
    return _TYPES[float if type(value) is int else type(value)]


def read_dataset(path: str | Path) -> tuple[pa.Table, dict[str, Any]]:
    """Return a campaign's table and its provenance.

    Args:
        path: of the dataset, or of the folder that it is in.

    Raises:
        StorageError: it is missing, damaged, or something else.
    """
    path = Path(path)
    if path.is_dir():
        path = path / _NAME
    if not path.exists():
        raise StorageError(f"{path}: no such file; a campaign writes it when it is complete")
    table = _read(path)
    return table, _header(path, table.schema)


def _write(table: pa.Table, path: Path) -> None:
    with atomic_write(path) as temporary:
        pq.write_table(table, temporary, compression="zstd", write_page_checksum=True)


def _read(path: Path) -> pa.Table:
    return read_table(path, read_bytes(path))


def _header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """Return the provenance in the metadata. Raises StorageError."""
    metadata = (schema.metadata or {}).get(_METADATA)
    if metadata is None:
        raise StorageError(f"{path}: not a campaign's dataset: its schema has no 'helisim'")
    header = parse_object(metadata, f"{path}: the metadata 'helisim'")
    found = (header.get("format"), header.get("version"))
    if found != FORMAT or not isinstance(header.get("provenance"), dict):
        raise StorageError(f"{path}: holds {found!r:.80}, expected {FORMAT} with provenance")
    return header["provenance"]


def run_campaign(
    campaign: Campaign,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    on_replicate: Callable[[], None] | None = None,
) -> Path:
    """Fly and identify every replicate that the folder doesn't hold yet.

    The dataset's bytes depend on the campaign and on the versions of the libraries, not on the
    executor, its workers, or how often the campaign was interrupted.

    Args:
        campaign: to run.
        folder: of `parts/`, a file for each finished replicate, which in the end become
            `dataset.parquet`.
        executor: `local()` if None.
        on_replicate: called once for each replicate that is there, for progress.

    Returns:
        The path of the dataset.

    Raises:
        InputError: the folder holds another campaign.
        StorageError: the folder can't be made or written.
        WorkerError: workers were lost again and again, or can't be used.
    """
    dataset = Dataset(Path(folder), campaign)
    missing = dataset.missing()
    on_replicate = on_replicate or (lambda: None)
    for _ in range(len(campaign) - len(missing)):
        on_replicate()
    if missing:
        make_folder(dataset.folder / _PARTS)
        tasks = [_Sent(campaign, one, versions()) for one in missing]
        with closing((executor or local())(_work, tasks)) as finished:  # stops what still runs
            for number, rows in finished:
                dataset.add(number, rows)
                on_replicate()
    return dataset.compact()


class _Sent(NamedTuple):
    """What is sent to a worker."""

    campaign: Campaign
    replicate: Replicate
    versions: Mapping[str, str]


def _work(task: _Sent) -> tuple[int, list[ReplicateRow]]:
    """Do one replicate, in a worker. Raises WorkerError where its numbers would differ."""
    change = difference(versions(), task.versions)
    if change:
        raise WorkerError(f"a worker can't give the same numbers: {change} (its version there)")
    for name, count in ONE_THREAD.items():
        if os.environ.get(name) != count:
            raise WorkerError(
                f"a worker can't give the same numbers: start it with {name}={count}, as Dask's "
                "nanny does"
            )
    return task.replicate.number, fly_and_identify(task.campaign, task.replicate)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """How one parameter was found over the replicates of a group; errors relative to truth.

    Attributes:
        group: value by column.
        model, parameter: names.
        count: estimates.
        failed: replicates without one.
        bias: mean error.
        scatter: standard deviation of the error.
        stated: root mean square of the stated standard errors.
        cramer_rao: root mean square of the bounds.
        covered: share of the 95 % intervals, 1.96 stated standard errors, that hold the truth.
        covered_by_cr: share of the intervals of one bound to either side that do.
    """

    group: dict[str, Any]
    model: str
    parameter: str
    count: int
    failed: int
    bias: float = math.nan
    scatter: float = math.nan
    stated: float = math.nan
    cramer_rao: float = math.nan
    covered: float = math.nan
    covered_by_cr: float = math.nan


def summarise(table: pa.Table, *, by: Sequence[str] = ()) -> list[Summary]:
    """Summarise a campaign's dataset, a row for each parameter of each model in each group.

    Args:
        table: of `read_dataset`.
        by: columns whose values make the groups; all replicates together by default. Methods
            and numbers of flights are never mixed.

    Raises:
        UnknownNameError: no such column.
    """
    for name in by:
        if name not in table.column_names:
            raise UnknownNameError("column", name, table.column_names)
    grouped = list(dict.fromkeys([*by, "flights", "method"]))
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in table.to_pylist():
        values = (row[name] for name in (*grouped, "model", "parameter"))
        key = tuple(tuple(value) if isinstance(value, list) else value for value in values)
        groups.setdefault(key, []).append(row)
    return [
        _summary(dict(zip(grouped, key)), key[-2], key[-1], rows) for key, rows in groups.items()
    ]


def errors(rows: Sequence[dict[str, Any]]) -> NDArray[np.float64]:
    """Return the relative errors of the rows that have an estimate, (n_estimate,)."""
    return np.array(
        [(row["estimate"] - row["truth"]) / abs(row["truth"]) for row in rows if _judged(row)]
    )


def _judged(row: dict[str, Any]) -> bool:
    return row["estimate"] is not None and row["truth"] is not None


def _summary(
    group: dict[str, Any], model: str, parameter: str, rows: Sequence[dict[str, Any]]
) -> Summary:
    judged = [row for row in rows if _judged(row)]
    failed = sum(row["failure"] is not None for row in rows)
    given: dict[str, Any] = {"group": group, "model": model, "parameter": parameter}
    given |= {"count": len(judged), "failed": failed}
    if not judged:
        return Summary(**given)
    error = errors(judged)
    size = np.array([abs(row["truth"]) for row in judged])
    stated = np.array([row["standard_error"] for row in judged]) / size
    bound = np.array([row["cramer_rao"] for row in judged]) / size
    return Summary(
        **given,
        bias=float(error.mean()),
        scatter=float(error.std(ddof=1)) if len(judged) > 1 else math.nan,
        stated=math.sqrt(float(np.mean(stated**2))),
        cramer_rao=math.sqrt(float(np.mean(bound**2))),
        covered=float(np.mean(np.abs(error) <= _Z * stated)),
        covered_by_cr=float(np.mean(np.abs(error) <= bound)),
    )


_HEADINGS = ("parameter", "n", "failed", "bias %", "scat. %", "SE %", "CR %", "in 95 %", "in CR")


def render(summaries: Sequence[Summary]) -> str:
    """Return the summaries as lines of at most 80 columns, a block for each group and model."""
    blocks: dict[str, list[str]] = {}
    for one in summaries:
        where = ", ".join(f"{name} {_text(value)}" for name, value in one.group.items())
        percents = (one.bias, one.scatter, one.stated, one.cramer_rao)
        shares = (one.covered, one.covered_by_cr)
        blocks.setdefault(f"{one.model} ({where})", []).append(
            f"  {one.parameter:<12}{one.count:8d}{one.failed:8d}"
            + "".join(f"{100.0 * value:8.2f}" for value in percents)
            + "".join(f"{100.0 * value:7.1f}%" for value in shares)
        )
    heading = f"  {_HEADINGS[0]:<12}" + "".join(f"{text:>8}" for text in _HEADINGS[1:])
    return "\n\n".join("\n".join([title, heading, *lines]) for title, lines in blocks.items())


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
