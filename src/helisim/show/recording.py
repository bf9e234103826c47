"""Flight records, and the findings of a run, as a Rerun recording.

Each flight has its own root, named after it, and its own time from its first sample::

    shapes/visual_geometries/... of the fuselage, shared by all flights
    <flight>/world               axes north, east, down; ground and trail
    <flight>/world/helicopter    pose of the body (forward, right, down) over time
    <flight>/world/helicopter/rotor          turns, if the record tells the speed, and tilts with
                                             the tip-path plane, if the record has it
    <flight>/world/helicopter/rotor/thrust   arrow
    <flight>/world/helicopter/tail_thrust, hub_moment       arrows
    <flight>/world/legend        their meaning
    <flight>/rates ...           one entity a group of signals, one series a channel
    <flight>/log                 the manoeuvre's and the mission's events

Flights of the same event can stand side by side::

    side_by_side/<channel>/<flight>    one series a flight

A whole run has its models beside the flights::

    models/table                 paper, truth, identified
    models/<model>/<output>_<input>/bode         Bode plot, a picture: Rerun has no logarithmic axes
    models/<model>/<output>_<input>/numbers      of the plot
    models/<model>/time_<k>/inputs, <output>     a flight that verified it: measured, predicted
    models/log                   the experiment's steps, on the timeline `step`
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint.encodings import TextLogColumn, TextLogColumnKind, TimelineColumn

from helisim.base.errors import InputError
from helisim.base.files import atomic_write
from helisim.records import record as channels
from helisim.records.record import FlightRecord, made_by
from helisim.show import tables
from helisim.show.canvas import to_png
from helisim.show.plots import draw_pair, pairs_of
from helisim.show.scene import (
    SHAPES,
    TIMELINE,
    Shapes,
    box_shapes,
    is_posed,
    knows_rotor,
    log_fuselage,
    log_series,
    log_space,
    model_shapes,
    time_column,
    world_frame,
)
from helisim.show.table import as_markdown
from helisim.study.results import IdentifiedModel, Run
from helisim.vehicle.folder import Roles

APPLICATION = "helisim"

GROUPS: dict[str, tuple[str, ...]] = {
    "sticks": channels.IN2,
    "swashplate": channels.IN1,
    "servos": (*channels.SERVOS, *channels.SERVO_POSITIONS),
    "rates": channels.RATES,
    "attitudes": channels.ATTITUDES,
    "velocities": channels.VELOCITIES,
    "accelerations": channels.ACCELERATIONS,
    "positions": channels.POSITIONS,
    "rotor_speed": channels.ROTOR_SPEED,
    "tilt": channels.ROTOR[:2],
    "loads": channels.ROTOR[2:],
}
"""Entity to channels. Channels in no group go to the entity `other`."""

_NAMES = {
    "sticks": "sticks (IN2)",
    "swashplate": "swashplate and tail (IN1)",
    "accelerations": "specific forces",
    "positions": "position",
    "tilt": "tilt of the rotor disc",
    "loads": "rotor loads",
}
_MOTION = ("sticks", "rates", "attitudes", "velocities", "tilt")
"""Groups beside the helicopter; the others are a tab behind."""
_COMPARED = {
    "phi": "roll angle",
    "theta": "pitch angle",
    "psi": "heading",
    "lon": "longitudinal command",
    "lat": "lateral command",
    "ped": "tail command",
}
"""Channels that a disturbance moves, and the commands that reject it, side by side."""
_INKS = ((255, 152, 56), (72, 166, 255), (94, 210, 160), (190, 140, 230))
_FLIGHT, _MODEL, _INPUTS = (176, 184, 196), (72, 166, 255), ((94, 210, 160), (255, 152, 56))
_STEP = "step"
"""The timeline of the experiment's log: steps have an order, and no common clock."""

_WHOLE = 100_000
"""Samples, all flights together, that are shown one by one: a dozen sweeps, 45 MB."""
_SPACE_HZ, _ARROW_HZ = 20.0, 10.0
"""Samples a second of longer recordings: of the helicopter in space, and of its arrows."""
_PLOT_HZ = {"sticks": 20.0, "rates": 20.0, "tilt": 20.0, "positions": 5.0}
"""Samples a second of their plots, by group. Sweeps end at 5 Hz."""
_OTHER_HZ = 10.0
"""Samples a second of groups that move slowly, or stand a tab behind."""
_EYE = (-1.9, -1.35, -0.75)
"""m from the helicopter to the eye: behind, to the left and above; north, east, down."""
_TRAIL_SECONDS = 15.0
_LEGEND_SHARE = 0.12
"""Share of the flight, after its end, where the legends hide nothing."""
_TABS = 8
"""More flights than this are gathered by the part of their name before the last `_`."""


