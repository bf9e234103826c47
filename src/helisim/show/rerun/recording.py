"""Flight records, and what a run found, as a Rerun recording.

Each flight has its own root, named after it, and its own time from its first sample::

    shapes/visual_geometries/... of the fuselage, shared by all flights
    <flight>/world               axes north, east, down; ground and trail
    <flight>/world/helicopter    pose of the body (forward, right, down) over time
    <flight>/world/helicopter/rotor          turns, if the record tells the speed, and tilts with
                                             the tip-path plane, if the record has it
    <flight>/world/helicopter/rotor/visual_geometries/...
    <flight>/world/helicopter/rotor/thrust   arrow
    <flight>/world/helicopter/tail_rotor/visual_geometries/...
    <flight>/world/helicopter/tail_thrust, hub_moment       arrows
    <flight>/world/legend        what they mean
    <flight>/rates ...           one entity a group of signals, one series a channel
    <flight>/log                 what was flown when

Flights of the same event can stand side by side::

    side_by_side/<channel>/<flight>    one series a flight

A whole run has its models beside the flights::

    models/<model>/table         paper, truth, identified
    models/<model>/<output>_<input>/bode/...     plot; pointed at, it tells its values
    models/<model>/<output>_<input>/numbers
    models/<model>/time_<k>/inputs, <output>     a flight that verified it: measured, predicted
    models/log                   the experiment's steps, on the timeline `step`
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from helisim.base.errors import InputError
from helisim.base.files import atomic_write
from helisim.records import channels
from helisim.records.provenance import made_by
from helisim.records.record import FlightRecord
from helisim.show.rerun.layout import FlightViews, blueprint
from helisim.show.rerun.results import log_results, model_views
from helisim.show.rerun.scene import is_posed, knows_rotor, log_fuselage, log_space
from helisim.show.rerun.series import log_series
from helisim.show.rerun.shapes import Shapes, box_shapes, model_shapes
from helisim.show.rerun.side_by_side import compared, log_side_by_side, titles
from helisim.show.rerun.timelines import time_column
from helisim.study.run import Run
from helisim.vehicle.roles import Roles

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


_WHOLE = 100_000
"""Samples, all flights together, that are shown one by one: a dozen sweeps, 45 MB."""
_SPACE_HZ, _ARROW_HZ = 20.0, 10.0
"""Samples a second of longer recordings: of the helicopter in space, and of its arrows."""
_PLOT_HZ = {"sticks": 20.0, "rates": 20.0, "tilt": 20.0, "positions": 5.0}
"""Samples a second of their plots, by group. Sweeps end at 5 Hz."""
_OTHER_HZ = 10.0
"""Of groups that move slowly, or stand a tab behind."""


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
        run: what was found from the flights, to be shown beside them.
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
    beside = flights if side_by_side else {}
    layout = blueprint(
        [_views(name, record) for name, record in flights.items()],
        model_views(run) if run else (),
        titles(compared(beside)) if beside else None,
    )
    recorded = _recorded(flights, run, shapes, layout, beside, on_progress or (lambda _: None))
    with atomic_write(path) as temporary:
        temporary.write_bytes(recorded)
    return path


def _recorded(
    flights: Mapping[str, FlightRecord],
    run: Run | None,
    shapes: Shapes,
    layout: Blueprint,
    beside: Mapping[str, FlightRecord],
    on_progress: Callable[[str], None],
) -> bytes:
    """Return a recording, made in memory: when a disk is full, Rerun's own writer only logs it."""
    recording = rr.RecordingStream(APPLICATION, recording_id=_content_id(flights, run))
    try:
        memory = recording.memory_recording()
        recording.send_blueprint(layout, make_active=False, make_default=True)
        thin = sum(map(len, flights.values())) > _WHOLE
        made = json.dumps(made_by("recording"), sort_keys=True)
        shown = json.dumps(_shown(thin), sort_keys=True)
        recording.send_property("helisim", rr.AnyValues(provenance=made, shown=shown))
        if any(is_posed(record) for record in flights.values()):
            log_fuselage(recording, shapes)
        if run is not None:
            log_results(recording, run)
        if beside:
            log_side_by_side(recording, beside)
        for name, record in flights.items():
            _log_flight(recording, name, record, shapes, thin)
            on_progress(name)
        return memory.drain_as_bytes()
    finally:
        recording.disconnect()


