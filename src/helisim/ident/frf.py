"""Estimates a vehicle's frequency response from flight records, after checking them."""

import hashlib
import json
import math
import operator
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import IdentificationError, InputError, check_known
from helisim.base.note import Option
from helisim.base.settings import Limits, convert
from helisim.ident.conditions import Conditions
from helisim.ident.evidence import evidence, joint_evidence, left_of
from helisim.ident.local import Local, with_gap
from helisim.ident.predictor import Predictor
from helisim.ident.response import FrequencyResponse
from helisim.ident.windows import Windows, lowest_line, window_lengths
from helisim.records.missing import missing_of, with_more_missing
from helisim.records.quality import at_stop, frozen_runs, spikes
from helisim.records.record import STICKS, Channel, FlightRecord, one_blas_thread

POINTS_PER_DECADE = 80  # of the frequency grid; fits use 20 points of a response
ESTIMATORS = ("local", "windows", "predictor")
CROSS_CONTROL_LIMIT = 0.5
"""Mean coherence between inputs above which the estimate is doubtful (Tischler and Remple)."""
CROSS_CONTROL_SINGULAR = 0.98
"""Mean coherence of inputs above which they can't be separated: condition number > 100."""
_COMPARED = 8  # every so many frequencies the direct estimate is compared with the joint one
_LEAST_COHERENCE = 0.2  # below it the joint estimate is too wild for a comparison
_FEWEST_APART = 2  # feedback's bias is smooth: one frequency of those compared is chance
_LEAST_GAP = 0.005  # of the response: no fit trusts a point more
_CHANCE = 12.0  # a squared gap over its variance that chance exceeds once in 160 000 comparisons
_LONGEST_STOP = 1.0  # s, for which an input may be at its stop in a record
_AS_COHERENT = 0.9  # of the direct estimate's coherent points, that the joint one by sticks needs
_IN_A_LOOP = 0.25  # likewise, where gusts go round a loop: sticks that excite had 0.35 to 0.57
_SAMPLES_A_PERIOD = 10.0  # of the highest frequency that records resolve
_NOT_THE_FLIGHT = ("made_by", "versions", "ended", "log", "part", "missing", "conditions")


class FlagWarning(UserWarning):
    """A warning whose text is among a response's flags, too."""


class ClosedLoopWarning(FlagWarning):
    """The direct and the joint estimate disagree: feedback biases the direct one."""


class CrossControlWarning(FlagWarning):
    """Inputs moved together, so their responses are separated poorly."""


class RecordQualityWarning(FlagWarning):
    """A record has spikes, frozen runs, or inputs at their stops."""


@one_blas_thread()
def frequency_response(
    records: FlightRecord | Sequence[FlightRecord],
    *,
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    band: tuple[float, float],
    conditioning: str | Sequence[str] | None = None,
    reference: str | Sequence[str] | None = None,
    estimator: str = "local",
    use_ended: bool = False,
) -> FrequencyResponse:
    """Estimate frequency responses from one record or several pooled ones.

    Args:
        records: flights; sweeps of different axes separate the axes' effects.
        inputs: names.
        outputs: names.
        band: lowest and highest frequency, rad/s.
        conditioning: further active inputs, whose effect is removed.
        reference: signals outside the loop (sticks, the sweep), at least as many as active
            inputs: for the joint input-output method, unbiased by feedback and gusts.
        estimator: "local" polynomial and rational method, "windows", CIFER's composite, or
            "predictor", which feedback doesn't bias without a reference, if what the law sees is
            logged as often as it sees it.
        use_ended: accept flights that were terminated early.

    Raises InputError for arguments; IdentificationError if records are too short, an input is
    constant, inputs moved as one, or a flight was terminated early.
    """
    flights = flights_of(records)
    wanted, measured, others, references = (
        (names,) if isinstance(names, str) else tuple(names or ())
        for names in (inputs, outputs, conditioning, reference)
    )
    check_records(flights, wanted, measured, others, references, band=band, use_ended=use_ended)
    signals = tuple(dict.fromkeys((*wanted, *others, *references, *measured)))
    check_known("estimator", [estimator], ESTIMATORS)
    lengths = window_lengths([len(one) * one.sample_time for one in flights], band)
    frequency = grid(band)
    make = {"local": Local, "predictor": Predictor}.get(
        estimator, partial(Windows, windows=lengths)
    )
    method = make(flights, signals, frequency)
    fewer = [with_more_missing(one) if missing_of(one).any() else one for one in flights]
    poorer = None if all(map(operator.is_, fewer, flights)) else make(fewer, signals, frequency)
    cross = method.cross_control((*wanted, *others))
    flags = _warned(faults(flights, signals), RecordQualityWarning)
    flags += _warned(_coherent(cross, (*wanted, *others), frequency), CrossControlWarning)
    if references:
        between = method.cross_control(references)
        flags += _warned(_coherent(between, references, frequency), CrossControlWarning)

    active = (*wanted, *others)
    lost = -np.log([left_of(flights, name, frequency) for name in active])

    def estimated(names: tuple[str, ...]) -> tuple[FrequencyResponse, FrequencyResponse]:
        """Return the response to the wanted inputs, and the one to all that are active."""
        found = method.estimate(active, measured, names)
        if poorer is not None:
            found = with_gap(found, frequency, poorer.estimate(active, measured, names).response)
        whole = FrequencyResponse(
            frequency=frequency,
            response=found.response,
            coherence=found.coherence,
            multiple_coherence=found.multiple,
            cross_control_coherence=cross,
            random_error=found.random_error,
            inputs=active,
            outputs=measured,
            input_units=tuple(flights[0].unit(name) for name in active),
            output_units=tuple(flights[0].unit(name) for name in measured),
            reference=names,
            estimator=estimator,
            windows=method.windows,
            flags=flags,
            sources=tuple(one.digest for one in flights),
            spans=tuple(filter(None, map(flight_span, flights))),
            conditions=Conditions.of(flights),
            scatter=replace(
                found.scatter,
                gap=np.stack(np.broadcast_arrays(found.scatter.gap, found.response * lost)),
            ),
        )
        return whole.part(len(wanted)), whole

    direct, whole = estimated(())
    direct = replace(direct, evidence=evidence(flights, direct, whole))
    if not references:
        return direct
    joint, whole = estimated(references)
    apart = _warned(_disagreements(joint, direct), ClosedLoopWarning)
    told = joint_evidence(flights, joint, direct, whole)
    return replace(joint, direct=direct, flags=flags + apart, evidence=told)


