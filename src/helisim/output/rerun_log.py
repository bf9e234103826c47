"""Flight records, and what a run found, as a Rerun recording.

Each flight has its own root, named after it, and its own time from its first sample::

    <flight>/world               axes north, east, down; ground and trail
    <flight>/world/helicopter    pose of the body (forward, right, down) over time
    <flight>/world/helicopter/visual_geometries/...
    <flight>/world/helicopter/rotor          tilts with the tip-path plane, if the record has it
    <flight>/world/helicopter/rotor/thrust   arrow
    <flight>/world/helicopter/hub_moment     arrow
    <flight>/rates ...           one entity a group of signals, one series a channel
    <flight>/log                 what was flown when

A whole run has its models beside the flights::

    models/<model>/table         paper, truth, identified
    models/<model>/<output>_<input>/figure, numbers
    models/<model>/time_<k>      verification: figure
    models/log                   the experiment's steps, on the timeline `step`
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.channels import (
    ACCELERATIONS,
    ATTITUDES,
    IN1,
    IN2,
    POSITIONS,
    RATES,
    ROTOR,
    SERVOS,
    VELOCITIES,
)
from helisim.errors import InputError
from helisim.ident import Fit, FrequencyResponse
from helisim.output.blueprint import TIMELINE, FlightViews, blueprint
from helisim.output.drawings import bode_drawings, verification_drawings
from helisim.output.run import Run
from helisim.output.shapes import Shapes, box_shapes, model_shapes
from helisim.output.tables import cells
from helisim.record import FlightRecord
from helisim.storage import atomic_write

APPLICATION = "helisim"
STEP = "step"
"""Timeline of the experiment's log: steps have an order, and no common clock."""

TILT = ROTOR[:2]

GROUPS: dict[str, tuple[str, ...]] = {
    "sticks": IN2,
    "swashplate": IN1,
    "servos": SERVOS,
    "rates": RATES,
    "attitudes": ATTITUDES,
    "velocities": VELOCITIES,
    "accelerations": ACCELERATIONS,
    "positions": POSITIONS,
    "tilt": TILT,
    "loads": ROTOR[2:],
}
"""Entity to channels. Channels in no group go to the entity `other`."""

_INKS = ((31, 119, 200), (230, 110, 20), (60, 160, 70), (150, 90, 180), (120, 120, 120))
_THRUST_COLOUR = (230, 70, 30)
_MOMENT_COLOUR = (40, 120, 220)
_TAIL_COLOUR = (230, 160, 30)

TILT_GAIN = 10.0
"""The disc is drawn tilted this many times as far: a sweep's half a degree would not be seen."""

_METRES_PER_NEWTON = 0.008
"""Hover thrust, 79 N, is an arrow of 0.63 m."""
_METRES_PER_TAIL_NEWTON = 0.06
_METRES_PER_NEWTON_METRE = 0.3

_LEGEND = (
    f"space (disc tilt x {TILT_GAIN:g}; thrust red, tail thrust yellow, hub spring's moment blue)"
)

_TRAIL_HZ = 2.0
_GROUND = 30.0
"""m, half the side of the ground that is drawn."""
_CLEARANCE = 0.25
"""m from the centre of gravity to the ground at the lowest point of a flight."""


