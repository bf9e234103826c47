"""Verifies an identified model in the time domain, on a record that no fit has seen.

Estimated from the record are each output's bias and the state's trim error alone. A trim error,
a constant rate of a state, adds the model's own motions to a constant, and so does an unknown
initial state: the latter is what is solved for, with an input's trim beside it where the model
integrates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from helisim.errors import IdentificationError, InputError
from helisim.ident.evaluate import matrices, proper_part
from helisim.ident.record_checks import refuse_truncated
from helisim.ident.result import Fit
from helisim.ident.seen import record_digest, share_seen
from helisim.ident.simulation import delayed, simulate
from helisim.ident.threads import one_blas_thread
from helisim.records.display import Displayed, shower
from helisim.records.record import FlightRecord
from helisim.records.value import FrozenMap, Value

if TYPE_CHECKING:
    from helisim.records.display import Axes, Figure

ACCEPTABLE_TIC = 0.25
"""Theil's coefficient up to which a model predicts well (Tischler and Remple)."""

_SHARED = 0.25
"""A record of whose time the fit has seen more is no new one. Less is what parts share that are
cut side by side, with a margin for filters to settle."""

_INTEGRATES = 1e8
"""Condition number of A from which the model integrates, so that an input's trim is a drift;
otherwise bias and initial state can stand for it."""

_FREE_DECADES = 1e-9
"""Bias, trim and initial-state directions weaker than this share are left at zero."""


