"""The figure of one response: data, models, what lies between them, and the coherence."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from helisim.base.units import decibel
from helisim.ident import USABLE_COHERENCE, FrequencyResponse
from helisim.show.bode import DEGREES, beside, decibels, phase_degrees, ratio_unit
from helisim.show.figure import Mark, Panel, extent, less
from helisim.show.mismatch import unnoticeable
from helisim.show.svg import Drawing

SURE = 2.0
"""Random errors that a bar reaches either way: the response is within in 95 of 100 cases."""
_POINTS = 60
"""Measured points in a figure at most, log-spaced: their bars stay apart, and neighbours between
them share their windows with those that are shown."""
_LEAST_DB, _LEAST_DEG = 2.5, 25.0
"""Half ranges of the panels of differences at least: what a pilot does not notice is in sight."""


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
        phases += _estimate(data, (o, i), phase, _turned)
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
        Panel(f"magnitude, dB ({ratio_unit(shown, output, input_)})", tuple(gains), 110.0),
        *_differences("magnitude less the identified, dB", gains, "db"),
        Panel("phase, deg", tuple(phases), 100.0, steps=DEGREES),
        *_differences("phase less the identified, deg", phases, "deg"),
    ]
    if data is not None:
        panels.append(_coherence(data, output, input_))
    return Drawing(
        name,
        f"{output} / {input_}",
        caption,
        tuple(panels),
        "frequency, rad/s",
        logarithmic=True,
        used=used,
    )


def spread_out(frequency: NDArray[np.float64], count: int = _POINTS) -> NDArray[np.intp]:
    """Return which of (n_freq,) frequencies are nearest to `count` log-spaced ones, each once."""
    if frequency.size <= count:
        return np.arange(frequency.size)
    place = np.log(frequency)
    wanted = np.linspace(place[0], place[-1], count)
    return np.unique(np.argmin(np.abs(place[:, None] - wanted), axis=0))


def _turned(ratio: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by how many degrees an error of this ratio less one turns a response, (n_freq,)."""
    return np.rad2deg(np.minimum(ratio - 1.0, np.pi))


def _estimate(
    data: FrequencyResponse,
    pair: tuple[int, int],
    values: NDArray[np.float64],
    size: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> list[Mark]:
    """Return an estimate as marks: bars and points where it is coherent, rings elsewhere."""
    at = spread_out(data.frequency)
    omega, values, good = data.frequency[at], values[at], data.usable()[pair][at]
    half = size(1.0 + SURE * data.random_error[pair][at])
    sure = (omega[good], values[good] - half[good], values[good] + half[good])
    bars = Mark("bars", "data", sure[0], sure[1], sure[2])
    dots = Mark("dots", "data", omega[good], values[good], label="flight data")
    if good.all():
        return [bars, dots]
    label = f"coherence < {USABLE_COHERENCE:g}"
    return [bars, dots, Mark("rings", "data", omega[~good], values[~good], label=label)]


def _differences(label: str, marks: Sequence[Mark], unit: str) -> list[Panel]:
    """Return a panel of what lies apart from the identified model; none without one, or alone.

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


def _coherence(data: FrequencyResponse, output: str, input_: str) -> Panel:
    o, i = data.index(output, input_)
    omega = data.frequency
    marks = (
        Mark("line", "data", omega, data.coherence[o, i], label="partial", width=1.5),
        Mark("dashes", "grey", omega, data.multiple_coherence[o], label="multiple"),
    )
    limits = (0.0, 1.04)
    return Panel("coherence", marks, 58.0, (0.5,), limits, threshold=USABLE_COHERENCE)
