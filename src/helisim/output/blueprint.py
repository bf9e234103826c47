"""How a recording looks when it is opened: what was found first, then one tab a flight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

TIMELINE = "time"

_MOTION = ("sticks", "rates", "attitudes", "velocities", "tilt")
"""Groups beside the helicopter; the others are a tab behind."""
_EYE = (-2.6, -1.7, -1.1)
"""m from the helicopter to the eye: behind, to the left and above; north, east, down."""
_TRAIL_SECONDS = 15.0
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
        legend: what is seen in space.
    """

    name: str
    root: str
    groups: tuple[str, ...]
    start: float
    stop: float
    position: tuple[float, ...] | None
    legend: str


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
            rrb.TextLogView(origin="models/log", name="steps"),
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
    left = rrb.Vertical(
        _space(flight),
        rrb.TextLogView(origin=f"{flight.root}/log", name="log"),
        row_shares=[5, 1],
    )
    return rrb.Horizontal(left, signals, column_shares=[1, 1], name=flight.name)


def _signals(flight: FlightViews, group: str) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=f"{flight.root}/{group}",
        name=_MEANINGS.get(group, group),
        axis_x=rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.absolute(seconds=flight.start),
                end=rr.TimeRangeBoundary.absolute(seconds=flight.stop),
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
        name=flight.legend,
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
