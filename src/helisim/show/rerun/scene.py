"""A flight in space for Rerun: ground, trail, and the helicopter with its rotors and loads.

All flights share the shape of one fuselage, which would be most of a recording otherwise. A
frame of Rerun's has one parent, so the fuselage's is the root, and each flight's world hangs
on it by the flight's own pose, read from child to parent.
"""

import math
from collections.abc import Mapping

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from helisim.records.channels import ATTITUDES, POSITIONS, ROTOR
from helisim.records.record import FlightRecord
from helisim.show.drawn_rotor import SLOWED, TILT_GAIN, drawn_tilt, drawn_turn
from helisim.show.rerun.shapes import Shapes
from helisim.show.rerun.timelines import time_column
from helisim.sim.ground import Deck, ground_of

_TILT = ROTOR[:2]

_THRUST_COLOUR = (230, 70, 30)
_MOMENT_COLOUR = (40, 120, 220)
_TAIL_COLOUR = (230, 160, 30)

_LEGEND = f"""\
white ring: tip path, tilted {TILT_GAIN:g} times as far as flown\\
green ring: hub plane\\
red and yellow arrows: main and tail rotor's thrust\\
blue arrow: moment of the hub's spring\\
blades turn {SLOWED:g} times slower than flown
"""

_METRES_PER_NEWTON = 0.008
"""Hover thrust of the JR700, 79 N, is an arrow of 0.63 m."""
_METRES_PER_TAIL_NEWTON = 0.06
_METRES_PER_NEWTON_METRE = 0.3
_USUAL_RADIUS = 0.767
"""m, of the rotor that these are for; weights go with the third power of a vehicle's size."""

_TRAIL_HZ = 4.0
"""Points of the trail a second, each the mean of what was recorded around it."""
_GROUND = 150.0
"""m, half the side of the ground that is drawn."""
_MESH = 5.0
"""m between its lines."""
_CLEARANCE = 0.25
"""m from the centre of gravity to the ground at the lowest point of a flight."""


SHAPES = "shapes"
"""Entity of what flights share."""
_FUSELAGE = "fuselage"
"""Frame of it."""


def log_fuselage(recording: rr.RecordingStream, shapes: Shapes) -> None:
    """Log the shape that all flights share: what a helicopter is without its rotors."""
    for name, archetype in shapes.body.items():
        entity = f"{SHAPES}/visual_geometries/{name}"
        recording.log(entity, archetype, rr.CoordinateFrame(_FUSELAGE), static=True)


def world_frame(world: str) -> str:
    """Return the frame of an entity."""
    return f"tf#/{world}"


def is_posed(record: FlightRecord) -> bool:
    """Return whether a record has the position and attitude of the helicopter."""
    return _has(record, (*ATTITUDES, *POSITIONS))


def knows_rotor(record: FlightRecord) -> bool:
    """Return whether a record has the tilt of the tip-path plane, as a simulation's may."""
    return _has(record, _TILT)


def log_space(
    recording: rr.RecordingStream,
    world: str,
    record: FlightRecord,
    shapes: Shapes,
    loads: FlightRecord,
) -> None:
    """Log a record that `is_posed` below the entity `world`; its arrows at the samples of loads."""
    if knows_rotor(record):
        text = rr.TextDocument(_LEGEND, media_type="text/markdown")
        recording.log(f"{world}/legend", text, static=True)
    recording.log(world, rr.ViewCoordinates.FRD, static=True)  # north, east, down
    _log_ground(recording, f"{world}/ground", record)
    _log_trail(recording, f"{world}/trail", record)
    _log_helicopter(recording, world, record, shapes)
    _log_loads(recording, f"{world}/helicopter", loads, shapes)


def _has(record: FlightRecord, names: tuple[str, ...]) -> bool:
    return all(name in record for name in names)


def _parameter(record: FlightRecord, name: str) -> float | None:
    value = record.provenance.get("parameters", {}).get(name)
    return None if value is None else float(value)


