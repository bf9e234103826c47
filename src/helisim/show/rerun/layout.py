"""How a recording looks when it is opened: what was found first, then one tab a flight."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from helisim.show.rerun.bode import bode_size
from helisim.show.rerun.scene import SHAPES, world_frame
from helisim.show.rerun.timelines import STEP, TIMELINE

_MOTION = ("sticks", "rates", "attitudes", "velocities", "tilt")
"""Groups beside the helicopter; the others are a tab behind."""
_EYE = (-1.9, -1.35, -0.75)
"""m from the helicopter to the eye: behind, to the left and above; north, east, down."""
_TRAIL_SECONDS = 15.0
_LEGEND_ROOM = 0.12
"""Of the flight, after its end: where the legends hide nothing."""
_DARK = (13, 16, 17)
"""Behind a Bode plot: as behind the viewer's own plots."""
_TABS = 8
"""More flights than this are gathered by the part of their name before the last `_`."""

_MEANINGS = {
    "sticks": "sticks (IN2)",
    "swashplate": "swashplate and tail (IN1)",
    "servos": "servos",
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


@dataclass(frozen=True)
class CheckViews:
    """What a flight that verified a model has to be looked at.

    Attributes:
        title: of the flight.
        root: its entity.
        plots: below the root, one above the other.
        start, stop: s.
    """

    title: str
    root: str
    plots: tuple[str, ...]
    start: float
    stop: float


@dataclass(frozen=True)
class ModelViews:
    """What an identified model has to be looked at.

    Attributes:
        name: of the model.
        pairs: title to the entity of a Bode plot.
        checks: flights that verified it.
    """

    name: str
    pairs: Mapping[str, str]
    checks: tuple[CheckViews, ...]


def blueprint(
    flights: Sequence[FlightViews],
    models: Sequence[ModelViews] = (),
    compared: Mapping[str, str] | None = None,
) -> rrb.Blueprint:
    """Return the layout of a recording.

    Args:
        flights: one tab each.
        models: one tab each, before the flights.
        compared: title to entity of a plot of all flights; with any, the first tab has the
            flights side by side.
    """
    tabs: list[rrb.Container | rrb.View] = []
    if compared:
        tabs.append(_side_by_side(flights, compared))
    if models:
        tabs.append(_findings(models))
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


def _side_by_side(flights: Sequence[FlightViews], compared: Mapping[str, str]) -> rrb.Container:
    start, stop = min(one.start for one in flights), max(one.stop for one in flights)
    plots = [_plot(entity, title, start, stop) for title, entity in compared.items()]
    spaces = [_space(one, one.name) for one in flights if one.position is not None]
    signals = rrb.Grid(*plots, grid_columns=(len(plots) + 1) // 2)
    if not spaces:
        return rrb.Vertical(signals, name="side by side")
    return rrb.Vertical(rrb.Horizontal(*spaces), signals, row_shares=[1, 1], name="side by side")


def _findings(models: Sequence[ModelViews]) -> rrb.Container:
    return rrb.Horizontal(
        rrb.Vertical(
            rrb.TextDocumentView(origin="models/table", name="paper, truth, identified"),
            _log("models/log", "steps", STEP),
            row_shares=[3, 1],
        ),
        rrb.Tabs(*(_model(model) for model in models), active_tab=0),
        column_shares=[2, 3],
        name="results",
    )


def _model(model: ModelViews) -> rrb.Container:
    """Return a model's tab: its Bode plots, and behind them what it predicted, if anything."""
    size = bode_size(len(model.pairs))
    plots = [_bode(title, entity, size) for title, entity in model.pairs.items()]
    if not model.checks:
        return rrb.Grid(*plots, name=model.name)
    checks = [
        rrb.Vertical(
            *(
                _plot(f"{check.root}/{plot}", f"{check.title}: {plot}", check.start, check.stop)
                for plot in check.plots
            ),
            name=check.title,
        )
        for check in model.checks
    ]
    return rrb.Tabs(
        rrb.Grid(*plots, name="frequency responses"),
        rrb.Horizontal(*checks, name="flights predicted"),
        active_tab=0,
        name=model.name,
    )


def _bode(title: str, entity: str, size: tuple[float, float]) -> rrb.View:
    return rrb.Spatial2DView(
        origin=entity,
        name=title,
        background=rrb.Background(color=_DARK),
        visual_bounds=rrb.VisualBounds2D(x_range=[0.0, size[0]], y_range=[0.0, size[1]]),
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
    name = _MEANINGS.get(group, group)
    return _plot(f"{flight.root}/{group}", name, flight.start, flight.stop)


def _plot(entity: str, name: str, start: float, stop: float) -> rrb.View:
    """Return a plot over a whole flight, start to stop in s, with room for its legend."""
    end = stop + _LEGEND_ROOM * (stop - start)
    return rrb.TimeSeriesView(
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        origin=entity,
        name=name,
        axis_x=rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.absolute(seconds=start),
                end=rr.TimeRangeBoundary.absolute(seconds=end),
            )
        ),
    )


def _space(flight: FlightViews, name: str = "space") -> rrb.View:
    position = flight.position or (0.0, 0.0, 0.0)
    trail = rrb.VisibleTimeRange(
        TIMELINE,
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-_TRAIL_SECONDS),
        end=rr.TimeRangeBoundary.cursor_relative(seconds=0.0),
    )
    return rrb.Spatial3DView(
        origin=f"{flight.root}/world",
        contents=[f"/{flight.root}/world/**", f"/{SHAPES}/**"],
        spatial_information=rrb.SpatialInformation(
            target_frame=world_frame(f"{flight.root}/world")
        ),
        name=name,
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