def write_recording(
    path: str | Path,
    flights: Mapping[str, FlightRecord],
    *,
    model: mujoco.MjModel | None = None,
    roles: Roles | None = None,
    run: Run | None = None,
    side_by_side: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> Path:
    """Write flights to a Rerun recording (.rrd) and return its path.

    A flight without attitude or position has its signals only; one without the rotor's true
    tilt and loads has a rotor that doesn't tilt and no arrows. The file appears complete or
    not at all.

    Args:
        path: file to write, with the suffix .rrd.
        flights: records by name.
        model: its first free body, with all that it carries, gives the helicopter's shape;
            None draws a few boxes.
        roles: names of its rotors in the model, `Vehicle.roles`; the usual ones if None.
        run: findings from the flights, to be shown beside them.
        side_by_side: open with a view of each flight beside the others', and their angles and
            commands in common plots; for flights of the same event.
        on_progress: called with a flight's name after each flight.

    Raises:
        InputError: no flights, a suffix other than .rrd, or a model without a free body.
        StorageError: the file can't be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".rrd":
        raise InputError(f"{path}: a Rerun recording needs the suffix .rrd, got {path.suffix!r}")
    if not flights:
        raise InputError("a recording needs at least one flight, got none")
    shapes = box_shapes() if model is None else model_shapes(model, roles)
    beside = [
        name for name in _COMPARED if side_by_side and all(name in one for one in flights.values())
    ]
    recording = rr.RecordingStream(APPLICATION, recording_id=_content_id(flights, run))
    try:
        # in memory: when a disk is full, Rerun's own writer only logs it
        memory = recording.memory_recording()
        layout = _blueprint(flights, run, beside)
        recording.send_blueprint(layout, make_active=False, make_default=True)
        thin = sum(map(len, flights.values())) > _WHOLE
        made = json.dumps(made_by("recording"), sort_keys=True)
        shown = json.dumps(_shown(thin), sort_keys=True)
        recording.send_property("helisim", rr.AnyValues(provenance=made, shown=shown))
        if any(is_posed(record) for record in flights.values()):
            log_fuselage(recording, shapes)
        if run is not None:
            _log_run(recording, run)
        for channel in beside:
            for k, (name, record) in enumerate(flights.items()):
                entity = f"side_by_side/{channel}/{rr.escape_entity_path_part(name)}"
                label, ink = f"{name} [{record.unit(channel)}]", _INKS[k % len(_INKS)]
                values = record.select((channel,))
                log_series(recording, entity, record.time, values, [label], [ink])
        for name, record in flights.items():
            _log_flight(recording, name, record, shapes, thin)
            if on_progress is not None:
                on_progress(name)
        recorded = memory.drain_as_bytes()
    finally:
        recording.disconnect()
    with atomic_write(path) as temporary:
        temporary.write_bytes(recorded)
    return path


def _shown(thin: bool) -> dict[str, str]:
    """Return how much of the records is in a recording, for its properties."""
    if not thin:
        return {"samples": "all", "precision": "single"}
    plots = "".join(f"{rate:g} in plots of {group}, " for group, rate in _PLOT_HZ.items())
    return {
        "samples": f"thinned, to at least {_SPACE_HZ:g} a second in space, {_ARROW_HZ:g} in "
        f"arrows, {plots}{_OTHER_HZ:g} in the others; first and last alone in plots where "
        "nothing changes; the records have all",
        "precision": "single",
    }


def _thinned(record: FlightRecord, rate: float) -> FlightRecord:
    """Return the first sample of each few, as few as keep a number of samples a second."""
    step = float(np.median(np.diff(record.time))) if len(record) > 1 else 1.0 / rate
    every = max(1, int(1.0 / (rate * step) + 1e-6))
    return _sampled(record, np.arange(0, len(record), every))


def _sampled(record: FlightRecord, rows: NDArray[np.intp]) -> FlightRecord:
    return FlightRecord(record.time[rows], record.values[rows], record.channels, record.provenance)


def _plotted(record: FlightRecord, group: str, names: Sequence[str]) -> FlightRecord:
    """Return the samples of a longer recording's plot: the ends alone of straight level lines."""
    values = record.select(names)
    if len(record) > 1 and np.array_equal(values, np.broadcast_to(values[0], values.shape)):
        return _sampled(record, np.array([0, len(record) - 1]))
    return _thinned(record, _PLOT_HZ.get(group, _OTHER_HZ))


def _content_id(flights: Mapping[str, FlightRecord], run: Run | None) -> str:
    """Name the recording by its contents: the same flights open as the same recording."""
    digest = hashlib.sha256()
    for name, record in flights.items():
        digest.update(repr((name, record.names, dict(record.provenance))).encode())
        digest.update(record.time.tobytes())
        digest.update(record.values.tobytes())
    if run is not None:
        digest.update(json.dumps(run.results.to_dict(), sort_keys=True).encode())
    return digest.hexdigest()[:32]


def _groups(record: FlightRecord) -> dict[str, tuple[str, ...]]:
    """Return the groups that the record has channels of, with those channels."""
    grouped = {group: tuple(n for n in names if n in record) for group, names in GROUPS.items()}
    known = {name for names in GROUPS.values() for name in names}
    grouped["other"] = tuple(name for name in record.names if name not in known)
    return {group: names for group, names in grouped.items() if names}


def _log_flight(
    recording: rr.RecordingStream, name: str, record: FlightRecord, shapes: Shapes, thin: bool
) -> None:
    root = rr.escape_entity_path_part(name)
    provenance = json.dumps(dict(record.provenance), sort_keys=True)
    recording.send_property(name, rr.AnyValues(provenance=provenance))
    for group, names in _groups(record).items():
        labels = [f"{channel} [{record.unit(channel)}]" for channel in names]
        seen = _plotted(record, group, names) if thin else record
        log_series(recording, f"{root}/{group}", seen.time, seen.select(names), labels)
    if events := _events(record):
        times, texts = zip(*sorted(events))
        recording.send_columns(
            f"{root}/log",
            indexes=[time_column(np.array(times))],
            columns=rr.TextLog.columns(text=texts, level=["INFO"] * len(texts)),
        )
    if is_posed(record):
        seen = _thinned(record, _SPACE_HZ) if thin else record
        loads = _thinned(record, _ARROW_HZ) if thin else record
        log_space(recording, f"{root}/world", seen, shapes, loads)


def _events(record: FlightRecord) -> list[tuple[float, str]]:
    """Return the events of a mission and a manoeuvre, as far as the provenance tells."""
    reached, flown = (record.provenance.get(name) for name in ("reached", "excitation"))
    phases = reached.get("phases", ()) if isinstance(reached, Mapping) else ()
    told = [(float(time), str(text)) for time, text in phases]
    events: list[tuple[float, str]] = []
    try:
        given: Any = flown
        kind, axis, trim = given["kind"].lower(), given["axis"], float(given["trim_time"])
        stop = float(record.time[-1])
        lengths = {"sweep": stop - 2.0 * trim, "doublet": float(given.get("width", 0.0))}
        events = [(0.0, "trimmed hover"), (trim, f"{axis} {kind} begins")]
        if kind in lengths:  # the end of others is known to their own class alone
            events.append((trim + lengths[kind], f"{axis} {kind} ends, trimmed hover"))
    except (KeyError, TypeError, ValueError, AttributeError):
        pass
    if told:  # a mission's pilot isn't in a trimmed hover before and after a manoeuvre
        events = told + [one for one in events if one[1].endswith("begins")]
    return events


def _log_run(recording: rr.RecordingStream, run: Run) -> None:
    """Log all findings below the entity `models`."""
    results = json.dumps(run.results.to_dict(), sort_keys=True)
    recording.send_property("run", rr.AnyValues(results=results))
    for item in run.models:
        _log_pairs(recording, item)
        _log_verification(recording, item)
    parts = []
    for table in map(tables.comparison, run.results.tables):
        notes = [f"{label}: {text}." if label else f"{text}." for label, text in table.notes]
        parts += [f"## {table.title}", f"{table.lead}.", "", as_markdown(table), "", *notes, ""]
    text = rr.TextDocument("\n".join(parts), media_type="text/markdown")
    recording.log("models/table", text, static=True)
    steps = list(_steps(run))
    recording.send_columns(
        "models/log",
        indexes=[
            rr.TimeColumn(_STEP, sequence=range(len(steps))),
            time_column(np.zeros(len(steps))),  # the flights' clock too, or the viewer shows none
        ],
        columns=rr.TextLog.columns(text=steps, level=["INFO"] * len(steps)),
    )


def _steps(run: Run) -> Iterator[str]:
    given = run.configuration
    yield f"vehicle loaded and trimmed, seed {run.results.seed}"
    yield f"flown: {given.flown_each_axis} sweeps on each axis, {given.flights_kept_each_axis} kept"
    for one in run.results.excluded:
        yield f"left out: {one.message}"
    for table in run.results.tables:
        good = sum(row.agreement == "agrees" for row in table.parameters)
        yield (
            f"identified: {table.name} from {table.input}, cost {table.cost:.3g}, "
            f"{good} of {len(table.parameters)} parameters agree"
        )
    for name, figures in run.results.verification.items():
        yield f"verified: {name}, TIC {figures.tic:.3g}, {figures.approach}"
    for sentence in run.results.misses:
        yield f"missed: {sentence}"


def _log_pairs(recording: rr.RecordingStream, item: IdentifiedModel) -> None:
    """Log the Bode plot of each pair of a model, and its numbers, real and imaginary apart."""
    data, model = item.fit.data, item.fit.response(item.fit.data.frequency)
    for output, input_ in pairs_of(item.fit):
        entity, pair = f"models/{item.name}/{output}_{input_}", data.index(output, input_)
        picture = rr.EncodedImage(
            contents=to_png(draw_pair(item, output, input_)), media_type="image/png"
        )
        recording.log(f"{entity}/bode", picture, static=True)
        found, line = data.response[pair], model.response[model.index(output, input_)]
        numbers = {
            "frequency_rad_s": data.frequency,
            "data_real": found.real,
            "data_imag": found.imag,
            "coherence": data.coherence[pair],
            "random_error": data.random_error[pair],
            "identified_real": line.real,
            "identified_imag": line.imag,
        }
        if item.exact is not None:
            exact = item.exact.response[item.exact.index(output, input_)]
            numbers |= {
                "truth_frequency_rad_s": item.exact.frequency,
                "truth_real": exact.real,
                "truth_imag": exact.imag,
            }
        values = rr.AnyValues(drop_untyped_nones=True, **numbers)
        recording.log(f"{entity}/numbers", values, static=True)


def _log_verification(recording: rr.RecordingStream, item: IdentifiedModel) -> None:
    """Log the flights that verified a model as time series: inputs, measured, predicted."""
    checked = item.verification
    for k, trace in enumerate(checked.traces if checked else ()):
        entity, names = f"models/{item.name}/time_{k + 1}", item.fit.structure.inputs
        log_series(recording, f"{entity}/inputs", trace.time, trace.inputs, names, _INPUTS)
        for j, (output, unit) in enumerate(zip(checked.outputs, checked.units) if checked else ()):
            both = np.column_stack([trace.measured[:, j], trace.predicted[:, j]])
            labels = [f"{output}, {which} [{unit}]" for which in ("flight", "identified model")]
            part = f"{entity}/{output}"
            log_series(recording, part, trace.time, both, labels, (_FLIGHT, _MODEL))


View = rrb.Container | rrb.View


@dataclass(frozen=True)
class _Views:
    """The views of a flight: its root entity, groups of signals, ends, s, and first place, m."""

    name: str
    record: FlightRecord

    @property
    def root(self) -> str:
        return rr.escape_entity_path_part(self.name)

    @property
    def ends(self) -> tuple[float, float]:
        return float(self.record.time[0]), float(self.record.time[-1])

    def tab(self) -> View:
        """Return the flight's tab: space and log on the left, signals on the right."""
        groups = tuple(_groups(self.record))
        sides = (
            ("motion", [one for one in groups if one in _MOTION]),
            ("more", [one for one in groups if one not in _MOTION]),
        )
        stacks = [
            rrb.Vertical(
                *(_plot(f"{self.root}/{one}", self._title(one), *self.ends) for one in some),
                name=name,
            )
            for name, some in sides
            if some
        ]
        signals = rrb.Tabs(*stacks, active_tab=0) if len(stacks) > 1 else stacks[0]
        if not is_posed(self.record):
            return rrb.Horizontal(signals, name=self.name)
        below: View = _log(f"{self.root}/log", "log", TIMELINE)
        if knows_rotor(self.record):
            legend = rrb.TextDocumentView(origin=f"{self.root}/world/legend", name="legend")
            below = rrb.Horizontal(below, legend, column_shares=[3, 4])
        left = rrb.Vertical(self.space("space"), below, row_shares=[9, 2])
        return rrb.Horizontal(left, signals, column_shares=[1, 1], name=self.name)

    def space(self, name: str) -> View:
        """Return the view of the helicopter in space, which follows it."""
        world = f"{self.root}/world"
        place = tuple(self.record.select(channels.POSITIONS)[0].tolist())
        trail = rrb.VisibleTimeRange(
            TIMELINE,
            start=rr.TimeRangeBoundary.cursor_relative(seconds=-_TRAIL_SECONDS),
            end=rr.TimeRangeBoundary.cursor_relative(seconds=0.0),
        )
        return rrb.Spatial3DView(
            origin=world,
            contents=[f"/{world}/**", f"/{SHAPES}/**"],
            spatial_information=rrb.SpatialInformation(target_frame=world_frame(world)),
            name=name,
            background=rrb.Background(color=(150, 178, 205)),
            line_grid=rrb.LineGrid3D(visible=False),
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital,
                position=[start + step for start, step in zip(place, _EYE)],
                look_target=place,
                eye_up=(0.0, 0.0, -1.0),
                tracking_entity=f"{world}/helicopter",
            ),
            overrides={f"{world}/trail": rrb.VisibleTimeRanges(trail)},
        )

    def _title(self, group: str) -> str:
        return _NAMES.get(group, group)


