"""Verifies an identified model in the time domain, on a record that no fit has seen.

Estimated from the record are each output's bias and the state's trim error alone. A trim error,
a constant rate of a state, adds the model's own motions to a constant, and so does an unknown
initial state: the latter is what is solved for, with an input's trim beside it where the model
integrates. An unstable model is verified in segments, see `helisim.ident.verifying.segments`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.fitting.result import Fit
from helisim.ident.model.evaluate import matrices, proper_part
from helisim.ident.model.simulation import delayed, simulate
from helisim.ident.responses.record_checks import refuse_truncated
from helisim.ident.responses.seen import record_digest, share_seen
from helisim.ident.verifying.segments import FREE_DECADES, INTEGRATES, ahead_of_time, in_segments
from helisim.ident.verifying.verification import (
    Approach,
    Trace,
    Verification,
    overall_theil,
    root_mean_square,
    theil,
)
from helisim.records.provenance import one_blas_thread
from helisim.records.record import FlightRecord

_SHARED = 0.25
"""A record of whose time the fit has seen more is no new one. Less is what parts share that are
cut side by side, with a margin for filters to settle."""

_DOUBLINGS = 3.0
"""Of an error, over a segment of an unstable model and over a record that is predicted whole.
Eight times the error of a model that is good is good still; a longer segment is upset by gusts."""

_HARDLY = 0.01
"""Doublings over a record below which a pole counts as an integrator's, not as unstable."""

_TELLS = 3.0
"""An output tells of a model where it moves, or is predicted to, by so many times its noise:
noise alone then is a coefficient of 0.16, well below what is acceptable."""

_PERIODS = 1.0
"""Of the lowest frequency of a fit: the past that gives a stable model's state."""


@one_blas_thread()
def verify(
    fit: Fit,
    records: FlightRecord | Sequence[FlightRecord],
    *,
    segment: float | None = None,
    ahead: float | None = None,
    use_ended: bool = False,
) -> Verification:
    """Simulate a fitted model on records, estimating only bias, trim and initial state.

    A stable model is simulated over each record. From one initial state an unstable one diverges,
    however good it is: where its errors would double more than 3 times over a record, it is
    simulated in segments in which they don't, each from a state of its own.

    Args:
        fit: the model, with its delays.
        records: flights that the fit has not seen, such as doublets.
        segment: length of segments to simulate in, s, whatever the model; with `ahead` the past
            that gives a state.
        ahead: predict each sample so many seconds ahead, from the samples before alone.
        use_ended: True takes flights that were terminated early too.

    Raises:
        InputError: a record was used in the fit, or lacks a channel; a segment is too short.
        IdentificationError: the model diverges over the record, or a flight was terminated early.
    """
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    for name, value in (("segment", segment), ("ahead", ahead)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name} must be a positive time in s, got {value}")
    if not use_ended:
        refuse_truncated(flights)
    for position, flight in enumerate(flights):
        refuse_seen(fit, flight, f"record {position}")
    traces, approach = _predicted(fit, flights, segment, ahead)
    error = np.concatenate([trace.error for trace in traces])
    telling = np.concatenate([trace.telling for trace in traces])
    answer = telling - np.concatenate([trace.residual for trace in traces])
    outputs = fit.structure.outputs
    quiet = _quiet(flights, outputs, telling, answer)
    told = [k for k, name in enumerate(outputs) if name not in quiet]
    rms = root_mean_square(error)
    return Verification(
        inputs=fit.structure.inputs,
        outputs=outputs,
        units=tuple(flights[0].unit(name) for name in outputs),
        traces=traces,
        j_rms=float(np.sqrt(np.mean(rms**2))),
        tic=overall_theil(telling[:, told], answer[:, told]),
        j_rms_by_output=dict(zip(outputs, rms.tolist())),
        tic_by_output=dict(zip(outputs, theil(telling, answer).tolist())),
        approach=approach,
        quiet=quiet,
    )


