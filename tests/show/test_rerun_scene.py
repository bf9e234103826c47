"""What a recording shows in space, and of a whole run."""

import json

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_rerun_recording import SINGLE, read

from helisim.records.record import CHANNELS, POSITIONS, ROTOR
from helisim.show.recording import write_recording
from helisim.show.viewer import SLOWED, TILT_GAIN
from helisim.sim import (
    Deck,
    Doublet,
    FlightPlan,
    Ground,
    Recorder,
    Sweep,
    Swing,
    fly,
)
from helisim.study.results import read_run
from made_run import make_flight, write_run

STIFFNESS = 86.0
SPEED = 178.0


@pytest.fixture(scope="module")
def contents(tmp_path_factory, jr700):
    parameters = {"main_rotor.hub_stiffness": STIFFNESS, "main_rotor.speed": SPEED}
    record = make_flight(parameters=parameters)
    path = tmp_path_factory.mktemp("scene") / "scene.rrd"
    return record, read(write_recording(path, {"f": record}, model=jr700.visual_model()))


def test_the_rotor_tilts_with_the_tip_path_plane_and_turns(contents):
    """Blades turn clockwise from above, slowed, in a disc tilted by b about x and a about y.

    The tilt is drawn ten times as far. The rotor is at the model's hub.
    """
    record, found = contents
    rotor = found["/f/world/helicopter/rotor"]
    drawn = Rotation.from_quat(rotor["Transform3D:quaternion"].reshape(-1, 4))
    zero = np.zeros(len(record))
    tilt = Rotation.from_rotvec(TILT_GAIN * np.column_stack([record["b"], record["a"], zero]))
    turn = Rotation.from_rotvec(np.column_stack([zero, zero, SPEED * record.time / SLOWED]))
    np.testing.assert_allclose((drawn.inv() * tilt * turn).magnitude(), 0.0, atol=4.0 * SINGLE)
    hub = rotor["Transform3D:translation"].reshape(-1, 3)
    np.testing.assert_allclose(hub, np.tile([0.0, 0.0, -0.28], (len(hub), 1)), atol=1e-5)  # MJCF


def test_a_rotor_of_the_other_direction_turns_and_pushes_the_other_way(tmp_path, jr700):
    """Counter-clockwise blades, and a tail thrust to the right; clockwise where none is said."""
    drawn, pushed = {}, {}
    for direction in (None, -1.0):
        parameters = {"main_rotor.speed": SPEED}
        if direction is not None:
            parameters["main_rotor.direction"] = direction
        flights = {"f": make_flight(parameters=parameters)}
        path = tmp_path / f"{direction}.rrd"
        found = read(write_recording(path, flights, model=jr700.visual_model()))
        turned = found["/f/world/helicopter/rotor"]["Transform3D:quaternion"].reshape(-1, 4)
        drawn[direction] = Rotation.from_quat(turned[1]).as_rotvec()[2]
        arrow = found["/f/world/helicopter/tail_thrust"]["Arrows3D:vectors"].reshape(-1, 3)
        pushed[direction] = arrow[:, 1]
    assert drawn[None] > 0.0 > drawn[-1.0]
    assert np.abs(pushed[None]).max() > 0.0
    np.testing.assert_array_equal(pushed[-1.0], -pushed[None])


def test_without_a_known_speed_a_rotor_stands(contents):
    """The tail rotor's speed isn't given: its place is logged once."""
    _, found = contents
    tail = found["/f/world/helicopter/tail_rotor"]
    assert len(tail["Transform3D:translation"]) == 1
    assert "time" not in tail


def test_arrows_are_thrust_and_moment(contents):
    """The thrust's arrow is along the disc's axis, the moment's is the spring's times the tilt."""
    record, found = contents
    lift = found["/f/world/helicopter/rotor/thrust"]["Arrows3D:vectors"].reshape(-1, 3)
    np.testing.assert_allclose(lift[:, 2], -0.008 * record["thrust"], atol=SINGLE)
    np.testing.assert_allclose(lift[:, :2], 0.0)
    turn = found["/f/world/helicopter/hub_moment"]["Arrows3D:vectors"].reshape(-1, 3)
    np.testing.assert_allclose(turn[:, 0], 0.3 * STIFFNESS * record["b"], atol=1e-5)
    np.testing.assert_allclose(turn[:, 1], 0.3 * STIFFNESS * record["a"], atol=1e-5)


def test_the_models_own_geoms_are_drawn(contents, jr700):
    """Blades are the rotors', everything else the fuselage's; no mesh is lost."""
    _, found = contents
    model, base = jr700.visual_model(), "/f/world/helicopter"
    parts = (f"{base}/rotor", f"{base}/tail_rotor", "/shapes")
    drawn = [
        len(
            np.reshape(
                found[f"{part}/visual_geometries/meshes"]["Mesh3D:vertex_positions"], (-1, 3)
            )
        )
        for part in parts
    ]
    meshes = model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    carried = [
        meshes & (model.geom_bodyid == model.body(one).id) for one in ("rotor", "tail_rotor")
    ]
    of_rotors = [int(model.mesh_vertnum[model.geom_dataid[which]].sum()) for which in carried]
    rest = meshes & (model.geom_group < 3) & ~carried[0] & ~carried[1]
    assert drawn == [*of_rotors, int(model.mesh_vertnum[model.geom_dataid[rest]].sum())]


