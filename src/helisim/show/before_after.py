"""Flights of one event with two laws: the same step of a stick, the same gust."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from helisim.handling.axis import BY_NAME, axis_of
from helisim.records.record import FlightRecord
from helisim.show.figure import Ink, Mark, Panel
from helisim.show.plots import labelled, values_for_people
from helisim.show.svg import Drawing


def draw_step(axis: str, before: FlightRecord | None, after: FlightRecord) -> Drawing:
    """Draw what a step of a stick does: stick, angle or velocity, rate, command."""
    one = axis_of(axis)
    names = [one.stick, one.angle, *([one.rate] if one.rate else []), one.name]
    title = f"Step of the {one.word} stick"
    return _drawn(f"step_{one.name}", title, names, before, after)


def draw_gust(before: FlightRecord | None, after: FlightRecord) -> Drawing:
    """Draw what a gust does: attitudes, rates of roll and pitch, and commands."""
    axes = [one for one in BY_NAME.values() if one.rate is not None]
    names = [one.angle for one in axes] + [one.name for one in axes]
    return _drawn("gust", "Through a gust, sticks left alone", names, before, after)


def _drawn(
    name: str,
    title: str,
    names: Sequence[str],
    before: FlightRecord | None,
    after: FlightRecord,
) -> Drawing:
    panels = []
    flights: tuple[tuple[str, Ink, FlightRecord | None], ...] = (
        ("before", "grey", before),
        ("designed", "identified", after),
    )
    for channel in names:
        marks = []
        unit = after.unit(channel)
        for label, ink, record in flights:
            if record is not None and channel in record:
                values, unit = values_for_people(channel, record[channel], record.unit(channel))
                marks.append(Mark("line", ink, record.time, values, width=1.1))
                if not panels:
                    marks[-1] = replace(marks[-1], label=label)
        if marks:
            panels.append(Panel(labelled(channel, unit), tuple(marks), 62.0))
    time = np.ptp(after.time)
    caption = f"{title}, flown on the nonlinear vehicle, {time:.3g} s"
    return Drawing(name, title, caption, tuple(panels), "time, s")
