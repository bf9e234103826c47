"""Verifies an identified model in the time domain, on a record that no fit has seen.

Only biases, trims and initial states are estimated. With P the projection on the model's free
motions, Theil's coefficient is of (1 - P) y and (1 - P) y_forced.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import expm

from helisim.base.arrays import Real
from helisim.base.errors import IdentificationError, InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import Limits, convert
from helisim.ident.evaluate import delayed, linear, simulate
from helisim.ident.frf import flights_of, refuse_truncated, share_seen
from helisim.ident.result import Fit
from helisim.ident.verification import (
    Approach,
    Trace,
    Verification,
    overall_theil,
    root_mean_square,
    theil,
)
from helisim.records.record import IN1, IN2, FlightRecord, one_blas_thread

_SHARED = 0.25  # largest share of a record's time that the fit may have seen
# Of an error, over a segment of an unstable model or a record that is predicted whole: eight times
# the error of a good model is good still, and gusts upset longer segments
_DOUBLINGS = 3.0
_HARDLY = 0.01  # doublings over a record below which a pole counts as an integrator's
_TELLS = 3.0  # Motion over noise for an output to count: noise alone is then a coefficient of 0.16
# A record is no test where no output moves ten times its noise, as one does in any doublet that the
# model's inputs are flown for, and another control twice as much as all of them
_STIRRED, _OTHERS = 10.0, 2.0
_INTEGRATES = 1e8  # Condition number of A above which the model integrates
_FREE_DECADES = 1e-9  # Relative size of bias, trim and initial-state directions left at zero
_ABSORBED = 1e-6  # greatest remainder of a constant that initial states replace
_PER_NUMBER = 4  # least samples for each number of a state


@one_blas_thread()
def verify(
    fit: Fit,
    records: FlightRecord | Sequence[FlightRecord],
    *,
    segment: float | None = None,
    use_ended: bool = False,
) -> Verification:
    """Simulate a fitted model on records, estimating only bias, trim and initial state.

    An unstable model, whose errors would double more than 3 times over a record, is simulated in
    segments, each from a state of its own.

    Args:
        fit: the model, with its delays.
        records: flights that the fit has not seen, such as doublets.
        segment: length of segments, s, also for stable models.
        use_ended: accept flights that were terminated early.

    Raises InputError if a record was used in the fit, or lacks a channel, or a segment is too
    short; IdentificationError if the model diverges, or a flight was terminated early.
    """
    flights = flights_of(records)
    convert(float | None, segment, "segment", Limits(unit="s", above=0.0))
    if not use_ended:
        refuse_truncated(flights)
    for position, flight in enumerate(flights):
        refuse_seen(fit, flight, f"record {position}")
    traces, approach = _predicted(fit, flights, segment)
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
    stirred = bool(np.any(size >= _STIRRED * noise))
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
        elsewhere=() if stirred else _elsewhere(fit.structure.inputs, flights),
    )


def _elsewhere(inputs: Sequence[str], flights: Sequence[FlightRecord]) -> tuple[str, ...]:
    """Return the controls that moved far more than the inputs, of those that all records have."""
    kin = next((names for names in (IN1, IN2) if {*inputs} <= {*names}), ())
    moved = {
        name: max(float(np.std(one[name])) for one in flights)
        for name in kin
        if all(name in one.names for one in flights)
    }
    most = max((moved.pop(name) for name in inputs if name in moved), default=0.0)
    return tuple(name for name, size in moved.items() if size > _OTHERS * most)


def refuse_seen(fit: Fit, record: FlightRecord, name: str) -> None:
    """Raise InputError if the fit has seen more than a part of the record."""
    share = share_seen(record, fit.data.spans)
    if share > _SHARED or record.digest in fit.data.sources:
        part = "" if share == 0.0 else f" (about {100.0 * share:.0f} % of its time)"
        raise InputError(
            f"{name}: was used in the fit{part}, so it can't verify it; "
            "give a record that no fit has seen"
        )


def _predicted(
    fit: Fit, flights: Sequence[FlightRecord], segment: float | None
) -> tuple[tuple[Trace, ...], Approach]:
    longest = max(flight.duration for flight in flights)
    poles = np.linalg.eigvals(linear(fit.structure, fit.values).a)
    fastest = max(poles, key=lambda pole: pole.real, default=0.0)
    doubling = np.log(2.0) / fastest.real if fastest.real > 0.0 else np.inf
    unstable = longest > _HARDLY * doubling
    limit = _DOUBLINGS * doubling
    whole = segment is None and longest <= limit
    if whole:
        traces, length = tuple(_whole(fit, flight) for flight in flights), longest
        estimated = len(traces) * (len(fit.structure.outputs) + len(fit.structure.states))
    else:
        traces = tuple(_in_segments(fit, flight, segment or limit) for flight in flights)
        cut = (np.append(trace.starts, trace.time[-1]) for trace in traces)
        length = float(max(np.max(np.diff(one)) for one in cut))
        estimated = sum(trace.estimated for trace in traces)
    return traces, Approach(
        kind="whole" if whole else "segments",
        length_s=length,
        pole=(float(fastest.real), float(fastest.imag)) if unstable else None,
        estimated=estimated,
        samples=sum(trace.measured.size for trace in traces),
    )


def _noise(measured: Real) -> Real:
    """Return the rms of white noise with the spectrum of the fastest fifth, (n_out,)."""
    window = np.hanning(len(measured))[:, None]
    spectrum = np.fft.rfft(window * (measured - np.mean(measured, axis=0)), axis=0)
    fastest = np.abs(spectrum[-max(1, len(spectrum) // 5) :]) ** 2
    return np.sqrt(np.mean(fastest, axis=0) / np.sum(window**2))


def _whole(fit: Fit, flight: FlightRecord) -> Trace:
    step, time, structure = flight.sample_time, flight.time, fit.structure
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    model = linear(structure, fit.values)
    forced = delayed(model, inputs - inputs[0], step, model.lags)
    # contributions of bias, initial state and input trim, (n_motion, n_time, n_out)
    n_out, n, n_in = len(structure.outputs), len(model.a), len(structure.inputs)
    motions = [np.tile(np.eye(n_out)[k], (time.size, 1)) for k in range(n_out)]
    at_rest = np.zeros((time.size, n_in))
    motions += [simulate(model, at_rest, step, start=np.eye(n)[k]) for k in range(n)]
    if _integrates(model):
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
    telling = measured - np.mean(measured, axis=0)
    return Trace(time, inputs, measured, predicted, weight[:n_out], telling)


def _in_segments(fit: Fit, flight: FlightRecord, length_s: float) -> Trace:
    structure, step, count = fit.structure, flight.sample_time, len(flight)
    number = max(1, int(np.ceil(min(flight.duration / length_s, count))))
    edges = np.floor(np.arange(number + 1) * count / number).astype(np.int64)
    starts, length = edges[:-1], int(np.max(np.diff(edges)))
    inputs, measured = flight.select(structure.inputs), flight.select(structure.outputs)
    size = _positive(np.std(measured, axis=0))
    model = linear(structure, fit.values)
    free, forced, reach = _motions(fit, model, step, length)
    own = _orthonormal(free / size[:, None])
    numbers, outputs = own.shape[1], len(structure.outputs)
    if length * outputs < _PER_NUMBER * numbers:
        needed = -(-_PER_NUMBER * numbers // outputs)
        raise InputError(
            f"{length} samples ({length * step:.3g} s) are too few to estimate {numbers} of "
            f"the state's numbers from and to tell of the model {structure.name!r}; "
            f"expected {needed} samples ({needed * step:.3g} s) or more: give longer segments, "
            "or a record of a higher rate",
            remedy="segment=S",
        )
    moved = _without(measured[starts[:, None] + np.arange(length)] / size, own)
    before, after = reach
    padded = np.pad(inputs - inputs[0], ((before, after), (0, 0)), mode="edge")
    around = np.arange(before + length + after)
    driven = _without(forced(padded[starts[:, None] + around]) / size, own)
    n_out, n_in = len(structure.outputs), len(structure.inputs)
    constant = np.broadcast_to(np.eye(n_out)[:, None], (n_out, length, n_out))
    if _integrates(model):
        drifts = forced(np.broadcast_to(np.eye(n_in)[:, None], (n_in, around.size, n_in)))
        constant = np.concatenate([constant, drifts])
    constant = constant / size
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
        telling[counted] * size,
        flight.time[starts],
        estimated=number * own.shape[1] + len(share),
    )


def _motions(
    fit: Fit, model: LinearSystem, step: float, length: int
) -> tuple[Real, Callable[[Real], Real], tuple[int, int]]:
    """Return motions from initial states, (length, n_out, n_state), and a function from inputs."""
    a, c, lags = model.a, model.c, model.lags
    before = max(0, int(np.ceil(np.max(lags) / step))) + 2
    after = max(0, int(np.ceil(-np.min(lags) / step))) + 2
    n_out, n_in = lags.shape
    # response to an input of one sample, from `after` samples before it
    kernel = np.zeros((length + before + 2 * after, n_out, n_in))
    for j in range(n_in):
        one = np.zeros((kernel.shape[0], n_in))
        one[after, j] = 1.0
        kernel[:, :, j] = delayed(model, one, step, lags)
    late = np.array([model.output_delays[name] for name in model.outputs])
    delay = np.max(late) - late
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

    def forced(inputs: Real) -> Real:
        size = inputs.shape[1] + kernel.shape[0]
        spectra = np.fft.rfft(inputs, size, axis=1), np.fft.rfft(kernel, size, axis=0)
        moved = np.fft.irfft(np.einsum("bfj,fkj->bfk", *spectra), size, axis=1)
        return moved[:, before + after : before + after + length]

    return free, forced, (before, after)


def _integrates(model: LinearSystem) -> bool:
    return bool(model.a.size) and float(np.linalg.cond(model.a)) > _INTEGRATES


def _positive(size: Real) -> Real:
    return np.where(size > 0.0, size, 1.0)


def _orthonormal(motions: Real) -> Real:
    """Return an orthonormal basis, (length * n_out, n_free), of motions (length, n_out, n)."""
    columns = motions.reshape(-1, motions.shape[-1])
    norm = _positive(np.linalg.norm(columns, axis=0))
    left, strength, _ = np.linalg.svd(columns / norm, full_matrices=False)
    return left[:, strength > _FREE_DECADES * max(strength, default=0.0)]


def _without(motions: Real, own: Real) -> Real:
    """Return motions (n, length, n_out) without the part in the columns of `own`."""
    flat = motions.reshape(len(motions), -1)
    return (flat - (flat @ own) @ own.T).reshape(motions.shape)


def _shares(motions: Real, shared: Real, whole: Real) -> Real:
    """Return the shares of each motion, (n,), common to all; none where little of `whole` is."""
    norm = _positive(np.linalg.norm(whole.reshape(len(whole), -1), axis=1))
    columns = shared.reshape(len(shared), -1) / norm[:, None]
    mean = np.mean(motions, axis=0).ravel()
    left, strength, right = np.linalg.svd(columns, full_matrices=False)
    seen = strength > _ABSORBED
    return (left[:, seen] / strength[seen]) @ (right[seen] @ mean) / norm