def grid(band: tuple[float, float]) -> NDArray[np.float64]:
    """Return the frequencies of a response over a band, rad/s."""
    count = max(32, math.ceil(POINTS_PER_DECADE * math.log10(band[1] / band[0])) + 1)
    return np.geomspace(band[0], band[1], count)


def _warned(flags: Iterable[str], category: type[Warning]) -> tuple[str, ...]:
    found = tuple(flags)
    for flag in found:
        warnings.warn(flag, category, stacklevel=4)  # past `one_blas_thread`, to the caller
    return found


def _disagreements(joint: FrequencyResponse, direct: FrequencyResponse) -> Iterator[str]:
    assert joint.scatter is not None
    assert direct.scatter is not None
    index = np.arange(0, joint.frequency.size, _COMPARED)
    place = np.indices((len(joint.outputs), len(joint.inputs), index.size)).reshape(3, -1)
    at = (place[0], place[1], index[place[2]])
    models = (joint.scatter, direct.scatter, joint.scatter.minus(direct.scatter))
    own, other, between = (np.diagonal(one.covariance(*at)).real for one in models)
    size, gap = np.abs(joint.response[at]), np.abs(joint.response[at] - direct.response[at])
    least = np.maximum(np.square(_LEAST_GAP * size), np.maximum(own + other, _CHANCE * between))
    relative = np.where((gap**2 > least) & joint.usable(_LEAST_COHERENCE)[at], gap / size, 0.0)
    for pair, apart in zip(joint.pairs, relative.reshape(-1, index.size)):
        count, worst = np.count_nonzero(apart), int(np.argmax(apart))
        if count >= min(_FEWEST_APART, index.size):
            yield (
                f"direct and joint estimates of {pair} disagree beyond their errors at "
                f"{count} of {index.size} frequencies, by {100.0 * apart[worst]:.0f} % at "
                f"{joint.frequency[index[worst]]:.3g} rad/s: feedback carries disturbances into "
                "the input, which biases the direct estimate; use the joint one, and check that "
                "the reference is outside the loop"
            )


def _coherent(
    cross: NDArray[np.float64], inputs: Sequence[str], frequency: NDArray[np.float64]
) -> Iterator[str]:
    """Yield which inputs moved together. Raises IdentificationError if two moved as one."""
    advice = "add records where the other input is swept, or sweep with less off-axis input"
    for i, first in enumerate(inputs):
        for j, second in enumerate(inputs[:i]):
            mean = float(np.mean(cross[i, j]))
            worst = frequency[int(np.argmax(cross[i, j]))]
            message = (
                f"inputs {second!r} and {first!r} have a mean cross-control coherence of "
                f"{mean:.2f} (largest at {worst:.3g} rad/s)"
            )
            if mean > CROSS_CONTROL_SINGULAR:
                raise IdentificationError(
                    f"{message}, so their effects can't be told apart; {advice}, "
                    "or leave out of the inputs the one that is known to have no effect",
                    remedy="inputs",
                )
            if mean > CROSS_CONTROL_LIMIT:
                yield f"{message}, expected at most {CROSS_CONTROL_LIMIT}; {advice}"


