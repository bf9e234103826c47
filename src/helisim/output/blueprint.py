"""How a recording looks when it is opened: what was found first, then one tab a flight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from helisim.output.timelines import STEP, TIMELINE

_MOTION = ("sticks", "rates", "attitudes", "velocities", "tilt")
"""Groups beside the helicopter; the others are a tab behind."""
_EYE = (-1.9, -1.35, -0.75)
"""m from the helicopter to the eye: behind, to the left and above; north, east, down."""
_TRAIL_SECONDS = 15.0
_LEGEND_ROOM = 0.12
"""Of the flight, after its end: where the legends hide nothing."""
_TABS = 8
"""More flights than this are gathered by the part of their name before the last `_`."""

_MEANINGS = {
    "sticks": "sticks (IN2)",
    "swashplate": "swashplate and tail (IN1)",
    "servos": "servo commands",
    "rates": "rates",
    "attitudes": "attitudes",
    "velocities": "velocities",
    "accelerations": "specific forces",
    "positions": "position",
    "tilt": "tilt of the rotor disc",
    "loads": "rotor loads",
}


@dataclass(frozen=True)
class FlightViews:
    """What a flight has to be looked at.

    Attributes:
        name: of the flight.
        root: its entity.
        groups: its groups of signals.
        start, stop: s.
        position: north, east, down of the first sample, m; None without a pose.
        legend: whether its world has a legend.
    """

    name: str
    root: str
    groups: tuple[str, ...]
    start: float
    stop: float
    position: tuple[float, ...] | None
    legend: bool


def blueprint(
    flights: Sequence[FlightViews], figures: Mapping[str, Sequence[str]]
) -> rrb.Blueprint:
    """Return the layout of a recording.

    Args:
        flights: one tab each.
        figures: entities of each model's pictures; empty for flights alone.
    """
    tabs: list[rrb.Container | rrb.View] = []
    if figures:
        tabs.append(_findings(figures))
    made = [(flight.name, _flight(flight)) for flight in flights]
    if len(made) <= _TABS:
        tabs += [tab for _, tab in made]
    else:
        families: dict[str, list[rrb.Container | rrb.View]] = {}
        for name, tab in made:
            families.setdefault(name.rpartition("_")[0] or name, []).append(tab)
        tabs += [rrb.Tabs(*members, name=family) for family, members in families.items()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )


def _findings(figures: Mapping[str, Sequence[str]]) -> rrb.Container:
    models = [
        rrb.Grid(
            *(
                rrb.Spatial2DView(origin=entity, name="/".join(entity.split("/")[2:-1]))
                for entity in entities
            ),
            name=model,
        )
        for model, entities in figures.items()
    ]
    return rrb.Horizontal(
        rrb.Vertical(
            rrb.TextDocumentView(origin="models/table", name="paper, truth, identified"),
            _log("models/log", "steps", STEP),
            row_shares=[3, 1],
        ),
        rrb.Tabs(*models),
        column_shares=[2, 3],
        name="results",
    )


def _flight(flight: FlightViews) -> rrb.Container:
    first = [group for group in flight.groups if group in _MOTION]
    rest = [group for group in flight.groups if group not in _MOTION]
    stacks = [
        rrb.Vertical(*(_signals(flight, group) for group in groups), name=name)
        for name, groups in (("motion", first), ("more", rest))
        if groups
    ]
    signals = rrb.Tabs(*stacks, active_tab=0) if len(stacks) > 1 else stacks[0]
    if flight.position is None:
        return rrb.Horizontal(signals, name=flight.name)
    below: rrb.Container | rrb.View = _log(f"{flight.root}/log", "log", TIMELINE)
    if flight.legend:
        legend = rrb.TextDocumentView(origin=f"{flight.root}/world/legend", name="legend")
        below = rrb.Horizontal(below, legend, column_shares=[3, 4])
    left = rrb.Vertical(_space(flight), below, row_shares=[9, 2])
    return rrb.Horizontal(left, signals, column_shares=[1, 1], name=flight.name)


def _log(entity: str, name: str, timeline: str) -> rrb.View:
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn(timeline)],
        text_log_columns=[TextLogColumn(TextLogColumnKind.Body)],
    )
    return rrb.TextLogView(origin=entity, name=name, columns=columns)


def _signals(flight: FlightViews, group: str) -> rrb.View:
    end = flight.stop + _LEGEND_ROOM * (flight.stop - flight.start)
    return rrb.TimeSeriesView(
        origin=f"{flight.root}/{group}",
        name=_MEANINGS.get(group, group),
        axis_x=rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.absolute(seconds=flight.start),
                end=rr.TimeRangeBoundary.absolute(seconds=end),
            )
        ),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
    )


def _space(flight: FlightViews) -> rrb.View:
    position = flight.position or (0.0, 0.0, 0.0)
    trail = rrb.VisibleTimeRange(
        TIMELINE,
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-_TRAIL_SECONDS),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
    return rrb.Spatial3DView(
        origin=f"{flight.root}/world",
        name="space",
        background=rrb.Background(color=(150, 178, 205)),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=[place + step for place, step in zip(position, _EYE)],
            look_target=position,
            eye_up=(0.0, 0.0, -1.0),
            tracking_entity=f"{flight.root}/world/helicopter",
        ),
        overrides={f"{flight.root}/world/trail": rrb.VisibleTimeRanges(trail)},
    )
