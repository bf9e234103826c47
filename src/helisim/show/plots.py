"""Figures over frequency and time; angles in degrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.settings import grouped
from helisim.base.units import decibel
from helisim.ident import USABLE_COHERENCE, Fit, FrequencyResponse, Verification
from helisim.ident.verification import Trace
from helisim.records import record as c
from helisim.records.record import ATTITUDES, CHANNELS, RATES, FlightRecord
from helisim.show.figure import Drawing, Ink, Mark, Panel

if TYPE_CHECKING:
    from helisim.study.results import IdentifiedModel

Look = tuple[Literal["line", "dashes"], Ink, str]
"""Kind, ink and label of a line."""

DEGREES = (0.5, 1.0, 2.0, 5.0, 15.0, 45.0, 90.0, 180.0, 360.0)  # steps between ticks of a phase
SURE = 2.0  # random errors of a bar either way, for 95 %
# _HIGHEST: degrees, largest phase at the start
# _POINTS: most measured points in a figure, log-spaced
_HIGHEST, _POINTS = 135.0, 60
_LEAST_DB, _LEAST_DEG = 1.0, 10.0  # least half ranges of difference panels

_FAMILIES = (
    (c.IN1, "controls"),
    (c.IN2, "sticks"),
    (c.SERVOS, "servos"),
    (c.SERVO_POSITIONS, "servo positions"),
    (c.RATES, "rates"),
    (c.ATTITUDES, "attitude"),
    (c.VELOCITIES, "velocity"),
    (c.ACCELERATIONS, "specific force"),
    (c.POSITIONS, "position"),
    (c.LOAD, "load"),
    (c.ROTOR[:2], "tilt"),
    (c.AIR[:3], "velocity of the air"),
    (c.AIR[3:], "rates of the air"),
)
"""Channels drawn together."""
_UNITISED = (*c.IN1, *c.IN2, *c.SERVOS, *c.SERVO_POSITIONS)
_INKS: tuple[Ink, ...] = ("identified", "data", "third", "fourth")


def decibels(line: Complex) -> Real:
    """Return the gain, dB, (n_freq,), of a response (n_freq,); a zero is drawn at -240 dB."""
    return decibel(np.maximum(np.abs(line), 1e-12))


def phase_degrees(line: Complex, good: NDArray[np.bool_] | None = None) -> Real:
    """Return the unwrapped phase, degrees, of a response, followed where `good`; (n_freq,) each.

    It starts between -225 and 135.
    """
    angle = np.rad2deg(np.angle(line))
    sure = np.arange(angle.size) if good is None or not good.any() else np.flatnonzero(good)
    followed = np.unwrap(angle[sure], period=360.0)
    followed -= 360.0 * np.ceil((followed[0] - _HIGHEST) / 360.0)
    near = np.interp(np.arange(angle.size), sure, followed)
    return angle + 360.0 * np.round((near - angle) / 360.0)


def beside(frequency: Real, line: Complex, other: tuple[Real, Real] | None) -> Real:
    """Return a response's phase, degrees, by whole turns beside that of another; (n_freq,) each.

    `frequency` is in rad/s, `other` is rad/s and degrees, (m_freq,) each.
    """
    own = phase_degrees(line)
    if other is None or other[0].size == 0:
        return own
    apart = other[1] - np.interp(np.log(other[0]), np.log(frequency), own)
    return own + 360.0 * np.round(np.median(apart) / 360.0)


def spread_out(frequency: Real, count: int = _POINTS) -> NDArray[np.intp]:
    """Return indices of the (n_freq,) frequencies nearest to `count` log-spaced ones, each once."""
    if frequency.size <= count:
        return np.arange(frequency.size)
    place = np.log(frequency)
    wanted = np.linspace(place[0], place[-1], count)
    return np.unique(np.argmin(np.abs(place[:, None] - wanted), axis=0))


def draw_bode(
    name: str,
    output: str,
    input_: str,
    data: FrequencyResponse,
    *,
    identified: FrequencyResponse | None = None,
    truth: FrequencyResponse | None = None,
    used: tuple[float, float] | None = None,
    caption: str = "",
) -> Drawing:
    """Draw magnitude, phase, differences from the identified model, and coherence of one pair.

    Bars reach two random errors either way; points below the usable coherence are hollow. `used` is
    the fit's band, rad/s.
    """
    pair = data.index(output, input_)
    response, good = data.response[pair], data.usable()[pair]
    phase = phase_degrees(response, good)
    gains = _estimate(data, pair, decibels(response), decibel)
    turned = _estimate(data, pair, phase, lambda ratio: np.rad2deg(np.minimum(ratio - 1, np.pi)))
    phases = [replace(mark, label="") for mark in turned]
    models: list[tuple[FrequencyResponse | None, Look]] = [
        (identified, ("line", "identified", "identified")),
        (truth, ("dashes", "truth", "truth")),
    ]
    for model, (kind, ink, label) in models:
        if model is not None:
            omega, line = model.frequency, model.response[model.index(output, input_)]
            angle = beside(omega, line, (data.frequency[good], phase[good]))
            gains.append(Mark(kind, ink, omega, decibels(line), label=label))
            phases.append(Mark(kind, ink, omega, angle))
    multiple = data.multiple_coherence[pair[0]]
    coherence = (
        Mark("line", "data", data.frequency, data.coherence[pair], label="partial", width=1.5),
        Mark("line", "grey", data.frequency, multiple, label="multiple"),
    )
    said = f"coherence, usable from {USABLE_COHERENCE:g}"
    over, under = data.output_units[pair[0]] or "1", data.input_units[pair[1]] or "1"
    unit = over if under == "1" else f"{over} / {under}"
    if not any(data.output_units):
        unit = "SI"
    panels = (
        Panel(f"magnitude, dB ({unit})", tuple(gains), 110.0),
        *_differences("magnitude less the identified, dB", gains, _LEAST_DB),
        Panel("phase, deg", tuple(phases), 100.0, steps=DEGREES),
        *_differences("phase less the identified, deg", phases, _LEAST_DEG),
        Panel(said, coherence, 58.0, (0.5,), (0.0, 1.04), threshold=USABLE_COHERENCE),
    )
    return Drawing(name, f"{output} / {input_}", caption, panels, "frequency, rad/s", True, used)


def draw_pair(item: IdentifiedModel, output: str, input_: str) -> Drawing:
    """Return the Bode plot of one pair of a model."""
    fit, pair = item.fit, f"{output}/{input_}"
    said = (
        "cost {:.3g} over {:.3g} to {:.3g} rad/s".format(fit.costs[pair], *fit.bands[pair])
        if pair in fit.costs
        else "not enough coherent points, left out of the fit"
    )
    return draw_bode(
        f"bode_{item.name}_{output}_{input_}",
        output,
        input_,
        fit.data,
        identified=fit.response(fit.data.frequency),
        truth=item.exact,
        used=fit.bands.get(pair),
        caption=f"{pair}: {said}",
    )


def pairs_of(fit: Fit) -> list[tuple[str, str]]:
    """Return all pairs of a fit as (output, input)."""
    return [(o, i) for o in fit.structure.outputs for i in fit.structure.inputs]


def draw_verifications(
    name: str, verification: Verification | None, flights: Sequence[str] = ()
) -> list[Drawing]:
    """Draw inputs, measured and predicted outputs, and their difference, of each flight."""
    if verification is None:
        return []
    names = flights or [f"flight {k + 1}" for k in range(len(verification.traces))]
    return [
        _predicted(f"{name}_{k}", verification, trace, flight)
        for k, (trace, flight) in enumerate(zip(verification.traces, names), 1)
    ]


def _predicted(name: str, verification: Verification, shown: Trace, flight: str) -> Drawing:
    panels = [Panel("inputs", _histories(shown.time, verification.inputs, shown.inputs.T), 62.0)]
    for k, (output, unit) in enumerate(zip(verification.outputs, verification.units)):
        measured, seen = values_for_people(output, shown.measured[:, k], unit)
        predicted, _ = values_for_people(output, shown.predicted[:, k], unit)
        marks = (
            Mark("line", "data", shown.time, measured, label="flight", width=2.6),
            Mark("line", "identified", shown.time, predicted, label="identified model"),
        )
        left = (Mark("line", "grey", shown.time, measured - predicted),)
        panels += [
            Panel(labelled(output, seen), marks, 96.0),
            Panel(labelled(f"{output}, flight less model", seen), left, 48.0),
        ]
    tics = ", ".join(f"{output} {tic:.3g}" for output, tic in zip(verification.outputs, shown.tic))
    how = f"; {verification.approach}" if verification.approach else ""
    title = f"{flight}: {', '.join(verification.outputs)} predicted"
    return Drawing(name, title, f"{flight}: TIC {tics}{how}", tuple(panels), "time, s")


def draw_flight(name: str, title: str, record: FlightRecord, channels: Sequence[str]) -> Drawing:
    """Draw time histories of channels, those of one kind and unit together."""
    panels = []
    for (family, unit), names in families(record, channels).items():
        shown = [values_for_people(one, record[one], unit) for one in names]
        marks = _histories(record.time, names, [values for values, _ in shown])
        thin = tuple(replace(mark, kind="line", width=0.7) for mark in marks)
        panels.append(Panel(labelled(family, shown[0][1]), thin, 72.0))
    return Drawing(name, title, f"{title}, {record.duration:g} s", tuple(panels), "time, s")


def draw_over_time(name: str, title: str, histories: Mapping[str, tuple[Real, Real]]) -> Drawing:
    """Draw times, s, and values by label with its unit, (n_time,) each, below each other."""
    panels = [
        Panel(label, (Mark("line", "identified", *one, width=0.8),), 62.0)
        for label, one in histories.items()
    ]
    return Drawing(name, title, "", tuple(panels), "time, s")


def families(record: FlightRecord, channels: Sequence[str]) -> dict[tuple[str, str], list[str]]:
    """Return channels by kind and unit; one in another unit than usual is a kind of its own."""

    def family(one: str) -> tuple[str, str]:
        standard = one in CHANNELS and CHANNELS[one].unit == record.unit(one)
        named = (name for some, name in _FAMILIES if standard and one in some)
        return next(named, one), record.unit(one)

    return grouped(channels, family)


def draw_compared(
    name: str, title: str, names: Sequence[str], flights: Mapping[str, FlightRecord | None]
) -> Drawing:
    """Draw channels of flights by label such as "before" and "designed"."""
    panels: list[Panel] = []
    for channel in names:
        marks, unit = [], ""
        for label, record in flights.items():
            if record is not None and channel in record:
                values, unit = values_for_people(channel, record[channel], record.unit(channel))
                ink: Ink = "grey" if label == "before" else "identified"
                word = "" if panels else label
                marks.append(Mark("line", ink, record.time, values, label=word, width=1.1))
        if marks:
            panels.append(Panel(labelled(channel, unit), tuple(marks), 62.0))
    return Drawing(
        name, title, f"{title}, flown on the nonlinear vehicle", tuple(panels), "time, s"
    )


def values_for_people(name: str, values: Real, unit: str) -> tuple[Real, str]:
    """Return values and their unit, rates and attitudes in degrees; (n_value,) each."""
    if name in (*RATES, *ATTITUDES) and unit.startswith("rad"):
        return np.rad2deg(values), unit.replace("rad", "deg")
    return values, "unitised" if unit == "1" and name in _UNITISED else unit


def labelled(name: str, unit: str) -> str:
    """Return the label of a channel's axis."""
    return name if unit in ("", "1") else f"{name}, {unit}"


def _histories(x: Real, names: Sequence[str], values: Sequence[Real] | Real) -> tuple[Mark, ...]:
    return tuple(
        Mark(("line", "dashes")[k % 2], _INKS[k % len(_INKS)], x, one, label=name)
        for k, (name, one) in enumerate(zip(names, values))
    )


def _estimate(
    data: FrequencyResponse, pair: tuple[int, int], values: Real, size: Callable[[Real], Real]
) -> list[Mark]:
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


def _differences(label: str, marks: Sequence[Mark], least: float) -> list[Panel]:
    model = next((mark for mark in marks if mark.ink == "identified"), None)
    if model is None or len(marks) == 1:
        return []
    apart, half = [], least
    for mark in marks:
        if mark.kind != "rings":  # too incoherent to set the scale
            base = np.interp(np.log(mark.x), np.log(model.x), model.y, np.nan, np.nan)
            top = None if mark.top is None else mark.top - base
            apart.append(replace(mark, y=mark.y - base, top=top, label=""))
            if top is None:
                half = max(half, 1.15 * np.nanmax(np.abs(apart[-1].y), initial=0.0))
    return [Panel(label, tuple(apart), 64.0, limits=(-half, half))]
