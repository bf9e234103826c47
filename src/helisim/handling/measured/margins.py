"""Margins, disturbance rejection and bandwidth of a closed loop, from flight records alone."""

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.base.value import Value
from helisim.handling.loop import BY_NAME, NoResponse, axis_of
from helisim.handling.measured.cut import PLACES, Cut, cuts_by_name, groups, moving
from helisim.handling.measured.driven import Driven, estimate_driven
from helisim.handling.measured.excited import excited_band
from helisim.handling.measured.figures import UNITS, Asked, asked_of
from helisim.handling.measured.interval import Interval, intervals
from helisim.handling.measured.latency import latencies
from helisim.handling.measured.loop import DRAWS, MeasuredCurves, MeasuredLoop
from helisim.ident import CrossControlWarning, RecordQualityWarning
from helisim.records.channels import IN1, IN2
from helisim.records.provenance import one_blas_thread
from helisim.records.record import FlightRecord

_HELD = 0.1
"""Sticks that move by more than this share of what was injected, near it, are told."""

_MOST_DRAWS = 20_000
_LATEST = 10.0
"""s; a record later than that is no record of the same moment."""


@dataclass(frozen=True)
class MeasuredFigure:
    """One figure of a loop as flown.

    Attributes:
        name: "crossover", "phase_margin", "gain_margin", "DRB", "DRP", "bandwidth", "phase_delay".
        axis: of control.
        at: where the loop was cut; "stick" of answers to it.
        unit: of value and interval.
        interval: value, and the ends of its 95 % interval.
    """

    name: str
    axis: str
    at: str
    unit: str
    interval: Interval

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON; null for an end that the records don't bound."""
        low, high = (
            end if math.isfinite(end) else None for end in (self.interval.low, self.interval.high)
        )
        return {
            "figure": self.name,
            "axis": self.axis,
            "at": self.at,
            "unit": self.unit,
            "value": self.interval.value,
            "low": low,
            "high": high,
        }


@dataclass(frozen=True, eq=False)
class MeasuredMargins(Value):
    """What flight records say of a closed loop.

    Attributes:
        loop: its responses with their draws, of which any criterion can be asked.
        figures: with 95 % intervals.
        remarks: what the records can't say, and what is to be doubted.
    """

    loop: MeasuredLoop
    figures: tuple[MeasuredFigure, ...]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return f"MeasuredMargins({len(self.figures)} figures of {', '.join(self.loop.axes)})"

    def figure(self, name: str, axis: str, at: str | None = None) -> Interval:
        """Return one figure, such as ("phase_margin", "lat", "actuators"), with its interval.

        Raises:
            UnknownNameError: the records don't have it.
        """
        wanted = axis_of(axis).name
        for one in self.figures:
            if (one.name, one.axis) == (name, wanted) and at in (None, one.at):
                return one.interval
        have = [f"{one.name} {one.axis} {one.at}" for one in self.figures]
        raise UnknownNameError("figure", f"{name} {wanted} {at or ''}".strip(), have)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {
            "figures": [one.to_dict() for one in self.figures],
            "remarks": list(self.remarks),
        }