def _blueprint(
    flights: Mapping[str, FlightRecord], run: Run | None, beside: Sequence[str]
) -> rrb.Blueprint:
    """Return the layout: flights side by side, the findings, then a tab for each flight."""
    views = [_Views(name, record) for name, record in flights.items()]
    tabs: list[View] = []
    if beside:
        start, stop = min(one.ends[0] for one in views), max(one.ends[1] for one in views)
        plots = [_plot(f"side_by_side/{one}", _COMPARED[one], start, stop) for one in beside]
        signals = rrb.Grid(*plots, grid_columns=(len(plots) + 1) // 2)
        spaces = [one.space(one.name) for one in views if is_posed(one.record)]
        rows = [rrb.Horizontal(*spaces), signals] if spaces else [signals]
        tabs.append(rrb.Vertical(*rows, row_shares=[1] * len(rows), name="side by side"))
    if run is not None and run.models:
        table = rrb.TextDocumentView(origin="models/table", name="paper, truth, identified")
        left = rrb.Vertical(table, _log("models/log", "steps", _STEP), row_shares=[3, 1])
        right = rrb.Tabs(*map(_model_tab, run.models), active_tab=0)
        tabs.append(rrb.Horizontal(left, right, column_shares=[2, 3], name="results"))
    if len(views) <= _TABS:
        tabs += [one.tab() for one in views]
    else:
        families: dict[str, list[View]] = {}
        for one in views:
            families.setdefault(one.name.rpartition("_")[0] or one.name, []).append(one.tab())
        tabs += [rrb.Tabs(*members, name=family) for family, members in families.items()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )


def _model_tab(item: IdentifiedModel) -> View:
    """Return a model's tab: its Bode plots, and behind them its predictions, if any."""
    root, checked = f"models/{item.name}", item.verification
    plots = [
        rrb.Spatial2DView(origin=f"{root}/{output}_{input_}/bode", name=f"{output} / {input_}")
        for output, input_ in pairs_of(item.fit)
    ]
    if checked is None:
        return rrb.Grid(*plots, name=item.name)
    names = item.verified_on or [f"flight {k + 1}" for k in range(len(checked.traces))]
    checks = []
    for k, (name, trace) in enumerate(zip(names, checked.traces)):
        title, ends = f"{name}, predicted", (float(trace.time[0]), float(trace.time[-1]))
        shown = [
            _plot(f"{root}/time_{k + 1}/{plot}", f"{title}: {plot}", *ends)
            for plot in ("inputs", *checked.outputs)
        ]
        checks.append(rrb.Vertical(*shown, name=title))
    responses = rrb.Grid(*plots, name="frequency responses")
    predicted = rrb.Horizontal(*checks, name="flights predicted")
    return rrb.Tabs(responses, predicted, active_tab=0, name=item.name)


def _log(entity: str, name: str, timeline: str) -> View:
    columns = rrb.TextLogColumns(
        timeline_columns=[TimelineColumn(timeline)],
        text_log_columns=[TextLogColumn(TextLogColumnKind.Body)],
    )
    return rrb.TextLogView(origin=entity, name=name, columns=columns)


def _plot(entity: str, name: str, start: float, stop: float) -> View:
    """Return a plot over a whole flight, start to stop in s, with space for its legend."""
    end = stop + _LEGEND_SHARE * (stop - start)
    whole = rr.TimeRange(
        start=rr.TimeRangeBoundary.absolute(seconds=start),
        end=rr.TimeRangeBoundary.absolute(seconds=end),
    )
    return rrb.TimeSeriesView(
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),
        origin=entity,
        name=name,
        axis_x=rrb.TimeAxis(view_range=whole),
    )