def resolved_band(records: Sequence[FlightRecord]) -> tuple[float, float]:
    """Return the band that records resolve, rad/s: up to ten samples a period.

    Raises IdentificationError for records that are too short.
    """
    durations = [record.duration for record in records]
    low = 1.0001 * lowest_line(durations)
    high = 2.0 * math.pi / (_SAMPLES_A_PERIOD * max(record.sample_time for record in records))
    if not low < high:
        raise IdentificationError(
            f"the records are too short: the shortest lasts {min(durations):.4g} s, which "
            f"resolves frequencies from {low:.4g} rad/s, and its samples up to {high:.4g} rad/s"
        )
    return low, high


def excited_sticks(records: Sequence[FlightRecord], inputs: Sequence[str]) -> tuple[str, ...]:
    """Return the sticks of the inputs, where all are recorded and move; else none."""
    sticks = tuple(STICKS.get(name, "") for name in inputs)
    there = all(name in one for one in records for name in sticks)
    return sticks if there and all(any(np.ptp(o[n]) > 0.0 for o in records) for n in sticks) else ()


def estimated(
    records: Sequence[FlightRecord],
    *,
    inputs: Sequence[str],
    conditioning: Sequence[str] = (),
    reference: Sequence[str] = (),
    band: tuple[float, float] | None = None,
    **how: Any,
) -> FrequencyResponse:
    """Return the response of records; without a reference, by the inputs' sticks if they excite it.

    `reference` ("none",) is the direct estimate; the default `band` is what the records resolve.
    Warnings are among its flags alone. Raises as `frequency_response`, whose options are `how`.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FlagWarning)
        response = frequency_response(
            records,
            inputs=inputs,
            conditioning=conditioning,
            reference=()
            if tuple(reference) == ("none",)
            else reference or excited_sticks(records, (*inputs, *conditioning)),
            band=band or resolved_band(records),
            **how,
        )
    return response if reference else worth_more(response)


def worth_more(joint: FrequencyResponse) -> FrequencyResponse:
    """Return a joint response by sticks, or the direct one where the sticks don't excite."""
    if joint.direct is None:
        return joint
    own, direct = (float(one.usable().mean()) for one in (joint, joint.direct))
    # a gust that comes back in an input is coherent with it, and not with the sticks
    loop = any(one.kind == "feedback" for one in joint.direct.evidence)
    return joint.direct if own < (_IN_A_LOOP if loop else _AS_COHERENT) * direct else joint


def flights_of(records: FlightRecord | Iterable[FlightRecord]) -> tuple[FlightRecord, ...]:
    """Return one record, or several, as a tuple. Raises InputError for none, or for another."""
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    for position, flight in enumerate(flights):
        if not isinstance(flight, FlightRecord):
            raise InputError(
                f"record {position} is a {type(flight).__name__}, expected a FlightRecord"
            )
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    return flights


def check_records(
    flights: Sequence[FlightRecord],
    inputs: Sequence[str],
    outputs: Sequence[str],
    others: Sequence[str] = (),
    references: Sequence[str] = (),
    *,
    band: tuple[float, float] | None,
    use_ended: bool,
) -> None:
    """Raise InputError or IdentificationError where records, names or band allow no estimate."""
    _check_names(flights, inputs, outputs, others, references)
    if not use_ended:
        refuse_truncated(flights)
    if len({one.digest for one in flights}) < len(flights):
        raise InputError("a record was given twice, as if its noise were half: give each once")
    if band is not None:
        _check_band(flights, band)
    _check_motion(flights, (*inputs, *others, *references), "input")
    _check_motion(flights, outputs, "output")


def _check_names(
    flights: Sequence[FlightRecord],
    inputs: Sequence[str],
    outputs: Sequence[str],
    others: Sequence[str],
    reference: Sequence[str],
) -> None:
    if not inputs or not outputs:
        raise InputError("expected at least one input and one output")
    names = (*inputs, *others, *outputs)
    repeated = sorted(
        {name for name in names if names.count(name) > 1 or name in {*outputs} & {*reference}}
    )
    if repeated:
        raise InputError(
            f"each channel has one role, but these have several: {', '.join(repeated)}"
        )
    active = len(inputs) + len(others)
    if reference and len(reference) < active:
        raise InputError(
            f"{len(reference)} reference(s) for {active} active inputs; the joint method needs at "
            "least as many references as inputs and conditioning inputs",
            remedy=(Option("reference", "A,B"),),
        )
    for flight in flights:
        for name in (*names, *reference):
            flight.unit(name)