def _log_ground(recording: rr.RecordingStream, entity: str, record: FlightRecord) -> None:
    """Log the ground that it was flown over, or at height 0 or below the flight's lowest point."""
    flown = ground_of(record)
    if flown is None:
        ground = max(0.0, float(np.max(record["down"])) + _CLEARANCE)
        north, east = record.select(POSITIONS)[0, :2]
    else:
        ground, north, east = flown.deck.above if flown.deck is not None else 0.0, 0.0, 0.0
        axis = [-math.sin(flown.uphill), math.cos(flown.uphill), 0.0]
        lean = rr.RotationAxisAngle(axis=axis, radians=flown.slope)
        recording.log(entity, rr.Transform3D(rotation=lean), static=True)
        if flown.deck is not None:
            _log_deck(recording, f"{entity.rpartition('/')[0]}/deck", flown.deck, record.time)
    lines = np.arange(-_GROUND, _GROUND + 1e-9, _MESH)
    strips = [
        [[north + x, east - _GROUND, ground], [north + x, east + _GROUND, ground]] for x in lines
    ] + [[[north - _GROUND, east + y, ground], [north + _GROUND, east + y, ground]] for y in lines]
    recording.log(
        f"{entity}/lines",
        rr.LineStrips3D(strips, colors=[(120, 135, 105)], radii=[0.02]),
        static=True,
    )
    recording.log(
        f"{entity}/surface",
        rr.Boxes3D(
            centers=[[north, east, ground + 0.04]],
            half_sizes=[[_GROUND, _GROUND, 0.02]],
            colors=[(74, 88, 66)],
            fill_mode="solid",
        ),
        static=True,
    )


def _log_deck(
    recording: rr.RecordingStream, entity: str, deck: Deck, time: NDArray[np.float64]
) -> None:
    size = [0.5 * deck.length, 0.5 * deck.width, 0.5 * deck.thickness]
    recording.log(
        f"{entity}/surface",
        rr.Boxes3D(
            centers=[[0.0, 0.0, size[2]]],
            half_sizes=[size],
            colors=[(84, 87, 89)],
            fill_mode="solid",
        ),
        static=True,
    )
    place, turn = deck.pose(time)
    recording.send_columns(
        entity,
        indexes=[time_column(time)],
        columns=rr.Transform3D.columns(
            translation=place, quaternion=Rotation.from_matrix(turn).as_quat()
        ),
    )


def _log_trail(recording: rr.RecordingStream, entity: str, record: FlightRecord) -> None:
    every = max(1, round(1.0 / (_TRAIL_HZ * float(np.median(np.diff(record.time))))))
    count = len(record) // every
    if count < 2:
        return
    points = record.select(POSITIONS)[: count * every].reshape(count, every, 3).mean(axis=1)
    times = record.time[: count * every].reshape(count, every).mean(axis=1)
    recording.log(
        entity,
        rr.LineStrips3D.from_fields(colors=[(240, 200, 60)], radii=[-1.5]),
        static=True,
    )
    pieces = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
    recording.send_columns(
        entity,
        indexes=[time_column(times[1:])],
        columns=rr.LineStrips3D.columns(strips=list(pieces)),
    )


def _log_helicopter(
    recording: rr.RecordingStream, world: str, record: FlightRecord, shapes: Shapes
) -> None:
    entity = f"{world}/helicopter"
    # what the camera follows must have a shape of its own
    recording.log(entity, rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.001]), static=True)
    recording.log(
        f"{entity}/fuselage",
        rr.Transform3D.from_fields(parent_frame=_FUSELAGE, child_frame=world_frame(entity)),
        static=True,
    )
    count = len(record)
    recording.send_columns(
        entity,
        indexes=[time_column(record.time)],
        # a transform's fields that are not in its row count as not given: frames in every row
        columns=rr.Transform3D.columns(
            translation=record.select(POSITIONS),
            quaternion=_quaternions(record),
            relation=[rr.TransformRelation.ChildFromParent] * count,
            parent_frame=[_FUSELAGE] * count,
            child_frame=[world_frame(world)] * count,
        ),
    )
    _log_main_rotor(recording, entity, record, shapes)
    if shapes.tail_rotor and shapes.tail_hub is not None:
        tail = f"{entity}/tail_rotor"
        _log_shapes(recording, tail, shapes.tail_rotor)
        turn = _turn(record, "tail_rotor.speed", (0.0, 1.0, 0.0))
        _log_turning(recording, tail, record, shapes.tail_hub, turn)


