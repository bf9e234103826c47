"""Figures over frequency and time: responses, broken loops, verifications, flights, trims.

Data come first and wide, lines that explain them thin and on top, words outside: nothing hides
the measurement. Degrees are for people; the value objects stay in rad/s and rad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.units import decibel
from helisim.ident import USABLE_COHERENCE, Fit, FrequencyResponse, Verification
from helisim.records import record as c
from helisim.records.record import ATTITUDES, CHANNELS, IN1, RATES, FlightRecord
from helisim.show.figure import Array, Drawing, Ink, Mark, Panel, extent, less

if TYPE_CHECKING:
    from helisim.sim import Excitation
    from helisim.study.results import IdentifiedModel
    from helisim.vehicle import Vehicle

Complex = NDArray[np.complex128]

DEGREES = (0.5, 1.0, 2.0, 5.0, 15.0, 45.0, 90.0, 180.0, 360.0)
"""Steps between ticks of a phase."""
SURE = 2.0
"""Random errors that a bar reaches either way: the response is within in 95 of 100 cases."""
_HIGHEST = 135.0
"""Degrees: where a phase starts at most, less than a turn lower at least. So an integrator starts
at -90, two at -180, and a lead at 90."""
_POINTS = 60
"""Measured points in a figure at most, log-spaced: their bars stay apart, and neighbours between
them share their windows with those that are shown."""
_LEAST_DB, _LEAST_DEG = 2.5, 25.0
"""Least half ranges of the panels of differences: an unnoticed mismatch is in sight."""

_FAMILIES = {
    "controls": c.IN1,
    "sticks": c.IN2,
    "servos": c.SERVOS,
    "rates": c.RATES,
    "attitude": c.ATTITUDES,
    "velocity": c.VELOCITIES,
    "specific force": c.ACCELERATIONS,
    "position": c.POSITIONS,
    "rotor": c.ROTOR,
    "rotor speed": c.ROTOR_SPEED,
    "air": c.AIR,
    "servo positions": c.SERVO_POSITIONS,
}
"""Channels that are looked at together."""
_UNITISED = ("controls", "sticks", "servos", "servo positions")
_INKS: tuple[Ink, ...] = ("identified", "data", "third", "fourth")
_INSTANTS = 3001
"""Samples of a manoeuvre in a drawing: more than a figure has columns."""


class Mismatch(NamedTuple):
    """The envelopes, (n_freq,) each: ratios of vehicle over model that no pilot notices."""

    low_db: Array
    high_db: Array
    low_deg: Array
    high_deg: Array


_MUAD = (
    ((0.095, 9.92, 2.15), (1.0, 11.6, 4.95)),
    ((3.16, 31.61, 22.79), (1.0, 27.14, 1.84)),
    ((475.32, 184100.0, 29460.0), (1.0, 11.66, 0.039)),
    ((68.89, 1100.12, -275.22), (1.0, 39.94, 9.99)),
)
"""Numerator and denominator of least and most gain, then phase; highest power of s first."""


def unnoticeable(frequency: Array) -> Mismatch:
    """Return the envelopes of maximum unnoticeable added dynamics (MUAD) at (n_freq,) rad/s.

    They are four transfer functions around the mismatch that evaluation pilots of fighters did not
    notice (J. Hodgkinson and others; in MIL-STD-1797 for lower-order equivalent systems), narrowest
    near 2 to 4 rad/s, where pilots close their loops. Tischler and Remple judge identified models
    by them. Coefficients as `LoesBound.m` (C. Regan, 2006) quotes them. They say less of a small
    helicopter, which is flown faster: its frequencies go with the square root of its size.
    """
    s = 1j * np.asarray(frequency, dtype=np.float64)
    low, high, behind, ahead = (np.polyval(over, s) / np.polyval(under, s) for over, under in _MUAD)
    degrees = (np.rad2deg(np.angle(one)) for one in (behind, ahead))
    return Mismatch(decibel(np.abs(low)), decibel(np.abs(high)), *degrees)


def decibels(line: Complex) -> Array:
    """Return the gain, dB, (n_freq,), of a response (n_freq,); a zero is drawn at -240 dB."""
    return decibel(np.maximum(np.abs(line), 1e-12))


def phase_degrees(line: Complex, good: NDArray[np.bool_] | None = None) -> Array:
    """Return the phase, degrees, (n_freq,), without jumps, from -225 to 135 where it starts.

    Args:
        line: (n_freq,) the response.
        good: (n_freq,) where it is coherent: it starts at the first such point, and is followed
            from one to the next; between them each point lies where it is nearest to their line.
            Everywhere by default.
    """
    angle = np.rad2deg(np.angle(line))
    sure = np.flatnonzero(np.ones(angle.size, dtype=np.bool_) if good is None else good)
    if sure.size == 0:
        sure = np.arange(angle.size)
    followed = np.unwrap(angle[sure], period=360.0)
    followed -= 360.0 * np.ceil((followed[0] - _HIGHEST) / 360.0)
    near = np.interp(np.arange(angle.size), sure, followed)
    return angle + 360.0 * np.round((near - angle) / 360.0)


def beside(frequency: Array, line: Complex, other: Array, phase: Array) -> Array:
    """Return the phase of a response, degrees, moved as a whole to the turn of another phase.

    Args:
        frequency: (n_freq,) of the response, rad/s.
        line: (n_freq,) the response.
        other: (m_freq,) frequencies of the other phase, rad/s, none at least.
        phase: (m_freq,) degrees, of each of them.
    """
    own = phase_degrees(line)
    if other.size == 0:
        return own
    apart = phase - np.interp(np.log(other), np.log(frequency), own)
    return own + 360.0 * np.round(np.median(apart) / 360.0)


def spread_out(frequency: Array, count: int = _POINTS) -> NDArray[np.intp]:
    """Return which of (n_freq,) frequencies are nearest to `count` log-spaced ones, each once."""
    if frequency.size <= count:
        return np.arange(frequency.size)
    place = np.log(frequency)
    wanted = np.linspace(place[0], place[-1], count)
    return np.unique(np.argmin(np.abs(place[:, None] - wanted), axis=0))


def draw_bode(
    name: str,
    output: str,
    input_: str,
    *,
    data: FrequencyResponse | None = None,
    identified: FrequencyResponse | None = None,
    truth: FrequencyResponse | None = None,
    used: tuple[float, float] | None = None,
    caption: str = "",
) -> Drawing:
    """Draw one pair: magnitude, phase, both less the identified model's, and the coherence.

    Args:
        name: of the drawing.
        output: of the pair, in each response that is given.
        input_: of the pair.
        data: estimated from flights; bars reach two random errors either way, points below the
            usable coherence are hollow.
        identified: the fitted model's. The difference from it has the mismatch beside it that
            pilots do not notice (MUAD).
        truth: the exact one of the vehicle that flew.
        used: lowest and highest frequency of the fit, rad/s; None if the pair was left out.
        caption: of the drawing.
    """
    gains: list[Mark] = []
    phases: list[Mark] = []
    other, reference = np.zeros(0), np.zeros(0)
    alone = data is None and (identified is None or truth is None)
    if data is not None:
        o, i = data.index(output, input_)
        good = data.usable()[o, i]
        phase = phase_degrees(data.response[o, i], good)
        other, reference = data.frequency[good], phase[good]
        gains += _estimate(data, (o, i), decibels(data.response[o, i]), decibel)
        phases += _estimate(data, (o, i), phase, _phase_error)
    for response, label, curve in (
        (identified, "identified", partial(Mark, "line", "identified")),
        (truth, "exact", partial(Mark, "dashes", "truth")),
    ):
        if response is not None:
            line = response.response[response.index(output, input_)]
            phase = beside(response.frequency, line, other, reference)
            if other.size == 0:
                other, reference = response.frequency, phase
            gains.append(curve(response.frequency, decibels(line), label="" if alone else label))
            phases.append(curve(response.frequency, phase))
    phases = [replace(mark, label="") for mark in phases]
    shown = next((one for one in (data, identified, truth) if one and any(one.output_units)), None)
    panels = [
        Panel(f"magnitude, dB ({_ratio_unit(shown, output, input_)})", tuple(gains), 110.0),
        *_differences("magnitude less the identified, dB", gains, "db"),
        Panel("phase, deg", tuple(phases), 100.0, steps=DEGREES),
        *_differences("phase less the identified, deg", phases, "deg"),
    ]
    if data is not None:
        o, i = data.index(output, input_)
        marks = (
            Mark("line", "data", data.frequency, data.coherence[o, i], label="partial", width=1.5),
            Mark("dashes", "grey", data.frequency, data.multiple_coherence[o], label="multiple"),
        )
        limits = (0.0, 1.04)
        panels.append(Panel("coherence", marks, 58.0, (0.5,), limits, threshold=USABLE_COHERENCE))
    title = f"{output} / {input_}"
    return Drawing(name, title, caption, tuple(panels), "frequency, rad/s", True, used)


def draw_pair(item: IdentifiedModel, output: str, input_: str) -> Drawing:
    """Return the figure of one pair of a model."""
    fit, pair = item.fit, f"{output}/{input_}"
    caption = f"{pair}: not enough coherent points, left out of the fit"
    if pair in fit.costs:
        low, high = fit.bands[pair]
        caption = f"{pair}: cost {fit.costs[pair]:.3g} over {low:.3g} to {high:.3g} rad/s"
    return draw_bode(
        f"bode_{item.name}_{output}_{input_}",
        output,
        input_,
        data=fit.data,
        identified=fit.response(fit.data.frequency),
        truth=item.exact,
        used=fit.bands.get(pair),
        caption=caption,
    )


def pairs_of(fit: Fit) -> list[tuple[str, str]]:
    """Return all pairs of a fit's structure, output and input."""
    return [(o, i) for o in fit.structure.outputs for i in fit.structure.inputs]