def write_recording(
    path: str | Path,
    flights: Mapping[str, FlightRecord],
    *,
    model: mujoco.MjModel | None = None,
    run: Run | None = None,
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
        run: what was found from the flights, to be shown beside them.

    Raises:
        InputError: no flights, a suffix other than .rrd, or a model without a free body.
        StorageError: the file can't be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".rrd":
        raise InputError(f"{path}: a Rerun recording needs the suffix .rrd, got {path.suffix!r}")
    if not flights:
        raise InputError("a recording needs at least one flight, got none")
    shapes = box_shapes() if model is None else model_shapes(model)
    layout = blueprint(
        [_views(name, record) for name, record in flights.items()], _pairs(run) if run else {}
    )
    with atomic_write(path) as temporary:
        recording = rr.RecordingStream(APPLICATION, recording_id=_content_id(flights, run))
        # The blueprint and the file come first: what is logged before them is lost.
        recording.save(temporary, default_blueprint=layout)
        try:
            if run is not None:
                _log_run(recording, run)
            for name, record in flights.items():
                _log_flight(recording, name, record, shapes)
            recording.flush()
        finally:
            recording.disconnect()  # writes the footer
    return path


def _content_id(flights: Mapping[str, FlightRecord], run: Run | None) -> str:
    """Name the recording by its contents: the same flights open as the same recording."""
    digest = hashlib.sha256()
    for name, record in flights.items():
        digest.update(repr((name, record.names, dict(record.provenance))).encode())
        digest.update(record.time.tobytes())
        digest.update(record.values.tobytes())
    if run is not None:
        digest.update(json.dumps(dict(run.results), sort_keys=True).encode())
    return digest.hexdigest()[:32]


def _root(name: str) -> str:
    return rr.escape_entity_path_part(name)


def _groups(record: FlightRecord) -> dict[str, tuple[str, ...]]:
    """Return the groups that the record has channels of, with those channels."""
    grouped = {group: tuple(n for n in names if n in record) for group, names in GROUPS.items()}
    known = {name for names in GROUPS.values() for name in names}
    grouped["other"] = tuple(name for name in record.names if name not in known)
    return {group: names for group, names in grouped.items() if names}


def _has(record: FlightRecord, names: tuple[str, ...]) -> bool:
    return all(name in record for name in names)


def _views(name: str, record: FlightRecord) -> FlightViews:
    posed = _has(record, (*ATTITUDES, *POSITIONS))
    return FlightViews(
        name=name,
        root=_root(name),
        groups=tuple(_groups(record)),
        start=float(record.time[0]),
        stop=float(record.time[-1]),
        position=tuple(record.select(POSITIONS)[0].tolist()) if posed else None,
        legend=_LEGEND if _has(record, TILT) else "space",
    )


# A flight


def _log_flight(
    recording: rr.RecordingStream, name: str, record: FlightRecord, shapes: Shapes
) -> None:
    root = _root(name)
    recording.send_property(
        name, rr.AnyValues(provenance=json.dumps(dict(record.provenance), sort_keys=True))
    )
    index = _index(record.time)
    for group, names in _groups(record).items():
        labels = [f"{channel} [{record.unit(channel)}]" for channel in names]
        colours = [_INKS[k % len(_INKS)] for k in range(len(names))]
        recording.log(f"{root}/{group}", rr.SeriesLines(names=labels, colors=colours), static=True)
        recording.send_columns(
            f"{root}/{group}",
            indexes=[index],
            columns=rr.Scalars.columns(scalars=record.select(names)),
        )
    _log_events(recording, root, record)
    if _has(record, (*ATTITUDES, *POSITIONS)):
        _log_world(recording, root, record)
        _log_helicopter(recording, f"{root}/world/helicopter", record, shapes)


def _index(time: NDArray[np.float64]) -> rr.TimeColumn:
    # Whole nanoseconds: Rerun cuts float durations off below.
    return rr.TimeColumn(TIMELINE, duration=np.rint(time * 1e9).astype("timedelta64[ns]"))


def _log_events(recording: rr.RecordingStream, root: str, record: FlightRecord) -> None:
    """Log what was flown when, as far as the provenance tells."""
    events = _events(record.provenance.get("excitation"), float(record.time[-1]))
    if not events:
        return
    times, texts = zip(*events)
    recording.send_columns(
        f"{root}/log",
        indexes=[_index(np.array(times))],
        columns=rr.TextLog.columns(text=texts, level=["INFO"] * len(texts)),
    )


def _events(flown: Any, stop: float) -> list[tuple[float, str]]:
    try:
        kind, axis, trim = flown["kind"].lower(), flown["axis"], float(flown["trim_time"])
        length = float(flown["width"]) if kind == "doublet" else stop - 2.0 * trim
    except (KeyError, TypeError, ValueError, AttributeError):
        return []
    return [
        (0.0, "trimmed hover"),
        (trim, f"{axis} {kind} begins"),
        (trim + length, f"{axis} {kind} ends, trimmed hover"),
    ]


def _ground(record: FlightRecord) -> float:
    """Return where the ground is, down in m: at 0, or below the lowest point of the flight."""
    return max(0.0, float(np.max(record["down"])) + _CLEARANCE)


def _log_world(recording: rr.RecordingStream, root: str, record: FlightRecord) -> None:
    recording.log(f"{root}/world", rr.ViewCoordinates.FRD, static=True)  # north, east, down
    ground = _ground(record)
    north, east = record.select(POSITIONS)[0, :2]
    lines = np.arange(-_GROUND, _GROUND + 1e-9, 2.0)
    strips = [
        [[north + x, east - _GROUND, ground], [north + x, east + _GROUND, ground]] for x in lines
    ] + [[[north - _GROUND, east + y, ground], [north + _GROUND, east + y, ground]] for y in lines]
    recording.log(
        f"{root}/world/ground/lines",
        rr.LineStrips3D(strips, colors=[(120, 135, 105)], radii=[0.012]),
        static=True,
    )
    recording.log(
        f"{root}/world/ground/surface",
        rr.Boxes3D(
            centers=[[north, east, ground + 0.03]],
            half_sizes=[[_GROUND, _GROUND, 0.02]],
            colors=[(74, 88, 66)],
            fill_mode="solid",
        ),
        static=True,
    )
    every = max(1, round(1.0 / (_TRAIL_HZ * float(np.median(np.diff(record.time))))))
    points = record.select(POSITIONS)[::every]
    if len(points) < 2:
        return
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    recording.log(
        f"{root}/world/trail",
        rr.LineStrips3D.from_fields(colors=[(240, 200, 60)], radii=[-1.5]),
        static=True,
    )
    recording.send_columns(
        f"{root}/world/trail",
        indexes=[_index(record.time[::every][1:])],
        columns=rr.LineStrips3D.columns(strips=list(pieces.astype(np.float32))),
    )


def _log_helicopter(
    recording: rr.RecordingStream, entity: str, record: FlightRecord, shapes: Shapes
) -> None:
    index = _index(record.time)
    # what the camera follows must have a shape of its own
    recording.log(entity, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.001]), static=True)
    for name, archetype in shapes.body.items():
        recording.log(f"{entity}/visual_geometries/{name}", archetype, static=True)
    for name, archetype in shapes.rotor.items():
        recording.log(f"{entity}/rotor/visual_geometries/{name}", archetype, static=True)
    recording.send_columns(
        entity,
        indexes=[index],
        columns=rr.Transform3D.columns(
            translation=record.select(POSITIONS), quaternion=_quaternions(record)
        ),
    )
    tilted = _has(record, TILT)
    if shapes.radius is not None:
        ring = rr.LineStrips3D([_ring(shapes.radius)], colors=[(250, 250, 250)], radii=[0.006])
        recording.log(f"{entity}/rotor/tip_path", ring, static=True)
    if not (shapes.rotor or shapes.radius is not None or tilted):
        return
    recording.log(f"{entity}/rotor", rr.Transform3D(translation=shapes.hub), static=True)
    if not tilted:
        return
    if shapes.radius is not None:
        # square to the mast: how far the disc is from it is the tilt
        ring = rr.LineStrips3D(
            [_ring(shapes.radius) + shapes.hub], colors=[(110, 110, 110)], radii=[0.002]
        )
        recording.log(f"{entity}/shaft_plane", ring, static=True)
    recording.send_columns(
        f"{entity}/rotor",
        indexes=[index],
        columns=rr.Transform3D.columns(
            translation=np.tile(shapes.hub, (len(record), 1)), quaternion=_tilts(record)
        ),
    )
    _log_loads(recording, entity, record, shapes, index)