def _log_main_rotor(
    recording: rr.RecordingStream, entity: str, record: FlightRecord, shapes: Shapes
) -> None:
    rotor = f"{entity}/rotor"
    _log_shapes(recording, rotor, shapes.rotor)
    turn = _turn(record, "main_rotor.speed", (0.0, 0.0, _direction(record)))
    if knows_rotor(record):  # ring and arrow are the same however far the blades have turned
        tilt = drawn_tilt(record["a"], record["b"])
        turn = tilt if turn is None else tilt * turn
    _log_turning(recording, rotor, record, shapes.hub, turn)
    if shapes.radius is not None:
        ring = rr.LineStrips3D([_ring(shapes.radius)], colors=[(250, 250, 250)], radii=[0.006])
        recording.log(f"{rotor}/tip_path", ring, static=True)
    if shapes.radius is not None and knows_rotor(record):
        # square to the mast: how far the disc is from it is the tilt
        ring = rr.LineStrips3D(
            [_ring(shapes.radius) + shapes.hub], colors=[(90, 220, 130)], radii=[0.004]
        )
        recording.log(f"{entity}/hub_plane", ring, static=True)


def _log_shapes(
    recording: rr.RecordingStream, entity: str, shapes: Mapping[str, rr.AsComponents]
) -> None:
    for name, archetype in shapes.items():
        recording.log(f"{entity}/visual_geometries/{name}", archetype, static=True)


def _turn(record: FlightRecord, speed: str, axis: tuple[float, float, float]) -> Rotation | None:
    """Return how far a rotor has turned at each sample; None if the record tells no speed."""
    turning = _parameter(record, speed)
    if turning is None:
        return None
    return Rotation.from_rotvec(drawn_turn(record.time, turning)[:, None] * np.array(axis))


def _direction(record: FlightRecord) -> float:
    """Return 1 where the main rotor turns clockwise seen from above, the default, else -1."""
    direction = _parameter(record, "main_rotor.direction")
    return 1.0 if direction is None else direction


def _log_turning(
    recording: rr.RecordingStream,
    rotor: str,
    record: FlightRecord,
    hub: NDArray[np.float64],
    turn: Rotation | None,
) -> None:
    """Log where a rotor is and how it is turned; without a turn it stands."""
    if turn is None:
        recording.log(rotor, rr.Transform3D(translation=hub), static=True)
        return
    recording.send_columns(
        rotor,
        indexes=[time_column(record.time)],
        columns=rr.Transform3D.columns(
            translation=np.tile(hub, (len(record), 1)), quaternion=turn.as_quat()
        ),
    )


def _log_loads(
    recording: rr.RecordingStream, entity: str, record: FlightRecord, shapes: Shapes
) -> None:
    zero = np.zeros(len(record))
    size = (shapes.radius or _USUAL_RADIUS) / _USUAL_RADIUS
    if "thrust" in record:
        lift = np.column_stack([zero, zero, -_METRES_PER_NEWTON / size**2 * record["thrust"]])
        _log_arrow(recording, f"{entity}/rotor/thrust", _THRUST_COLOUR, lift, record)
    if "tail_thrust" in record and shapes.tail_hub is not None:
        left = _METRES_PER_TAIL_NEWTON / size**2 * _direction(record) * record["tail_thrust"]
        side = np.column_stack([zero, -left, zero])
        name = f"{entity}/tail_thrust"
        _log_arrow(recording, name, _TAIL_COLOUR, side, record, shapes.tail_hub)
    stiffness = _parameter(record, "main_rotor.hub_stiffness")
    if stiffness is not None and knows_rotor(record):
        scale = _METRES_PER_NEWTON_METRE / size**3 * stiffness
        turn = np.column_stack([scale * record["b"], scale * record["a"], zero])
        _log_arrow(recording, f"{entity}/hub_moment", _MOMENT_COLOUR, turn, record, shapes.hub)


def _log_arrow(
    recording: rr.RecordingStream,
    entity: str,
    colour: tuple[int, int, int],
    vectors: NDArray[np.float64],
    record: FlightRecord,
    origin: NDArray[np.float64] | None = None,
) -> None:
    recording.log(
        entity,
        rr.Arrows3D.from_fields(
            origins=[np.zeros(3) if origin is None else origin],
            colors=[colour],
            radii=[0.012],
            labels=[entity.rpartition("/")[2]],
            show_labels=False,  # they would hide what they point at; the view's title tells
        ),
        static=True,
    )
    recording.send_columns(
        entity,
        indexes=[time_column(record.time)],
        columns=rr.Arrows3D.columns(vectors=vectors),
    )


def _ring(radius: float) -> NDArray[np.float64]:
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])


def _quaternions(record: FlightRecord) -> NDArray[np.float64]:
    """Return the rotation from body to earth axes, (n_time, 4), x y z w as Rerun has it."""
    return Rotation.from_euler("ZYX", record.select(ATTITUDES)[:, ::-1]).as_quat()