def draw_verifications(item: IdentifiedModel) -> list[Drawing]:
    """Return one figure for each flight that verified a model."""
    found = item.verification
    if found is None:
        return []
    names = item.verified_on or [f"flight {k + 1}" for k in range(len(found.traces))]
    return [
        draw_verification(f"time_{item.name}_{k + 1}", found, k, name)
        for k, name in enumerate(names)
    ]


def draw_verification(name: str, verification: Verification, trace: int, flight: str) -> Drawing:
    """Draw one flight, measured and predicted, below the inputs that drove it.

    Below each output is its difference from the prediction, on a scale of its own.
    """
    shown = verification.traces[trace]
    inputs = _histories(shown.time, verification.inputs, list(shown.inputs.T))
    panels = [Panel("inputs, unitised", inputs, 62.0)]
    for k, (output, unit) in enumerate(zip(verification.outputs, verification.units)):
        measured, seen = values_for_people(output, shown.measured[:, k], unit)
        predicted, _ = values_for_people(output, shown.predicted[:, k], unit)
        begun = np.isin(shown.time, shown.starts)
        marks = (
            Mark("line", "data", shown.time, measured, label="flight", width=2.6),
            Mark("line", "identified", shown.time, predicted, label="identified model"),
            *[Mark("dots", "identified", shown.time[begun], predicted[begun])] * any(begun),
        )
        residual = Mark("line", "grey", shown.time, less(measured, predicted))
        panels.append(Panel(labelled(output, seen), marks, 96.0))
        panels.append(Panel(labelled(f"{output}, flight less model", seen), (residual,), 42.0))
    tics = ", ".join(f"{output} {tic:.3g}" for output, tic in zip(verification.outputs, shown.tic))
    approach = verification.approach
    brief = approach.in_brief if approach else ""
    title = f"{flight}: {', '.join(verification.outputs)} predicted {brief}".rstrip()
    how = f"; {approach}" if approach else ""
    return Drawing(name, title, f"{flight}: TIC {tics}{how}", tuple(panels), "time, s")