def _shown(thin: bool) -> dict[str, str]:
    """Return what of the records is in a recording, for its properties."""
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


def _plotted(record: FlightRecord, group: str, names: Sequence[str]) -> FlightRecord:
    """Return the samples of a longer recording's plot: the ends alone of straight level lines."""
    values = record.select(names)
    if len(record) > 1 and np.array_equal(values, np.broadcast_to(values[0], values.shape)):
        return _sampled(record, np.array([0, len(record) - 1]))
    return _thinned(record, _PLOT_HZ.get(group, _OTHER_HZ))


def _sampled(record: FlightRecord, rows: NDArray[np.intp]) -> FlightRecord:
    """Return the samples of the given rows (n,)."""
    return FlightRecord(record.time[rows], record.values[rows], record.channels, record.provenance)


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


def _root(name: str) -> str:
    return rr.escape_entity_path_part(name)


def _groups(record: FlightRecord) -> dict[str, tuple[str, ...]]:
    """Return the groups that the record has channels of, with those channels."""
    grouped = {group: tuple(n for n in names if n in record) for group, names in GROUPS.items()}
    known = {name for names in GROUPS.values() for name in names}
    grouped["other"] = tuple(name for name in record.names if name not in known)
    return {group: names for group, names in grouped.items() if names}


def _views(name: str, record: FlightRecord) -> FlightViews:
    start = tuple(record.select(channels.POSITIONS)[0].tolist()) if is_posed(record) else None
    return FlightViews(
        name=name,
        root=_root(name),
        groups=tuple(_groups(record)),
        start=float(record.time[0]),
        stop=float(record.time[-1]),
        position=start,
        legend=is_posed(record) and knows_rotor(record),
    )


def _log_flight(
    recording: rr.RecordingStream, name: str, record: FlightRecord, shapes: Shapes, thin: bool
) -> None:
    root = _root(name)
    recording.send_property(
        name, rr.AnyValues(provenance=json.dumps(dict(record.provenance), sort_keys=True))
    )
    for group, names in _groups(record).items():
        labels = [f"{channel} [{record.unit(channel)}]" for channel in names]
        seen = _plotted(record, group, names) if thin else record
        log_series(recording, f"{root}/{group}", seen.time, seen.select(names), labels)
    _log_events(recording, root, record)
    if is_posed(record):
        seen = _thinned(record, _SPACE_HZ) if thin else record
        loads = _thinned(record, _ARROW_HZ) if thin else record
        log_space(recording, f"{root}/world", seen, shapes, loads)


def _log_events(recording: rr.RecordingStream, root: str, record: FlightRecord) -> None:
    """Log what was flown when, as far as the provenance tells."""
    phases = _phases(record.provenance.get("reached"))
    events = _events(record.provenance.get("excitation"), float(record.time[-1]))
    if phases:  # a mission's pilot isn't in a trimmed hover before and after a manoeuvre
        events = phases + [one for one in events if one[1].endswith("begins")]
    if not events:
        return
    times, texts = zip(*sorted(events))
    recording.send_columns(
        f"{root}/log",
        indexes=[time_column(np.array(times))],
        columns=rr.TextLog.columns(text=texts, level=["INFO"] * len(texts)),
    )


def _phases(reached: Any) -> list[tuple[float, str]]:
    """Return what a mission's script said, and when."""
    if not isinstance(reached, Mapping):
        return []
    return [(float(time), str(text)) for time, text in reached.get("phases", ())]


def _events(flown: Any, stop: float) -> list[tuple[float, str]]:
    try:
        kind, axis, trim = flown["kind"].lower(), flown["axis"], float(flown["trim_time"])
        lengths = {"sweep": stop - 2.0 * trim, "doublet": float(flown.get("width", 0.0))}
    except (KeyError, TypeError, ValueError, AttributeError):
        return []
    begins = [(0.0, "trimmed hover"), (trim, f"{axis} {kind} begins")]
    if kind not in lengths:  # whose end only its own class knows
        return begins
    return [*begins, (trim + lengths[kind], f"{axis} {kind} ends, trimmed hover")]