@one_blas_thread()
def margins(
    records: FlightRecord | Sequence[FlightRecord],
    *,
    cuts: Cut | Iterable[Cut] | None = None,
    axes: str | Iterable[str] | None = None,
    at: str | Iterable[str] | None = None,
    band: tuple[float, float] | Mapping[str, tuple[float, float]] | None = None,
    late: Mapping[str, float] | None = None,
    draws: int = DRAWS,
    seed: int = 1,
) -> MeasuredMargins:
    """Measure a closed loop from flight records: margins, DRB, DRP, bandwidth, with intervals.

    Of what was injected at a servo command follow the broken loop there, its crossover, phase and
    gain margin; at a sensed attitude, the same there and the rejection of disturbances, DRB and
    DRP; of sticks that were swept, bandwidth and phase delay. Several axes may be excited at once.

    Args:
        records: flights; those that have an injected signal in common are estimated together.
        cuts: where something was injected. By default what channels' names say: `lat_disturbance`
            was added, `lat_sum` is what came of it.
        axes: of these only.
        at: "actuators", "sensors" or one sensor such as "p": of these only.
        band: rad/s, or channel that was injected -> its band; by default, and of a channel that
            is not there, where what was injected has power.
        late: channel -> s, by which its record is late; by default as a simulation's records say.
        draws: of the loop, for the intervals.
        seed: of the draws.

    Raises:
        InputError: an argument is out of range, or a channel does not exist.
        IdentificationError: nothing was injected or swept, or records are too short.
    """
    flights = (records,) if isinstance(records, FlightRecord) else tuple(records)
    if not flights:
        raise InputError("no records were given; expected at least one FlightRecord")
    if not 2 <= draws <= _MOST_DRAWS:
        raise InputError(f"draws is {draws}, expected 2 to {_MOST_DRAWS}")
    recorded = sorted({name for flight in flights for name in flight.names})
    for name, delay in (late or {}).items():
        if name not in recorded:
            raise UnknownNameError("channel that is late", name, recorded)
        if not abs(delay) < _LATEST:
            raise InputError(f"{name} is late by {delay} s, expected less than {_LATEST:g} s")
    known = _cuts(flights, cuts)
    chosen = _chosen(known, axes, at)
    moved = moving(flights, known)
    delay = latencies(flights) | dict(late or {})
    driven: list[Driven] = []
    remarks: list[str] = []
    failed: list[IdentificationError] = []
    for drives, numbers in groups(moved):
        part = [flights[number] for number in numbers]
        try:
            found, said = _estimate(part, drives, known, band, delay)
        except IdentificationError as error:
            failed.append(error)
            continue
        driven += found
        remarks += said
    if failed and not driven:
        raise failed[0]
    if not driven:
        raise IdentificationError(
            "nothing was injected and no stick moves: no response of a loop can be measured; name "
            "what was injected (--injected), or fly with an excitation"
        )
    remarks += [str(error) for error in failed]
    curves = MeasuredCurves(tuple(driven), tuple(chosen), draws + draws % 2, seed)
    loop = MeasuredLoop(curves)
    figures, missing = _figures(loop, chosen, _axes(axes), sticks=at is None)
    return MeasuredMargins(loop, figures, tuple(dict.fromkeys((*missing, *remarks))))


def _cuts(flights: Sequence[FlightRecord], cuts: Cut | Iterable[Cut] | None) -> tuple[Cut, ...]:
    if cuts is None:
        names = dict.fromkeys(name for flight in flights for name in flight.names)
        return cuts_by_name(tuple(names))
    given = (cuts,) if isinstance(cuts, Cut) else tuple(cuts)
    for cut in given:
        names = (cut.injected, *cut.outputs)
        cutting = [flight for flight in flights if any(name in flight for name in names)]
        for flight in cutting or flights:
            for name in names:
                flight.unit(name)
    return given


def _axes(axes: str | Iterable[str] | None) -> tuple[str, ...]:
    if axes is None:
        return tuple(BY_NAME)
    return tuple(axis_of(one).name for one in ([axes] if isinstance(axes, str) else axes))


def _chosen(
    cuts: Sequence[Cut], axes: str | Iterable[str] | None, at: str | Iterable[str] | None
) -> list[Cut]:
    places = None if at is None else {at} if isinstance(at, str) else set(at)
    rates = [axis.rate for axis in BY_NAME.values() if axis.rate]
    for place in sorted(places or ()):
        if place not in (*PLACES, *rates):
            raise UnknownNameError("place of a cut", place, (*PLACES, *rates))
    wanted = _axes(axes)
    return [cut for cut in cuts if cut.axis in wanted and (places is None or cut.at in places)]


def _estimate(
    part: Sequence[FlightRecord],
    drives: tuple[str, ...],
    cuts: Sequence[Cut],
    band: tuple[float, float] | Mapping[str, tuple[float, float]] | None,
    late: Mapping[str, float],
) -> tuple[list[Driven], list[str]]:
    """Return the responses to what was injected in some records, and what is to be doubted."""
    common = [name for name in part[0].names if all(name in one for one in part)]
    by_stick = all(name in IN2 for name in drives)
    if by_stick:
        wanted = _answers(common, drives)
    else:
        injected = [cut for cut in cuts if cut.injected in drives]
        wanted = [name for cut in injected for name in cut.outputs]
        wanted += [cut.axis for cut in injected if cut.at == "sensors"]
    outputs = [
        name
        for name in dict.fromkeys(wanted)
        if name in common and name not in drives and any(np.ptp(one[name]) > 0.0 for one in part)
    ]
    if not outputs:
        raise IdentificationError(
            f"nothing that was recorded answers to {', '.join(drives)}: expected "
            f"{', '.join(dict.fromkeys(filter(None, wanted)))}"
        )
    with warnings.catch_warnings():
        for category in (CrossControlWarning, RecordQualityWarning):  # they are among the flags
            warnings.simplefilter("ignore", category)
        found = estimate_driven(
            part,
            drives,
            outputs,
            _band(band, drives) or excited_band(part, drives),
            late,
            cuts,
        )
    # what was injected is known as it is: a multisine's peaks are no spikes
    remarks = [one for one in found[0].flags if not any(repr(name) in one for name in drives)]
    if not by_stick:
        remarks += _held(part, drives)
    return found, remarks


