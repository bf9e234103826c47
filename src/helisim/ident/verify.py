"""Verifies an identified model in the time domain, on a record that no fit has seen.

Estimated from the record are each output's bias and the initial state alone, with an input's trim
where the model integrates. In segments, as unstable models need them, each has a state of its own;
predicting ahead, a state comes from the samples before it. What a segment's state could make up
tells nothing of the model: with P the projection on the model's free motions, Theil's coefficient
is that of (1 - P) y and (1 - P) y_forced, so that free numbers flatter no model.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.evaluate import delayed, matrices, proper_part, simulate
from helisim.ident.frf import record_digest, refuse_truncated, share_seen
from helisim.ident.result import Fit
from helisim.ident.verification import (
    Approach,
    Trace,
    Verification,
    overall_theil,
    root_mean_square,
    theil,
)
from helisim.records.record import FlightRecord, one_blas_thread

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
_PERIODS = 1.0  # of the lowest frequency of a fit: the past that gives a stable model's state
_INTEGRATES = 1e8
"""Condition number of A from which the model integrates, so that an input's trim is a drift;
otherwise bias and initial state can stand for it."""
_FREE_DECADES = 1e-9
"""Bias, trim and initial-state directions weaker than this share are left at zero."""
_ABSORBED = 1e-6  # a constant of which initial states leave no more than this share is theirs
_PER_NUMBER = 4
"""So many samples at least for each number of a state: fewer hardly tell of the model."""


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
    error, telling, residual = (
        np.concatenate([getattr(trace, name) for trace in traces])
        for name in ("error", "telling", "residual")
    )
    response = telling - residual
    outputs = fit.structure.outputs
    noise = np.sqrt(np.mean([_noise(flight.select(outputs)) ** 2 for flight in flights], axis=0))
    size = np.maximum(root_mean_square(telling), root_mean_square(response))
    told = np.flatnonzero(size >= _TELLS * noise)
    told = told if told.size else np.arange(len(outputs))
    rms = root_mean_square(error)
    return Verification(
        inputs=fit.structure.inputs,
        outputs=outputs,
        units=tuple(flights[0].unit(name) for name in outputs),
        traces=traces,
        j_rms=float(np.sqrt(np.mean(rms**2))),
        tic=overall_theil(telling[:, told], response[:, told]),
        j_rms_by_output=dict(zip(outputs, rms.tolist())),
        tic_by_output=dict(zip(outputs, theil(telling, response).tolist())),
        approach=approach,
        quiet=tuple(name for k, name in enumerate(outputs) if k not in told),
    )


def refuse_seen(fit: Fit, record: FlightRecord, name: str) -> None:
    """Raise InputError, with the record's name, if the fit has seen more than a part of it."""
    share = share_seen(record, fit.data.spans)
    if share > _SHARED or record_digest(record) in fit.data.sources:
        part = "" if share == 0.0 else f" (about {100.0 * share:.0f} % of its time)"
        raise InputError(
            f"{name}: was used in the fit{part}, so it can't verify it; "
            "give a record that no fit has seen"
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
        traces = tuple(_ahead_of_time(fit, flight, past, ahead) for flight in flights)
        told |= {"kind": "ahead", "length_s": float(past), "ahead_s": float(ahead)}
    elif segment is not None or longest > limit:
        traces = tuple(_in_segments(fit, flight, segment or limit) for flight in flights)
        cut = (np.append(trace.starts, trace.time[-1]) for trace in traces)
        told |= {"kind": "segments", "length_s": float(max(np.max(np.diff(one)) for one in cut))}
    else:
        traces = tuple(_whole(fit, flight) for flight in flights)
        told |= {"kind": "whole", "length_s": longest}
    of_record = len(fit.structure.outputs) + len(fit.structure.states) * (told["kind"] == "whole")
    estimated = sum(trace.estimated or of_record for trace in traces)
    samples = sum(trace.measured.size for trace in traces)
    return traces, Approach(**told, estimated=estimated, samples=samples)


def _noise(measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rms of white noise with the spectrum that the fastest fifth has, (n_out,)."""
    window = np.hanning(len(measured))[:, None]
    spectrum = np.fft.rfft(window * (measured - np.mean(measured, axis=0)), axis=0)
    fastest = np.abs(spectrum[-max(1, len(spectrum) // 5) :]) ** 2
    return np.sqrt(np.mean(fastest, axis=0) / np.sum(window**2))


def _whole(fit: Fit, flight: FlightRecord) -> Trace:
    step, time, structure = flight.sample_time, flight.time, fit.structure
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    numbers = matrices(structure, fit.values)
    model = proper_part(structure, fit.values)
    forced = delayed(model, inputs - inputs[0], step, numbers.lags, numbers.D1)
    # what bias, initial state and input trim can add, (n_motion, n_time, n_out)
    n_out, n, n_in = len(structure.outputs), model.nstates, len(structure.inputs)
    motions = [np.tile(np.eye(n_out)[k], (time.size, 1)) for k in range(n_out)]
    at_rest = np.zeros((time.size, n_in))
    motions += [simulate(model, at_rest, step, start=np.eye(n)[k]) for k in range(n)]
    if n and np.linalg.cond(model.A) > _INTEGRATES:
        motions += [simulate(model, at_rest + np.eye(n_in)[k], step) for k in range(n_in)]
    free = np.stack(motions)
    if not (np.all(np.isfinite(forced)) and np.all(np.isfinite(free))):
        raise IdentificationError(
            f"the model {structure.name!r} diverges over the record's {flight.duration:.4g} s; "
            "verify it in segments",
            remedy="segment=S",
        )
    columns = free.reshape(free.shape[0], -1)
    size = _positive(np.linalg.norm(columns, axis=1))
    gap = (measured - forced).reshape(-1)
    weight = np.linalg.lstsq((columns / size[:, None]).T, gap, rcond=_FREE_DECADES)[0] / size
    predicted = forced + np.tensordot(weight, free, axes=1)
    return Trace(time, inputs, measured, predicted, weight[:n_out])


class _Pieces(NamedTuple):
    """A model, ready to predict pieces of a record, all of one length.

    Attributes:
        kernel: (n_kernel, n_out, n_in) response to an input of one sample, from `after` samples
            before it.
        free: (length, n_out, n_state) motions of the initial states.
        before, after: samples of input that a piece needs around it, as outputs lag or lead.
        integrates: an input's trim drifts.
    """

    kernel: NDArray[np.float64]
    free: NDArray[np.float64]
    before: int
    after: int
    integrates: bool

    @property
    def reach(self) -> int:
        """Samples of input that a piece needs."""
        return self.before + len(self.free) + self.after

    def padded(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a record's inputs (n_time, n_in), at rest before and after it."""
        return np.pad(inputs, ((self.before, self.after), (0, 0)), mode="edge")

    def forced(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return outputs from rest, (n_piece, length, n_out), of inputs (n_piece, reach, n_in)."""
        size = inputs.shape[1] + self.kernel.shape[0]
        spectra = np.fft.rfft(inputs, size, axis=1), np.fft.rfft(self.kernel, size, axis=0)
        moved = np.fft.irfft(np.einsum("bfj,fkj->bfk", *spectra), size, axis=1)
        first = self.before + self.after
        return moved[:, first : first + len(self.free)]


def _pieces(fit: Fit, step: float, length: int) -> _Pieces:
    numbers = matrices(fit.structure, fit.values)
    model = proper_part(fit.structure, fit.values)
    a, c = np.asarray(model.A), np.asarray(model.C)
    lags = numbers.lags
    before = max(0, int(np.ceil(np.max(lags) / step))) + 2
    after = max(0, int(np.ceil(-np.min(lags) / step))) + 2
    n_out, n_in = lags.shape
    kernel = np.zeros((length + before + 2 * after, n_out, n_in))
    for j in range(n_in):
        one = np.zeros((kernel.shape[0], n_in))
        one[after, j] = 1.0
        kernel[:, :, j] = delayed(model, one, step, lags, numbers.D1)
    delay = np.max(numbers.output_delays) - numbers.output_delays
    row = np.stack([c[k] @ expm(a * delay[k]) for k in range(n_out)])
    transition = np.asarray(expm(a * step))
    free = np.empty((length, n_out, a.shape[0]))
    for k in range(length):
        free[k] = row
        row = row @ transition
    if not (np.all(np.isfinite(kernel)) and np.all(np.isfinite(free))):
        raise IdentificationError(
            f"the model {fit.structure.name!r} diverges within {length * step:.4g} s; give "
            "shorter segments",
            remedy="segment=S",
        )
    integrates = bool(a.size) and float(np.linalg.cond(a)) > _INTEGRATES
    return _Pieces(kernel, free, before, after, integrates)


def _in_segments(fit: Fit, flight: FlightRecord, length_s: float) -> Trace:
    """Predict a record in segments of about equal length, each from a state of its own."""
    structure, step, count = fit.structure, flight.sample_time, len(flight)
    number = max(1, int(np.ceil(flight.duration / length_s)))
    edges = np.floor(np.arange(number + 1) * count / number).astype(np.int64)
    starts, length = edges[:-1], int(np.max(np.diff(edges)))
    pieces = _pieces(fit, step, length)
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    size = _positive(np.std(measured, axis=0))
    own = _orthonormal(pieces.free / size[:, None])
    _refuse_short(fit, length, own.shape[1], step)
    moved = _without(measured[starts[:, None] + np.arange(length)] / size, own)
    around = pieces.padded(inputs - inputs[0])[starts[:, None] + np.arange(pieces.reach)]
    driven = _without(pieces.forced(around) / size, own)
    constant = _constant(pieces) / size
    shared = _without(constant, own)
    share = _shares(moved - driven, shared, constant)
    residual = moved - driven - np.tensordot(share, shared, 1)
    telling = moved - np.tensordot(_shares(moved, shared, constant), shared, 1)
    counted = np.arange(length) < np.diff(edges)[:, None]  # pieces may share a sample at their ends
    return Trace(
        flight.time,
        inputs,
        measured,
        measured - residual[counted] * size,
        share[: size.size],
        starts=flight.time[starts],
        telling=telling[counted] * size,
        estimated=number * own.shape[1] + len(share),
    )


def _ahead_of_time(fit: Fit, flight: FlightRecord, past_s: float, ahead_s: float) -> Trace:
    """Predict each sample that has so much past so long ahead, from a state that the past gave.

    The state is that of least squares over the past; it and the prediction are linear in what was
    recorded, so both are one filter of inputs and outputs. Biases and trims are the record's.
    """
    structure, step, count = fit.structure, flight.sample_time, len(flight)
    past, ahead = round(past_s / step) + 1, max(1, round(ahead_s / step))
    if past + ahead > count:
        raise InputError(
            f"the record's {flight.duration:.4g} s don't hold {past_s:.4g} s of past and a "
            f"prediction {ahead_s:.4g} s ahead; give less of either, or a longer record",
            remedy="segment,ahead",
        )
    pieces = _pieces(fit, step, past + ahead)
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    size = _positive(np.std(measured, axis=0))
    seen = (pieces.free[:past] / size[:, None]).reshape(past * size.size, -1)
    _refuse_short(fit, past, seen.shape[1], step)
    norm = _positive(np.linalg.norm(seen, axis=0))
    inverse = np.linalg.pinv(seen / norm, rcond=_FREE_DECADES) / norm[:, None]
    by_output = (pieces.free[-1] @ inverse).reshape(size.size, past, size.size) / size
    by_input = _input_filter(pieces, by_output)
    at = np.arange(past + ahead - 1, count)
    before = at - (past + ahead - 1)
    predicted = _filtered(by_output, measured, before) + _filtered(
        by_input, pieces.padded(inputs - inputs[0]), before
    )
    gap = np.mean(measured[at] - predicted, axis=0) / size
    drifts = [np.sum(by_input, axis=1).T] if pieces.integrates else []
    constant = np.vstack([np.eye(size.size) - np.sum(by_output, axis=1).T, *drifts]) / size
    share = np.linalg.lstsq(constant.T, gap, rcond=_ABSORBED)[0]
    predicted = predicted + share @ constant * size
    return Trace(flight.time[at], inputs[at], measured[at], predicted, share[: size.size])


def _input_filter(pieces: _Pieces, by_output: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what each input around a piece adds to its last sample, (n_out, n_reach, n_in).

    The sample's forced motion, less what the past's forced motion would be taken for.
    """
    length, past = len(pieces.free), by_output.shape[1]
    n_out, n_in = pieces.kernel.shape[1:]
    found = np.empty((n_out, pieces.reach, n_in))
    first = pieces.before + pieces.after
    kernel = np.concatenate([np.zeros((pieces.reach, n_out, n_in)), pieces.kernel])
    for k in range(pieces.reach):
        moved = kernel[pieces.reach + first - k :][:length]
        found[:, k] = moved[-1] - np.tensordot(by_output, moved[:past], 2)
    return found


def _filtered(
    weights: NDArray[np.float64], signals: NDArray[np.float64], starts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return sums (n_start, n_out) over signals (n_time, n) by weights (n_out, n_weight, n)."""
    size = len(signals) + weights.shape[1]
    spectrum = np.fft.rfft(signals, size, axis=0)
    turned = np.fft.rfft(weights[:, ::-1], size, axis=1)
    sums = np.fft.irfft(np.einsum("kfj,fj->fk", turned, spectrum), size, axis=0)
    return sums[starts + weights.shape[1] - 1]


def _constant(pieces: _Pieces) -> NDArray[np.float64]:
    """Return what biases and, where the model integrates, input trims add, (n, length, n_out)."""
    n_out, n_in = pieces.kernel.shape[1:]
    found = [np.broadcast_to(np.eye(n_out)[:, None], (n_out, len(pieces.free), n_out))]
    if pieces.integrates:
        steps = np.broadcast_to(np.eye(n_in)[:, None], (n_in, pieces.reach, n_in))
        found.append(pieces.forced(steps))
    return np.concatenate(found)


def _positive(size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sizes to divide by: 1 for what has none."""
    return np.where(size > 0.0, size, 1.0)


def _orthonormal(motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of motions (length, n_out, n), (length * n_out, n_free)."""
    columns = motions.reshape(-1, motions.shape[-1])
    norm = _positive(np.linalg.norm(columns, axis=0))
    left, strength, _ = np.linalg.svd(columns / norm, full_matrices=False)
    return left[:, strength > _FREE_DECADES * max(strength, default=0.0)]


def _without(motions: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return motions (n, length, n_out) without what lies in the columns of `own`."""
    flat = motions.reshape(len(motions), -1)
    return (flat - (flat @ own) @ own.T).reshape(motions.shape)


def _shares(
    motions: NDArray[np.float64], shared: NDArray[np.float64], whole: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how much of each shared motion all have, (n,); none where little of `whole` is."""
    norm = _positive(np.linalg.norm(whole.reshape(len(whole), -1), axis=1))
    columns = shared.reshape(len(shared), -1) / norm[:, None]
    mean = np.mean(motions, axis=0).ravel()
    left, strength, right = np.linalg.svd(columns, full_matrices=False)
    seen = strength > _ABSORBED
    return (left[:, seen] / strength[seen]) @ (right[seen] @ mean) / norm


def _refuse_short(fit: Fit, samples: int, numbers: int, step: float) -> None:
    if samples * len(fit.structure.outputs) < _PER_NUMBER * numbers:
        needed = -(-_PER_NUMBER * numbers // len(fit.structure.outputs))
        raise InputError(
            f"{samples} samples ({samples * step:.3g} s) are too few to estimate {numbers} of "
            f"the state's numbers from and to tell of the model {fit.structure.name!r}; "
            f"expected {needed} samples ({needed * step:.3g} s) or more: give longer segments, "
            "or a record of a higher rate",
            remedy="segment=S",
        )