def _predicted(
    fit: Fit, flights: Sequence[FlightRecord], segment: float | None, ahead: float | None
) -> tuple[tuple[Trace, ...], Approach]:
    """Return each record's prediction, and how they were predicted."""
    longest = max(flight.duration for flight in flights)
    poles = np.linalg.eigvals(np.asarray(proper_part(fit.structure, fit.values).A))
    fastest = max(poles, key=lambda pole: pole.real, default=0.0)
    doubling = np.log(2.0) / fastest.real if fastest.real > 0.0 else np.inf
    told: dict[str, Any] = {}
    if longest > _HARDLY * doubling:
        told["pole"] = (float(fastest.real), float(fastest.imag))
    limit = _DOUBLINGS * doubling
    if ahead is not None:
        past = segment or min(limit, _PERIODS * 2.0 * np.pi / fit.band[0], 0.5 * longest)
        traces = tuple(ahead_of_time(fit, flight, past, ahead) for flight in flights)
        told |= {"kind": "ahead", "length_s": float(past), "ahead_s": float(ahead)}
    elif segment is not None or longest > limit:
        traces = tuple(in_segments(fit, flight, segment or limit) for flight in flights)
        cut = (np.append(trace.starts, trace.time[-1]) for trace in traces)
        told |= {"kind": "segments", "length_s": float(max(np.max(np.diff(one)) for one in cut))}
    else:
        traces = tuple(_whole(fit, flight) for flight in flights)
        told |= {"kind": "whole", "length_s": longest}
    of_record = len(fit.structure.outputs) + len(fit.structure.states) * (told["kind"] == "whole")
    estimated = sum(trace.estimated or of_record for trace in traces)
    samples = sum(trace.measured.size for trace in traces)
    return traces, Approach(**told, estimated=estimated, samples=samples)


def _quiet(
    flights: Sequence[FlightRecord],
    names: Sequence[str],
    telling: NDArray[np.float64],
    answer: NDArray[np.float64],
) -> tuple[str, ...]:
    """Return the outputs whose motion, measured and predicted, hardly rises above the noise."""
    noise = np.sqrt(np.mean([_noise(flight.select(names)) ** 2 for flight in flights], axis=0))
    size = np.maximum(root_mean_square(telling), root_mean_square(answer))
    quiet = tuple(name for name, x, y in zip(names, size, noise) if x < _TELLS * y)
    return () if len(quiet) == len(names) else quiet


def _noise(measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rms of white noise with the spectrum that the fastest fifth has, (n_out,).

    Motion is slower than that; noise behind a filter is more than this, never less.
    """
    window = np.hanning(len(measured))[:, None]
    spectrum = np.fft.rfft(window * (measured - np.mean(measured, axis=0)), axis=0)
    fastest = np.abs(spectrum[-max(1, len(spectrum) // 5) :]) ** 2
    return np.sqrt(np.mean(fastest, axis=0) / np.sum(window**2))


def refuse_seen(fit: Fit, record: FlightRecord, name: str) -> None:
    """Raise InputError, with the record's name, if the fit has seen more than a part of it.

    See `helisim.ident.responses.seen` for what a part of a record is known by.
    """
    share = share_seen(record, fit.data.spans)
    if share > _SHARED or record_digest(record) in fit.data.sources:
        part = "" if share == 0.0 else f" (about {100.0 * share:.0f} % of its time)"
        raise InputError(
            f"{name}: was used in the fit{part}, so it can't verify it; "
            "give a record that no fit has seen"
        )


def _whole(fit: Fit, flight: FlightRecord) -> Trace:
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
            "verify it in segments (--segment S)"
        )
    columns = free.reshape(free.shape[0], -1)
    size = np.linalg.norm(columns, axis=1)
    size = np.where(size > 0.0, size, 1.0)
    gap = (measured - forced).reshape(-1)
    weight = np.linalg.lstsq((columns / size[:, None]).T, gap, rcond=FREE_DECADES)[0] / size
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
    if n and np.linalg.cond(model.A) > INTEGRATES:
        motions += [simulate(model, at_rest + np.eye(n_in)[k], step) for k in range(n_in)]
    return np.stack(motions)
