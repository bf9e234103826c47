"""Estimates the frequency response of a vehicle from its flight records."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.responses.conditioning import gate
from helisim.ident.responses.estimate import Estimator
from helisim.ident.responses.local import Local
from helisim.ident.responses.record_checks import quality_flags, refuse_truncated
from helisim.ident.responses.response import FrequencyResponse
from helisim.ident.responses.seen import flight_span, record_digest
from helisim.ident.responses.windows import Windows, chosen_windows
from helisim.records.provenance import one_blas_thread
from helisim.records.record import FlightRecord

POINTS_PER_DECADE = 80
"""Density of the frequency grid; 20 points of it a response go into a fit."""

ESTIMATORS = ("local", "windows")
"""Names of the estimators."""

_COMPARED = 8
"""Every so many frequencies the direct estimate is compared with the joint one."""

_LEAST_COHERENCE = 0.2
"""Below it the joint estimate is too wild for a comparison."""

_FEWEST_APART = 2
"""Feedback's bias is smooth: one frequency of those compared is chance."""

_LEAST_GAP = 0.005
"""A smaller gap, as a fraction of the response, is of no weight: no fit trusts a point more."""

_CHANCE = 12.0
"""A squared gap over its variance that chance exceeds once in 160 000 comparisons."""


class ClosedLoopWarning(UserWarning):
    """The direct and the joint estimate disagree, so the direct one is biased by feedback."""


@one_blas_thread()
def frequency_response(
    records: FlightRecord | Sequence[FlightRecord],
    *,
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    band: tuple[float, float],
    conditioning: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    estimator: str | None = None,
    windows: float | Sequence[float] | None = None,
    overlap: float = 0.75,
    use_ended: bool = False,
) -> FrequencyResponse:
    """Estimate frequency responses from one record or several pooled ones.

    Args:
        records: flights; their spectra are averaged, so sweeps of different axes separate
            the axes' effects.
        inputs: the inputs wanted.
        outputs: the outputs wanted.
        band: lowest and highest frequency, rad/s.
        conditioning: further inputs that were active; their effect is removed.
        reference: signals outside the loop (sticks, the sweep), at least as many as active
            inputs. Given, the joint input-output method is used, which feedback and gusts do
            not bias.
        estimator: "local", the local polynomial and rational method, which windows don't smear
            and transients don't bias; or "windows", CIFER's composite of Hann windows. The
            default is local, unless window lengths are given.
        windows: one window length or several, s; five by the published rules if none is given.
        overlap: share of a window that the next one covers at least.
        use_ended: True takes records of flights that were terminated early
            (`FlightRecord.ended`) too.

    Raises:
        InputError: an argument is out of range or a channel does not exist.
        IdentificationError: the records are too short, an input is constant, inputs moved
            as one, or a flight was terminated early.
    """
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    wanted, measured = as_names(inputs), as_names(outputs)
    others, reference_names = as_names(conditioning), as_names(reference)
    _check_names(flights, wanted, measured, others, reference_names)
    if not use_ended:
        refuse_truncated(flights)
    _check_band(flights, band)
    if not 0.0 <= overlap <= 0.95:
        raise InputError(f"overlap is {overlap}, expected 0 to 0.95; 0.75 to 0.8 is enough")
    signals = tuple(dict.fromkeys((*wanted, *others, *reference_names, *measured)))
    _check_motion(flights, (*wanted, *others, *reference_names), "input")
    _check_motion(flights, measured, "output")
    name = _estimator_name(estimator, windows)
    lengths = chosen_windows(flights, band, windows)
    frequency = _grid(band)
    method: Estimator
    if name == "local":
        method = Local(flights, signals, frequency)
    else:
        method = Windows(flights, signals, frequency, windows=lengths, overlap=overlap)
    cross = method.cross_control((*wanted, *others))
    flags = quality_flags(flights, signals) + gate(cross, (*wanted, *others), frequency)
    if reference_names:
        flags += gate(method.cross_control(reference_names), reference_names, frequency)

    sources = tuple(record_digest(flight) for flight in flights)
    spans = tuple(span for flight in flights if (span := flight_span(flight)) is not None)

    def estimated(names: tuple[str, ...]) -> FrequencyResponse:
        found = method.estimate(wanted, measured, others, names)
        return FrequencyResponse(
            frequency=frequency,
            response=found.response,
            coherence=found.coherence,
            multiple_coherence=found.multiple,
            cross_control_coherence=cross[: len(wanted), : len(wanted)],
            random_error=found.random_error,
            inputs=wanted,
            outputs=measured,
            input_units=tuple(flights[0].unit(name) for name in wanted),
            output_units=tuple(flights[0].unit(name) for name in measured),
            conditioning=others,
            reference=names,
            estimator=name,
            windows=method.windows,
            flags=flags,
            sources=sources,
            spans=spans,
            scatter=found.scatter,
        )

    if not reference_names:
        return estimated(())
    joint, direct = estimated(reference_names), estimated(())
    return replace(joint, direct=direct, flags=flags + disagreements(joint, direct))


