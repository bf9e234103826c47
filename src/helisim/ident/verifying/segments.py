"""Predicts a record piece by piece, each from a state of its own, as unstable models need it.

From one initial state an unstable model's error grows without bound, however good the model is.
In segments each has its own state, estimated from the segment, while biases and trims are the
record's. Predicting ahead, a state is estimated from the samples before it alone.

What a segment's state could make up tells nothing of the model, so it is taken out of both
measured and predicted motion before they are compared: with P the projection on the model's free
motions, Theil's coefficient is that of (1 - P) y and (1 - P) y_forced, whose difference is the
residual of least squares. However short a segment is, its free numbers flatter no model.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.fitting.result import Fit
from helisim.ident.model.evaluate import matrices, proper_part
from helisim.ident.model.simulation import delayed
from helisim.ident.verifying.verification import Trace
from helisim.records.record import FlightRecord

INTEGRATES = 1e8
"""Condition number of A from which the model integrates, so that an input's trim is a drift;
otherwise bias and initial state can stand for it."""

FREE_DECADES = 1e-9
"""Bias, trim and initial-state directions weaker than this share are left at zero."""

_ABSORBED = 1e-6
"""A constant of which initial states leave no more than this share is theirs."""

_PER_NUMBER = 4
"""So many samples at least for each number of a state: fewer hardly tell of the model."""


@dataclass(frozen=True, eq=False)
class _Pieces:
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
    def length(self) -> int:
        """Samples of a piece."""
        return self.free.shape[0]

    def padded(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a record's inputs (n_time, n_in), at rest before and after it."""
        return np.pad(inputs, ((self.before, self.after), (0, 0)), mode="edge")

    def inputs(self, inputs: NDArray[np.float64], starts: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the inputs around pieces, (n_piece, before + length + after, n_in)."""
        reach = np.arange(self.before + self.length + self.after)
        return self.padded(inputs)[starts[:, None] + reach]

    def forced(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs from rest, (n_piece, length, n_out), of such inputs."""
        size = inputs.shape[1] + self.kernel.shape[0]
        spectra = np.fft.rfft(inputs, size, axis=1), np.fft.rfft(self.kernel, size, axis=0)
        answer = np.fft.irfft(np.einsum("bfj,fkj->bfk", *spectra), size, axis=1)
        first = self.before + self.after
        return answer[:, first : first + self.length]


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
    late = np.max(numbers.output_delays) - numbers.output_delays
    row = np.stack([c[k] @ expm(a * late[k]) for k in range(n_out)])
    transition = np.asarray(expm(a * step))
    free = np.empty((length, n_out, a.shape[0]))
    for k in range(length):
        free[k] = row
        row = row @ transition
    if not (np.all(np.isfinite(kernel)) and np.all(np.isfinite(free))):
        raise IdentificationError(
            f"the model {fit.structure.name!r} diverges within {length * step:.4g} s; give "
            "shorter segments (--segment S)"
        )
    integrates = bool(a.size) and float(np.linalg.cond(a)) > INTEGRATES
    return _Pieces(kernel, free, before, after, integrates)


def in_segments(fit: Fit, flight: FlightRecord, length_s: float) -> Trace:
    """Predict a record in segments of about equal length, each from a state of its own.

    Args:
        fit: the model.
        flight: the record.
        length_s: of a segment at most, s.

    Raises:
        InputError: a segment has too few samples to estimate a state and tell of the model.
        IdentificationError: the model diverges within a segment.
    """
    structure, step, count = fit.structure, flight.sample_time, len(flight)
    number = max(1, int(np.ceil(flight.duration / length_s)))
    edges = np.floor(np.arange(number + 1) * count / number).astype(np.int64)
    starts, length = edges[:-1], int(np.max(np.diff(edges)))
    pieces = _pieces(fit, step, length)
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    size = _size(measured)
    own = _orthonormal(pieces.free / size[:, None])
    _refuse_short(fit, length, own.shape[1], step)
    moved = _without(measured[starts[:, None] + np.arange(length)] / size, own)
    driven = _without(pieces.forced(pieces.inputs(inputs - inputs[0], starts)) / size, own)
    constant = _constant(pieces) / size
    shared = _without(constant, own)
    share = _shares(moved - driven, shared, constant)
    residual = moved - driven - np.tensordot(share, shared, 1)
    telling = moved - np.tensordot(_shares(moved, shared, constant), shared, 1)
    kept = np.arange(length) < np.diff(edges)[:, None]  # pieces may share a sample at their ends
    return Trace(
        flight.time,
        inputs,
        measured,
        measured - residual[kept] * size,
        share[: size.size],
        starts=flight.time[starts],
        telling=telling[kept] * size,
        estimated=number * own.shape[1] + len(share),
    )


def ahead_of_time(fit: Fit, flight: FlightRecord, past_s: float, ahead_s: float) -> Trace:
    """Predict each sample of a record so long ahead, from a state that the past before gave.

    The state is that of least squares over the past; it and the prediction are linear in what was
    recorded, so both are one filter of inputs and outputs. Biases and trims are the record's.

    Args:
        fit: the model.
        flight: the record.
        past_s: how much of the past a state is estimated from, s.
        ahead_s: how far ahead each sample is predicted, s.

    Returns:
        Of the samples that have that much past.

    Raises:
        InputError: the past has too few samples, or the record is shorter than past and prediction.
        IdentificationError: the model diverges within them.
    """
    structure, step, count = fit.structure, flight.sample_time, len(flight)
    past, ahead = round(past_s / step) + 1, max(1, round(ahead_s / step))
    if past + ahead > count:
        raise InputError(
            f"the record's {flight.duration:.4g} s don't hold {past_s:.4g} s of past and a "
            f"prediction {ahead_s:.4g} s ahead; give less of either (--segment, --ahead), or a "
            "longer record"
        )
    pieces = _pieces(fit, step, past + ahead)
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    size = _size(measured)
    seen = (pieces.free[:past] / size[:, None]).reshape(past * size.size, -1)
    _refuse_short(fit, past, seen.shape[1], step)
    by_output = pieces.free[-1] @ _inverse(seen)  # (n_out, past * n_out)
    by_output = by_output.reshape(size.size, past, size.size) / size
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
    length, past = pieces.length, by_output.shape[1]
    reach = pieces.before + length + pieces.after
    n_out, n_in = pieces.kernel.shape[1:]
    found = np.empty((n_out, reach, n_in))
    first = pieces.before + pieces.after
    kernel = np.concatenate([np.zeros((reach, n_out, n_in)), pieces.kernel])
    for k in range(reach):
        moved = kernel[reach + first - k :][:length]
        found[:, k] = moved[-1] - np.tensordot(by_output, moved[:past], 2)
    return found


def _filtered(
    weights: NDArray[np.float64], signals: NDArray[np.float64], starts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return weighted sums (n_start, n_out) over signals from each start on.

    Args:
        weights: (n_out, n_weight, n).
        signals: (n_time, n).
        starts: (n_start,) samples.
    """
    size = len(signals) + weights.shape[1]
    spectrum = np.fft.rfft(signals, size, axis=0)
    turned = np.fft.rfft(weights[:, ::-1], size, axis=1)
    sums = np.fft.irfft(np.einsum("kfj,fj->fk", turned, spectrum), size, axis=0)
    return sums[starts + weights.shape[1] - 1]


def _constant(pieces: _Pieces) -> NDArray[np.float64]:
    """Return what biases and, where the model integrates, input trims add, (n, length, n_out)."""
    n_out, n_in = pieces.kernel.shape[1:]
    found = [np.broadcast_to(np.eye(n_out)[:, None], (n_out, pieces.length, n_out))]
    if pieces.integrates:
        reach = pieces.before + pieces.length + pieces.after
        steps = np.broadcast_to(np.eye(n_in)[:, None], (n_in, reach, n_in))
        found.append(pieces.forced(steps))
    return np.concatenate(found)


def _size(measured: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit in which outputs weigh alike, (n_out,): how far each moves."""
    size = np.std(measured, axis=0)
    return np.where(size > 0.0, size, 1.0)


def _orthonormal(motions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an orthonormal basis of motions (length, n_out, n), (length * n_out, n_free)."""
    columns = motions.reshape(-1, motions.shape[-1])
    norm = np.linalg.norm(columns, axis=0)
    left, strength, _ = np.linalg.svd(
        columns / np.where(norm > 0.0, norm, 1.0), full_matrices=False
    )
    return left[:, strength > FREE_DECADES * max(strength, default=0.0)]


def _inverse(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pseudo-inverse of columns (m, n), scaled to one size, (n, m)."""
    norm = np.linalg.norm(columns, axis=0)
    norm = np.where(norm > 0.0, norm, 1.0)
    return np.linalg.pinv(columns / norm, rcond=FREE_DECADES) / norm[:, None]


def _without(motions: NDArray[np.float64], own: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return motions (n, length, n_out) without what lies in the columns of `own`."""
    flat = motions.reshape(len(motions), -1)
    return (flat - (flat @ own) @ own.T).reshape(motions.shape)


def _shares(
    motions: NDArray[np.float64], shared: NDArray[np.float64], whole: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how much of each shared motion (n, length, n_out) all motions have, (n,).

    A shared motion of which hardly anything is left of its `whole` has none.
    """
    norm = np.linalg.norm(whole.reshape(len(whole), -1), axis=1)
    norm = np.where(norm > 0.0, norm, 1.0)
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
            f"expected {needed} samples ({needed * step:.3g} s) or more: give longer segments "
            "(--segment S), or a record of a higher rate"
        )