def test_ground_and_trail_are_there(contents):
    """The ground is at the height of the world's zero; the trail runs along the positions."""
    record, found = contents
    ground = found["/f/world/ground/surface"]["Boxes3D:centers"].ravel()
    assert ground[2] == pytest.approx(0.0, abs=0.05)
    trail = found["/f/world/trail"]["LineStrips3D:strips"]
    pieces = np.array([list(row) for row in trail if row is not None], dtype=float)
    points = pieces.reshape(-1, 2, 3)
    np.testing.assert_array_equal(points[1:, 0], points[:-1, 1])  # no gaps
    # each point is the mean of the quarter of a second around it: 25 samples of 100 Hz
    means = record.select(POSITIONS)[:25].mean(axis=0), record.select(POSITIONS)[25:50].mean(axis=0)
    np.testing.assert_allclose(points[0], means, atol=20.0 * SINGLE)  # of the height, 20 m


def test_without_the_rotors_truth_there_are_no_arrows(tmp_path):
    """A real log has no flapping: its helicopter is drawn, its disc stays square to the mast."""
    names = tuple(name for name in CHANNELS if name not in ROTOR)
    found = read(write_recording(tmp_path / "real.rrd", {"f": make_flight(names)}))
    assert "/f/world/helicopter" in found
    assert not [name for name in found if "thrust" in name or "moment" in name]
    assert "/f/world/legend" not in found


def test_a_run_is_recorded_with_its_models(tmp_path):
    """Plots, numbers, table and steps stand beside the flights."""
    write_run(tmp_path)
    run = read_run(tmp_path)
    found = read(write_recording(tmp_path / "run.rrd", {"lat_02": run.sweeps["lat"]}, run=run))
    item = run.models[1]
    for output in ("p", "q"):
        for input_ in ("lat", "lon"):
            entity = found[f"/models/rollpitch_in1/{output}_{input_}/numbers"]
            pair = item.fit.data.index(output, input_)
            np.testing.assert_allclose(
                np.ravel(entity["data_real"]), item.fit.data.response[pair].real
            )
            np.testing.assert_allclose(np.ravel(entity["coherence"]), item.fit.data.coherence[pair])
            picture = found[f"/models/rollpitch_in1/{output}_{input_}/bode"]
            blob = bytes(np.ravel(picture["EncodedImage:blob"]).tolist())
            assert blob.startswith(b"\x89PNG")
    table = found["/models/table"]["TextDocument:text"].ravel()[0]
    assert all(f"| {name} |" in table for name in item.fit.values)
    steps = [str(text) for text in found["/models/log"]["TextLog:text"].ravel()]
    assert any("left out: flight lat_01" in step for step in steps)
    events = [str(text) for text in found["/lat_02/log"]["TextLog:text"].ravel()]
    assert events == ["trimmed hover", "lat sweep begins", "lat sweep ends, trimmed hover"]
    results = found["/__properties/run"]["results"].ravel()[0]
    assert json.loads(results) == run.results.to_dict()


def test_a_flight_of_90_seconds_is_small(tmp_path, jr700):
    """With everything in it, its recording is below 15 MB."""
    (record,) = fly(
        jr700,
        FlightPlan(excitation=Sweep(axis="lat"), recorder=Recorder.of(jr700, rotor=True)),
        seed=1,
    )
    model = jr700.visual_model()
    path = write_recording(tmp_path / "lat.rrd", {"lat": record}, model=model)
    assert path.stat().st_size < 15e6  # what opens at once on a phone line; 4.9 MB measured


def test_the_rotors_truth_is_recorded_on_request_alone(jr700):
    """The rotor's channels are there when asked for, and change no other channel."""
    sweep = Sweep(axis="lat", duration=13.0)
    (plain,) = fly(jr700, sweep, seed=3)
    (more,) = fly(
        jr700, FlightPlan(excitation=sweep, recorder=Recorder.of(jr700, rotor=True)), seed=3
    )
    assert not set(ROTOR) & set(plain.names)
    np.testing.assert_array_equal(more.select(plain.names), plain.values)
    weight = 8.01 * 9.8015  # Table 1
    assert np.mean(more["thrust"]) == pytest.approx(weight, rel=0.02)  # sweeps tilt and heave it


def test_the_ground_is_drawn_as_it_was_flown_over(tmp_path, jr700):
    """A slope leans towards where it rises; a deck moves, above the water."""
    slope = Ground(slope=0.2, uphill=0.5 * np.pi)
    deck = Ground(deck=Deck(above=2.0, heave=Swing(amplitude=0.5, period=6.0)))
    seen = {}
    for name, ground in (("slope", slope), ("deck", deck)):
        plan = FlightPlan(excitation=Doublet(axis="ped"), ground=ground)
        (record,) = fly(jr700, plan, seed=1)
        path = tmp_path / f"{name}.rrd"
        seen[name] = read(write_recording(path, {"f": record}, model=jr700.visual_model()))
    leaning = seen["slope"]["/f/world/ground"]
    axis = np.ravel(leaning["Transform3D:rotation_axis_angle"])[0]
    turned = Rotation.from_rotvec(np.array(axis["axis"]) * axis["angle"])
    # a metre east, on the slope, is a fifth of a metre up
    east = turned.apply([0.0, 1.0, 0.0])
    assert east == pytest.approx([0.0, np.cos(0.2), -np.sin(0.2)], abs=SINGLE)
    place = seen["deck"]["/f/world/deck"]["Transform3D:translation"].reshape(-1, 3)
    assert place[:, 2] == pytest.approx(-deck.deck.heave.at(record.time), abs=SINGLE)
    lines = seen["deck"]["/f/world/ground/lines"]["LineStrips3D:strips"]
    assert np.ravel(np.array(lines[0]).tolist())[-1] == pytest.approx(2.0)