def draw_flight(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of some channels of a record, one below the other."""
    panels = []
    for channel in channels:
        values, unit = values_for_people(channel, record[channel], record.unit(channel))
        mark = Mark("line", "identified", record.time, values, width=0.6)
        panels.append(Panel(labelled(channel, unit), (mark,), 66.0))
    return Drawing(name, title, f"{title}, {record.duration:g} s", tuple(panels), "time, s")


def draw_groups(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of some channels, those of one kind and unit in one panel."""
    groups: dict[tuple[str, str], list[str]] = {}
    for one in channels:
        unit = record.unit(one)
        standard = one in CHANNELS and CHANNELS[one].unit == unit
        family = next((name for name, some in _FAMILIES.items() if standard and one in some), "")
        groups.setdefault((family, unit), []).append(one)
    panels = []
    for (family, unit), names in groups.items():
        for k in range(0, len(names), len(_INKS)):
            some = names[k : k + len(_INKS)]
            shown = [values_for_people(one, record[one], unit) for one in some]
            marks = _histories(record.time, some, [values for values, _ in shown])
            thin = tuple(replace(mark, kind="line", width=0.7) for mark in marks)
            seen = "unitised" if unit == "1" and family in _UNITISED else shown[0][1]
            panels.append(Panel(", ".join(filter(None, (family, seen))), thin, 78.0))
    return Drawing(name, title, f"{title}, {record.duration:g} s", tuple(panels), "time, s")


def draw_compared(
    name: str,
    title: str,
    names: Sequence[str],
    before: FlightRecord | None,
    after: FlightRecord,
) -> Drawing:
    """Draw channels of a flight with the law before, if there is one, and with the designed."""
    panels: list[Panel] = []
    flights: tuple[tuple[str, Ink, FlightRecord | None], ...] = (
        ("before", "grey", before),
        ("designed", "identified", after),
    )
    for channel in names:
        marks, unit = [], after.unit(channel)
        for label, ink, record in flights:
            if record is not None and channel in record:
                values, unit = values_for_people(channel, record[channel], record.unit(channel))
                word = "" if panels else label
                marks.append(Mark("line", ink, record.time, values, label=word, width=1.1))
        if marks:
            panels.append(Panel(labelled(channel, unit), tuple(marks), 62.0))
    caption = f"{title}, flown on the nonlinear vehicle, {np.ptp(after.time):.3g} s"
    return Drawing(name, title, caption, tuple(panels), "time, s")


def draw_excitation(name: str, flown: Excitation) -> Drawing | None:
    """Draw the signals of a manoeuvre at each of its places; None where no one knows them yet.

    So it is of one that leaves settings to the vehicle, and of a pilot's sweep, whose wobble each
    flight has anew.
    """
    if any(getattr(flown, setting) is None for setting in flown.left_open):
        return None
    # here, where its manoeuvre is loaded already; a log alone needs no simulator
    from helisim.sim.excitation import PLACES, is_foreknown, unit

    if not is_foreknown(flown):
        return None
    time = np.linspace(0.0, flown.duration, _INSTANTS)
    try:
        added = flown.added(time)
    except InputError:
        return None
    panels = []
    for place, values in added.items():
        for axis, one in zip(PLACES[place], values.T):
            if np.any(one):
                mark = Mark("line", "identified", time, one, width=0.6)
                shown = unit(place, axis).replace("1", "unitised")
                panels.append(Panel(f"{axis} at the {place}, {shown}", (mark,), 48.0))
    title = f"{type(flown).__name__}, {flown.axis}"
    return Drawing(name, title, f"{title}, {flown.duration:g} s", tuple(panels), "time, s")


def draw_trims(flights: Sequence[Vehicle]) -> Drawing:
    """Draw level flight over speed: power, controls, attitude."""
    trims = [flight.trim for flight in flights]
    speeds = np.array([trim.speed for trim in trims])
    power = np.array([flight.power for flight in flights])
    controls = [np.array([getattr(trim, name) for trim in trims]) for name in IN1]
    attitudes = ("theta", "phi")
    angles = [np.rad2deg([getattr(trim, name) for trim in trims]) for name in attitudes]
    line = Mark("line", "identified", speeds, power)
    panels = (
        Panel("power of both rotors, W", (line, Mark("dots", "identified", speeds, power)), 120.0),
        Panel("controls, unitised", _histories(speeds, IN1, controls), 120.0),
        Panel("attitude, deg", _histories(speeds, attitudes, angles), 120.0),
    )
    title = f"{flights[0].name} in level flight"
    caption = f"{title}: power, controls and attitude over speed"
    return Drawing("trim", title, caption, panels, "speed, m/s")


def values_for_people(name: str, values: Array, unit: str) -> tuple[Array, str]:
    """Return values and their unit, rates and attitudes in degrees; (n_value,) each."""
    if name in (*RATES, *ATTITUDES) and unit.startswith("rad"):
        return np.rad2deg(values), unit.replace("rad", "deg")
    return values, unit


def labelled(name: str, unit: str) -> str:
    """Return the label of a channel's axis."""
    if name.lower() in IN1:
        return f"{name}, unitised"
    return name if unit in ("", "1") else f"{name}, {unit}"


def _histories(x: Array, names: Sequence[str], values: Sequence[Array]) -> tuple[Mark, ...]:
    """Return a line (n,) for each name, every second one dashed."""
    return tuple(
        Mark(("line", "dashes")[k % 2], _INKS[k % len(_INKS)], x, one, label=name)
        for k, (name, one) in enumerate(zip(names, values))
    )


def _ratio_unit(data: FrequencyResponse | None, output: str, input_: str) -> str:
    """Return the unit of output over input; "SI" where no response tells it."""
    if data is None:
        return "SI"
    o, i = data.index(output, input_)
    over, under = data.output_units[o] or "1", data.input_units[i] or "1"
    return over if under == "1" else f"{over} / {under}"


def _phase_error(ratio: Array) -> Array:
    """Return by how many degrees an error of this ratio less one turns a response, (n_freq,)."""
    return np.rad2deg(np.minimum(ratio - 1.0, np.pi))


def _estimate(
    data: FrequencyResponse,
    pair: tuple[int, int],
    values: Array,
    size: Callable[[Array], Array],
) -> list[Mark]:
    """Return an estimate as marks: bars and points where it is coherent, rings elsewhere."""
    at = spread_out(data.frequency)
    omega, values, good = data.frequency[at], values[at], data.usable()[pair][at]
    half = size(1.0 + SURE * data.random_error[pair][at])[good]
    marks = [
        Mark("bars", "data", omega[good], values[good] - half, values[good] + half),
        Mark("dots", "data", omega[good], values[good], label="flight data"),
    ]
    if not good.all():
        label = f"coherence < {USABLE_COHERENCE:g}"
        marks.append(Mark("rings", "data", omega[~good], values[~good], label=label))
    return marks


def _differences(label: str, marks: Sequence[Mark], unit: str) -> list[Panel]:
    """Return a panel of the differences from the identified model; none without one, or alone.

    Where all agree to the width of a line, it alone shows by how much. Estimates that are too
    incoherent to use are left out: they would set the scale.
    """
    (model,) = [mark for mark in marks if mark.ink == "identified"] or (None,)
    if model is None or len(marks) == 1:
        return []
    low, high = model.x[[0, -1]]
    apart = []
    for mark in marks:
        if mark.kind != "rings":
            there = (mark.x >= low * 0.999) & (mark.x <= high * 1.001)
            base = np.interp(np.log(mark.x[there]), np.log(model.x), model.y)
            top = None if mark.top is None else less(mark.top[there], base)
            y = less(mark.y[there], base)
            apart.append(replace(mark, x=mark.x[there], y=y, top=top, label=""))
    furthest = max(np.abs(extent([mark.y for mark in apart if mark.kind != "bars"])))
    half = max(1.15 * furthest, _LEAST_DB if unit == "db" else _LEAST_DEG)
    bounds = unnoticeable(model.x)._asdict()
    edges = tuple(
        Mark("dashes", "grey", model.x, np.where(np.abs(edge) < half, edge, np.nan), label=word)
        for edge, word in (
            (bounds[f"low_{unit}"], ""),
            (bounds[f"high_{unit}"], "unnoticed (MUAD)"),
        )
    )
    return [Panel(label, (*edges, *apart), 64.0, limits=(-half, half))]