def _band(
    band: tuple[float, float] | Mapping[str, tuple[float, float]] | None, drives: Sequence[str]
) -> tuple[float, float] | None:
    """Return the band that all driving signals have in common, None if nothing says it."""
    if not isinstance(band, Mapping):
        return band
    said = [band[name] for name in drives if name in band]
    if not said:
        return None
    return max(low for low, _ in said), min(high for _, high in said)


def _answers(common: Sequence[str], sticks: Sequence[str]) -> list[str]:
    """Return what answers to sticks: rates, angles without one, the swept axes' commands."""
    axes = BY_NAME.values()
    wanted = [axis.rate if axis.rate and axis.rate in common else axis.angle for axis in axes]
    return wanted + [axis.name for axis in axes if axis.stick in sticks]


def _held(part: Sequence[FlightRecord], drives: Sequence[str]) -> list[str]:
    """Say that sticks moved while something was injected: a pilot is part of what comes back."""
    at_actuators = [name for name in drives if name.removesuffix("_disturbance") in IN1]
    if not at_actuators:
        return []
    least = min(max(float(np.std(one[name])) for one in part) for name in at_actuators)
    held = [
        name
        for name in IN2
        if name != "COL"
        and all(name in one for one in part)
        and max(float(np.std(one[name])) for one in part) > _HELD * least
    ]
    if not held:
        return []
    return [
        f"{', '.join(held)} moved while {', '.join(at_actuators)} did: what a pilot answers is "
        "part of the loop that was measured; for the law's alone keep hands off"
    ]


def _figures(
    loop: MeasuredLoop, cuts: Sequence[Cut], axes: Sequence[str], *, sticks: bool
) -> tuple[tuple[MeasuredFigure, ...], list[str]]:
    """Return all figures that the loop has, and which it doesn't have."""
    found: list[MeasuredFigure] = []
    missing: list[str] = []
    beyond: dict[tuple[str, str, str], list[str]] = {}
    drives = {one.drive for one in loop.curves.driven}
    asked = [one for cut in cuts if cut.injected in drives for one in asked_of(cut)]
    if not asked:
        missing.append(
            "no loop was cut: nothing that the control law doesn't know was injected, so margins, "
            "DRB and DRP can't be had; inject at an actuator or a sensor, and record it"
        )
    if sticks:
        swept = [name for name in axes if BY_NAME[name].stick in drives and name != "col"]
        asked += [Asked("command", name, "stick") for name in swept]
    for one in asked:
        try:
            each = intervals(loop, one)
        except NoResponse as error:
            missing.append(str(error))
            continue
        for name, value in each.items():
            if math.isfinite(value.value):
                found.append(MeasuredFigure(name, one.axis, one.at, UNITS[name], value))
            else:
                key = name.replace("_", " "), one.at, _known(loop, one)
                beyond.setdefault(key, []).append(one.axis)
    missing += [
        f"{name} of {', '.join(on)} at {at} isn't within {band}, where the response is known"
        for (name, at, band), on in beyond.items()
    ]
    return tuple(found), missing


def _known(loop: MeasuredLoop, asked: Asked) -> str:
    """Return the band in which what is asked for is known, in words."""
    curve = {
        "broken": lambda: loop.broken(asked.axis, asked.at),
        "disturbance": lambda: loop.disturbance(asked.axis),
        "command": lambda: loop.command(asked.axis),
    }[asked.kind]()
    low, high = curve.frequency[0], curve.frequency[-1]
    return f"{low:.3g} to {high:.3g} rad/s"