def _log_loads(
    recording: rr.RecordingStream,
    entity: str,
    record: FlightRecord,
    shapes: Shapes,
    index: rr.TimeColumn,
) -> None:
    zero = np.zeros(len(record))
    if "thrust" in record:
        lift = np.column_stack([zero, zero, -_METRES_PER_NEWTON * record["thrust"]])
        _log_arrow(recording, f"{entity}/rotor/thrust", "thrust", _THRUST_COLOUR, lift, index)
    if "tail_thrust" in record and shapes.tail_hub is not None:
        side = np.column_stack([zero, -_METRES_PER_TAIL_NEWTON * record["tail_thrust"], zero])
        name = f"{entity}/tail_thrust"
        _log_arrow(recording, name, "tail", _TAIL_COLOUR, side, index, shapes.tail_hub)
    stiffness = record.provenance.get("parameters", {}).get("main_rotor.hub_stiffness")
    if stiffness is not None:
        scale = _METRES_PER_NEWTON_METRE * float(stiffness)
        turn = np.column_stack([scale * record["b"], scale * record["a"], zero])
        name = f"{entity}/hub_moment"
        _log_arrow(recording, name, "hub moment", _MOMENT_COLOUR, turn, index, shapes.hub)


def _log_arrow(
    recording: rr.RecordingStream,
    entity: str,
    label: str,
    colour: tuple[int, int, int],
    vectors: NDArray[np.float64],
    index: rr.TimeColumn,
    origin: NDArray[np.float64] | None = None,
) -> None:
    recording.log(
        entity,
        rr.Arrows3D.from_fields(
            origins=[np.zeros(3) if origin is None else origin],
            colors=[colour],
            radii=[0.012],
            labels=[label],
            show_labels=False,  # they would hide what they point at; the view's title tells
        ),
        static=True,
    )
    recording.send_columns(entity, indexes=[index], columns=rr.Arrows3D.columns(vectors=vectors))


def _ring(radius: float) -> NDArray[np.float64]:
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])