def disagreements(joint: FrequencyResponse, direct: FrequencyResponse) -> tuple[str, ...]:
    """Compare the joint and the direct estimate; return the warnings that were raised.

    They differ where the gap is larger than both errors together, and larger than chance
    explains, half a percent at least: both see the same disturbance, so the gap's own error is
    the smaller one.
    """
    flags = []
    if joint.scatter is None or direct.scatter is None:
        return ()
    index = np.arange(0, joint.frequency.size, _COMPARED)
    shape = (len(joint.outputs), len(joint.inputs), index.size)
    place = np.indices(shape).reshape(3, -1)
    at = (place[0], place[1], index[place[2]])
    each = (joint.scatter, direct.scatter, joint.scatter.minus(direct.scatter))
    own, other, between = (one.variance(*at) for one in each)
    gap = np.abs(joint.response[at] - direct.response[at]) ** 2
    least = np.square(_LEAST_GAP * np.abs(joint.response[at]))
    chance = np.maximum(own + other, _CHANCE * between)
    found = (gap > np.maximum(least, chance)) & joint.usable(_LEAST_COHERENCE)[at]
    relative = np.where(found, np.sqrt(gap) / np.abs(joint.response[at]), 0.0).reshape(shape)
    for o, output in enumerate(joint.outputs):
        for i, input_ in enumerate(joint.inputs):
            worst = int(np.argmax(relative[o, i]))
            if np.count_nonzero(relative[o, i]) < min(_FEWEST_APART, index.size):
                continue
            flags.append(
                f"direct and joint estimates of {output}/{input_} disagree beyond their errors at "
                f"{np.count_nonzero(relative[o, i])} of {index.size} frequencies, by "
                f"{100.0 * relative[o, i, worst]:.0f} % at {joint.frequency[index[worst]]:.3g} "
                "rad/s: feedback carries disturbances into the input, which biases the direct "
                "estimate; use the joint one, and check that the reference is outside the loop"
            )
    for flag in flags:
        warnings.warn(
            flag, ClosedLoopWarning, stacklevel=4
        )  # past `one_blas_thread`, to the caller
    return tuple(flags)


def as_names(names: str | Sequence[str] | None) -> tuple[str, ...]:
    """Return names as a tuple; one name may be given bare."""
    if names is None:
        return ()
    return (names,) if isinstance(names, str) else tuple(names)


def _estimator_name(estimator: str | None, windows: float | Sequence[float] | None) -> str:
    name = estimator or ("local" if windows is None else "windows")
    if name not in ESTIMATORS:
        raise InputError(f"estimator is {name!r}, expected one of: {', '.join(ESTIMATORS)}")
    if name != "windows" and windows is not None:
        raise InputError(
            f"window lengths were given to the {name!r} estimator, which has no windows; "
            "leave them out, or ask for estimator='windows' (--estimator windows)"
        )
    return name


def _grid(band: tuple[float, float]) -> NDArray[np.float64]:
    count = max(32, math.ceil(POINTS_PER_DECADE * math.log10(band[1] / band[0])) + 1)
    return np.geomspace(band[0], band[1], count)


def _check_names(
    flights: tuple[FlightRecord, ...],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    others: tuple[str, ...],
    reference: tuple[str, ...],
) -> None:
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    for position, flight in enumerate(flights):
        if not isinstance(flight, FlightRecord):
            raise InputError(
                f"record {position} is a {type(flight).__name__}, expected a FlightRecord"
            )
    if not inputs or not outputs:
        raise InputError("expected at least one input and one output")
    names = (*inputs, *others, *outputs)
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise InputError(
            f"each channel has one role, but these have several: {', '.join(repeated)}"
        )
    if reference and len(reference) < len(inputs) + len(others):
        raise InputError(
            f"{len(reference)} reference(s) for {len(inputs) + len(others)} active inputs; the "
            "joint method needs at least as many references (--reference A,B) as inputs and "
            "conditioning inputs"
        )
    for flight in flights:
        for name in (*names, *reference):
            flight.unit(name)


def _check_band(flights: Sequence[FlightRecord], band: tuple[float, float]) -> None:
    try:
        low, high = (float(edge) for edge in band)
    except (TypeError, ValueError):
        raise InputError(f"band is {band!r}, expected two frequencies in rad/s") from None
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 < low < high):
        raise InputError(f"band is {low} to {high} rad/s, expected 0 < lower < upper, finite")
    nyquist = min(math.pi / flight.sample_time for flight in flights)
    if high >= nyquist:
        raise InputError(
            f"the band ends at {high:.4g} rad/s, but samples resolve only {nyquist:.4g} rad/s; "
            "lower the band's upper edge (--band LO HI) or record faster"
        )


def _check_motion(flights: Sequence[FlightRecord], names: Sequence[str], role: str) -> None:
    for name in names:
        if not any(_moves(flight[name]) for flight in flights):
            raise IdentificationError(
                f"{role} {name!r} is constant in every record; nothing can be identified from "
                f"it: sweep it, or leave it out of the {role}s"
            )


def _moves(values: NDArray[np.float64]) -> bool:
    """Whether a channel varies by more than the rounding of its largest value."""
    return float(np.ptp(values)) > 1e-12 * float(np.max(np.abs(values)))