@dataclass(frozen=True, eq=False, repr=False)
class Trace(Value):
    """One record, measured and predicted. Read-only.

    Attributes:
        time: (n_time,) s.
        inputs: (n_time, n_in) as recorded.
        measured: (n_time, n_out).
        predicted: (n_time, n_out), with the estimated bias, trim and initial state.
        bias: (n_out,) constant that was added to the prediction.
    """

    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    bias: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("time", "inputs", "measured", "predicted", "bias"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus predicted, (n_time, n_out)."""
        return self.measured - self.predicted

    @property
    def j_rms(self) -> NDArray[np.float64]:
        """Root mean square error of each output in its unit, (n_out,)."""
        return _rms(self.residual)

    @property
    def tic(self) -> NDArray[np.float64]:
        """Theil's inequality coefficient of each output about its mean, (n_out,)."""
        trim = np.mean(self.measured, axis=0)
        return _theil(self.measured - trim, self.predicted - trim)


@dataclass(frozen=True, kw_only=True)
class VerifiedOutput:
    """How well one output was predicted.

    Attributes:
        name: of the output.
        unit: of `j_rms`.
        j_rms: root mean square error.
        tic: Theil's inequality coefficient, 0 perfect, 1 useless.
    """

    name: str
    unit: str
    j_rms: float
    tic: float


@dataclass(frozen=True, kw_only=True)
class VerifiedRecord:
    """How well one flight was predicted.

    Attributes:
        duration_s: of the flight, s.
        j_rms: output -> root mean square error, in its unit.
        tic: output -> Theil's inequality coefficient.
        bias: output -> constant that was added to the prediction, in its unit.
    """

    duration_s: float
    j_rms: Mapping[str, float]
    tic: Mapping[str, float]
    bias: Mapping[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        found = {name: dict(getattr(self, name)) for name in ("j_rms", "tic", "bias")}
        return {"duration_s": self.duration_s, **found}

    def __post_init__(self) -> None:
        for name in ("j_rms", "tic", "bias"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))


@dataclass(frozen=True, kw_only=True)
class VerificationFigures:
    """The figures of a verification, without its time histories.

    Attributes:
        j_rms: root mean square error over all outputs, each in its unit.
        tic: Theil's inequality coefficient over all outputs.
        outputs: one an output.
        records: one a flight.
    """

    j_rms: float
    tic: float
    outputs: tuple[VerifiedOutput, ...]
    records: tuple[VerifiedRecord, ...]

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.outputs)
        return f"VerificationFigures({names} of {len(self.records)} record(s), TIC {self.tic:.3f})"

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25."""
        return self.tic <= ACCEPTABLE_TIC

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            "j_rms": self.j_rms,
            "tic": self.tic,
            "acceptable": self.acceptable,
            "outputs": [asdict(one) for one in self.outputs],
            "records": [one.to_dict() for one in self.records],
        }


@dataclass(frozen=True, eq=False)
class Verification(Value, Displayed):
    """How well a model predicts records that it was not fitted to.

    Attributes:
        inputs: names of the inputs.
        outputs: names of the outputs.
        units: their units.
        traces: one a record.
        j_rms: root mean square error over all outputs, each in its unit.
        tic: Theil's inequality coefficient over all outputs, 0 perfect, 1 useless; of motions
            about the measured mean, so that a large trim doesn't flatter it.
        j_rms_by_output, tic_by_output: the same for each output by name.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    traces: tuple[Trace, ...]
    j_rms: float
    tic: float
    j_rms_by_output: Mapping[str, float]
    tic_by_output: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in ("j_rms_by_output", "tic_by_output"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    def __repr__(self) -> str:
        judged = "acceptable" if self.acceptable else f"above {ACCEPTABLE_TIC}"
        return (
            f"Verification({', '.join(self.outputs)} of {len(self.traces)} record(s), "
            f"TIC {self.tic:.3f}: {judged})"
        )

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25."""
        return self.figures.acceptable

    @property
    def figures(self) -> VerificationFigures:
        """What is left of it without the time histories, as results keep it."""
        return VerificationFigures(
            j_rms=self.j_rms,
            tic=self.tic,
            outputs=tuple(
                VerifiedOutput(
                    name=name,
                    unit=unit,
                    j_rms=self.j_rms_by_output[name],
                    tic=self.tic_by_output[name],
                )
                for name, unit in zip(self.outputs, self.units)
            ),
            records=tuple(
                VerifiedRecord(
                    duration_s=float(trace.time[-1] - trace.time[0]),
                    j_rms=dict(zip(self.outputs, trace.j_rms.tolist())),
                    tic=dict(zip(self.outputs, trace.tic.tolist())),
                    bias=dict(zip(self.outputs, trace.bias.tolist())),
                )
                for trace in self.traces
            ),
        )

    def plot(
        self,
        records: "Sequence[int] | int | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw the inputs, each output measured and predicted, and what the prediction leaves.

        Args:
            records: by number, from 0; by default all, side by side.
            axes: to draw on, one a panel, record by record; by default those of a new figure.

        Returns:
            A matplotlib figure, which a notebook shows; nothing is kept of it.

        Raises:
            InputError: no such record, or there are more or fewer axes than panels.
        """
        return shower().plot_verification(self, records, axes)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON, without the traces."""
        return self.figures.to_dict()

    def __str__(self) -> str:
        lines = [f"{'output':<8}  {'unit':<6}  {'J_rms':>10}  {'TIC':>6}"]
        for name, unit in zip(self.outputs, self.units):
            lines.append(
                f"{name:<8}  {unit:<6}  {self.j_rms_by_output[name]:10.4g}  "
                f"{self.tic_by_output[name]:6.3f}"
            )
        lines.append(
            f"all       {'':<6}  {self.j_rms:10.4g}  {self.tic:6.3f}  "
            f"{'acceptable' if self.acceptable else f'above {ACCEPTABLE_TIC}'}"
        )
        return "\n".join(lines)


@one_blas_thread()
def verify(
    fit: Fit, records: FlightRecord | Sequence[FlightRecord], *, use_ended: bool = False
) -> Verification:
    """Simulate a fitted model on records, estimating only bias, trim and initial state.

    Args:
        fit: the model, with its delays.
        records: flights that the fit has not seen, such as doublets.
        use_ended: True takes flights that were terminated early too.

    Raises:
        InputError: a record was used in the fit, or lacks a channel.
        IdentificationError: the model diverges over the record, or a flight was terminated early.
    """
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    if not use_ended:
        refuse_truncated(flights)
    for position, flight in enumerate(flights):
        refuse_seen(fit, flight, f"record {position}")
    traces = tuple(_trace(fit, flight) for flight in flights)
    trims = [np.mean(trace.measured, axis=0) for trace in traces]
    measured = np.concatenate([trace.measured - trim for trace, trim in zip(traces, trims)])
    predicted = np.concatenate([trace.predicted - trim for trace, trim in zip(traces, trims)])
    outputs = fit.structure.outputs
    rms = _rms(measured - predicted)
    tic = _theil(measured, predicted)
    return Verification(
        inputs=fit.structure.inputs,
        outputs=outputs,
        units=tuple(flights[0].unit(name) for name in outputs),
        traces=traces,
        j_rms=float(np.sqrt(np.mean(rms**2))),
        tic=_tic(measured, predicted),
        j_rms_by_output=dict(zip(outputs, rms.tolist())),
        tic_by_output=dict(zip(outputs, tic.tolist())),
    )


def refuse_seen(fit: Fit, record: FlightRecord, name: str) -> None:
    """Raise InputError, with the record's name, if the fit has seen more than a part of it.

    See `helisim.ident.seen` for what a part of a record is known by.
    """
    share = share_seen(record, fit.data.spans)
    if share > _SHARED or record_digest(record) in fit.data.sources:
        part = "" if share == 0.0 else f" (about {100.0 * share:.0f} % of its time)"
        raise InputError(
            f"{name}: was used in the fit{part}, so it can't verify it; "
            "give a record that no fit has seen"
        )


def _trace(fit: Fit, flight: FlightRecord) -> Trace:
    step, time = flight.sample_time, flight.time
    structure = fit.structure
    inputs = flight.select(structure.inputs)
    measured = flight.select(structure.outputs)
    numbers = matrices(structure, fit.values)
    model = proper_part(structure, fit.values)
    forced = delayed(model, inputs - inputs[0], step, numbers.lags, numbers.D1)
    free = _free_motions(fit, time, step)
    if not (np.all(np.isfinite(forced)) and np.all(np.isfinite(free))):
        raise IdentificationError(
            f"the model {structure.name!r} diverges over the record's {flight.duration:.4g} s; "
            "verify an unstable model on short records"
        )
    columns = free.reshape(free.shape[0], -1)
    size = np.linalg.norm(columns, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    gap = (measured - forced).reshape(-1)
    weight = np.linalg.lstsq((columns / size[:, None]).T, gap, rcond=_FREE_DECADES)[0] / size
    n_out = len(structure.outputs)
    predicted = forced + np.tensordot(weight, free, axes=1)
    return Trace(time, inputs, measured, predicted, weight[:n_out])


def _free_motions(fit: Fit, time: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return what bias, initial state and input trim can add, (n_motion, n_time, n_out)."""
    model = proper_part(fit.structure, fit.values)
    n_out, n, n_in = len(fit.structure.outputs), model.nstates, len(fit.structure.inputs)
    motions = [np.tile(np.eye(n_out)[k], (time.size, 1)) for k in range(n_out)]
    at_rest = np.zeros((time.size, n_in))
    motions += [simulate(model, at_rest, step, start=np.eye(n)[k]) for k in range(n)]
    if n and np.linalg.cond(model.A) > _INTEGRATES:
        motions += [simulate(model, at_rest + np.eye(n_in)[k], step) for k in range(n_in)]
    return np.stack(motions)


def _rms(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(np.mean(values**2, axis=0))


def _theil(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Theil's coefficient of each output, (n_out,); 0 where nothing moves at all."""
    size = _rms(measured) + _rms(predicted)
    return _rms(measured - predicted) / np.where(size > 0.0, size, 1.0)


def _tic(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> float:
    """Return Theil's coefficient with each output in units of its own size."""
    size = _rms(measured)
    size = np.where(size > 0.0, size, 1.0)
    error = np.sqrt(np.mean(((measured - predicted) / size) ** 2))
    total = np.sqrt(np.mean((measured / size) ** 2)) + np.sqrt(np.mean((predicted / size) ** 2))
    return float(error / total) if total > 0.0 else 0.0