def _quaternions(record: FlightRecord) -> NDArray[np.float64]:
    """Return the rotation from body to earth axes, (n_time, 4), x y z w as Rerun has it."""
    return Rotation.from_euler("ZYX", record.select(ATTITUDES)[:, ::-1]).as_quat()


def _tilts(record: FlightRecord) -> NDArray[np.float64]:
    """Return the tip-path plane's rotation in body axes, x y z w: b about x, a about y."""
    turn = TILT_GAIN * np.column_stack([record["b"], record["a"], np.zeros(len(record))])
    return Rotation.from_rotvec(turn).as_quat()


# A run


def _pairs(run: Run) -> dict[str, tuple[str, ...]]:
    """Return the entities of the figures of each model."""
    return {
        item.name: (
            *(
                f"models/{item.name}/{output}_{input_}/figure"
                for output in item.fit.structure.outputs
                for input_ in item.fit.structure.inputs
            ),
            *(
                f"models/{item.name}/time_{k + 1}/figure"
                for k in range(len(item.verification.traces) if item.verification else 0)
            ),
        )
        for item in run.evidence
    }


def _log_run(recording: rr.RecordingStream, run: Run) -> None:
    recording.send_property(
        "run", rr.AnyValues(results=json.dumps(dict(run.results), sort_keys=True))
    )
    for item in run.evidence:
        pictures = [*bode_drawings(item), *verification_drawings(item)]
        for entity, drawing in zip(_pairs(run)[item.name], pictures):
            image = rr.EncodedImage(contents=drawing.png, media_type="image/png")
            recording.log(entity, image, static=True)
        for output in item.fit.structure.outputs:
            for input_ in item.fit.structure.inputs:
                numbers = _numbers(item.fit, item.exact, output, input_)
                entity = f"models/{item.name}/{output}_{input_}/numbers"
                recording.log(entity, rr.AnyValues(drop_untyped_nones=True, **numbers), static=True)
    text = rr.TextDocument(_markdown(run), media_type="text/markdown")
    recording.log("models/table", text, static=True)
    steps = _steps(run)
    recording.send_columns(
        "models/log",
        indexes=[
            rr.TimeColumn(STEP, sequence=range(len(steps))),
            _index(np.zeros(len(steps))),  # the flights' clock too, or the viewer shows none
        ],
        columns=rr.TextLog.columns(text=steps, level=["INFO"] * len(steps)),
    )


def _numbers(
    fit: Fit, exact: FrequencyResponse | None, output: str, input_: str
) -> dict[str, NDArray[np.float64]]:
    """Return the columns behind a figure: complex ones as real and imaginary parts."""
    data, model = fit.data, fit.response(fit.data.frequency)
    pair = data.index(output, input_)
    columns = {
        "frequency_rad_s": data.frequency,
        "data_real": data.response[pair].real,
        "data_imag": data.response[pair].imag,
        "coherence": data.coherence[pair],
        "random_error": data.random_error[pair],
        "identified_real": model.response[model.index(output, input_)].real,
        "identified_imag": model.response[model.index(output, input_)].imag,
    }
    if exact is not None:
        line = exact.response[exact.index(output, input_)]
        columns |= {
            "truth_frequency_rad_s": exact.frequency,
            "truth_real": line.real,
            "truth_imag": line.imag,
        }
    return columns


def _markdown(run: Run) -> str:
    parts = []
    for table in run.tables:
        low, high = table.band_rad_s
        parts += [
            f"## {table.name}",
            f"From {table.input}, {low:.3g} to {high:.3g} rad/s, average cost {table.cost:.3g}.",
            "",
            "| parameter | unit | paper | truth | identified | CR % | insens. % | verdict |",
            "|---|---|---:|---:|---:|---:|---:|---|",
            *(f"| {' | '.join(cells(row))} |" for row in table.parameters),
            "",
        ]
    return "\n".join(parts)


def _steps(run: Run) -> list[str]:
    given = run.results["configuration"]
    steps = [
        f"vehicle loaded and trimmed, seed {run.results['seed']}",
        f"flown: {given['flown_each_axis']} sweeps on each axis, "
        f"{given['flights_kept_each_axis']} kept",
        *(f"left out: {sentence}" for sentence in run.results.get("excluded", [])),
    ]
    for table in run.tables:
        good = sum(row.verdict == "ok" for row in table.parameters)
        steps.append(
            f"identified: {table.name} from {table.input}, cost {table.cost:.3g}, "
            f"{good} of {len(table.parameters)} parameters within tolerance"
        )
    return steps + [f"missed: {sentence}" for sentence in run.results.get("misses", [])]