def _check_band(flights: Sequence[FlightRecord], band: tuple[float, float]) -> None:
    low, high = convert(tuple[float, float], band, "band", Limits(unit="rad/s", above=0.0))
    if not low < high:
        raise InputError(f"band is {low} to {high} rad/s, expected 0 < lower < upper")
    nyquist = min(math.pi / flight.sample_time for flight in flights)
    if high >= nyquist:
        raise InputError(
            f"the band ends at {high:.4g} rad/s, but samples resolve only {nyquist:.4g} rad/s; "
            "lower the band's upper edge or record faster",
            remedy="band",
        )


def _check_motion(flights: Sequence[FlightRecord], names: Sequence[str], role: str) -> None:
    """Raise IdentificationError for a channel that is constant but for rounding."""
    for name in names:
        every = [flight[name] for flight in flights]
        if not any(float(np.ptp(one)) > 1e-12 * float(np.max(np.abs(one))) for one in every):
            raise IdentificationError(
                f"{role} {name!r} is constant in every record; nothing can be identified from "
                f"it: sweep it, or leave it out of the {role}s"
            )


def refuse_truncated(flights: Sequence[FlightRecord]) -> None:
    """Raise IdentificationError if a flight was terminated early."""
    ended = [(number, one.ended) for number, one in enumerate(flights, start=1) if one.ended]
    if ended:
        number, why = ended[0]
        more = f", and {len(ended) - 1} more such" if len(ended) > 1 else ""
        raise IdentificationError(
            f"record {number} is of a flight that was terminated early, because {why}{more}; "
            "leave it out, or use it as it is, with use_ended=True",
            remedy="use_ended",
        )


def faults(flights: Sequence[FlightRecord], names: Sequence[str]) -> Iterator[str]:
    """Yield spikes, frozen runs and stops of records' channels, in words."""
    for number, flight in enumerate(flights, start=1):
        for channel in flight.channels:
            if channel.name in names:
                for what in _channel_faults(flight, channel):
                    yield f"record {number}: {channel.name!r} {what}"


def _channel_faults(flight: FlightRecord, channel: Channel) -> Iterator[str]:
    values, time = flight[channel.name], flight.time
    out = np.flatnonzero(spikes(values))
    if out.size:
        yield (
            f"has {out.size} samples that are spikes, the first at {time[out[0]]:.6g} s; "
            "interpolate them, with helisim.screen(record, repair='spikes')"
        )
    runs = frozen_runs(values) if channel.kind == "OUT" else ()
    if runs:
        first, last = time[runs[0].first], time[runs[0].last]
        yield (
            f"is frozen, in {len(runs)} places, first from {first:.6g} to {last:.6g} s; leave "
            "that out, with helisim.screen(record, repair='frozen')"
        )
    stopped = np.flatnonzero(at_stop(values)) if channel.kind in ("IN1", "IN2") else np.array([])
    lost = stopped.size * flight.duration / (len(flight) - 1)
    if lost > _LONGEST_STOP:
        yield (
            f"is at its stop for {lost:.4g} s, first at {time[stopped[0]]:.6g} s: what the "
            "vehicle does then, or the servo, isn't linear; leave that out, with record.slice"
        )


def flight_span(record: FlightRecord) -> tuple[str, float, float] | None:
    """Return a record's part of a flight: digest, first and last time in s; None if unknown."""
    flown = {key: x for key, x in record.provenance.items() if key not in _NOT_THE_FLIGHT}
    log = record.provenance.get("log")
    if not flown and isinstance(log, Mapping):
        if any(one["kind"] == "reset" for one in log.get("findings", ())):
            return None  # its time begins anew: the part is unknown
        flown = {"log": log.get("digest")}
    if not flown:
        return None
    flight = hashlib.blake2b(json.dumps(flown, sort_keys=True).encode(), digest_size=12).hexdigest()
    return flight, float(record.time[0]), float(record.time[-1])


def share_seen(record: FlightRecord, spans: Sequence[tuple[str, float, float]]) -> float:
    """Return the share of a record's time within spans of flights, 0 to 1."""
    own = flight_span(record)
    if own is None:
        return 0.0
    flight, first, last = own
    seen, reached = 0.0, first
    for _, start, stop in sorted(span for span in spans if span[0] == flight):
        seen += max(min(stop, last) - max(start, reached), 0.0)
        reached = max(reached, min(stop, last))
    return seen / (last - first)
