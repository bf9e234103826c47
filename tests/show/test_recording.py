"""Rerun recordings: signals, pose, rotors, ground and shapes as record and model have them."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from command import fails
from helisim.cli import main
from helisim.physics.motion import flip
from helisim.records.record import CHANNELS, POSITIONS, RATES, ROTOR, Channel, FlightRecord, channel  # noqa: F401  (rows name them)
from helisim.records.storage import write_record
from helisim.show.plots import families
from helisim.show.recording import model_shapes, write_recording
from helisim.show.viewer import SLOWED, TILT_GAIN
from helisim.sim import Deck, FlightPlan, Ground, Pulse, Swing, fly
from made_run import make_flight
from tabled import tabled

SINGLE = 1e-6
"""Rerun keeps poses and shapes in single precision: 6e-8 of the largest number, here below 10."""
SPEED = 178.0


def read(path) -> dict[str, dict[str, np.ndarray]]:
    contents: dict[str, dict[str, np.ndarray]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns):
            if name == "time":
                rows = column.to_numpy(zero_copy_only=False).astype("int64")
            else:
                rows = np.array(column.to_pylist(), dtype=object)
            contents.setdefault(chunk.entity_path, {})[name] = rows
    return contents


def numbers(rows) -> np.ndarray:
    return np.array(rows.tolist(), dtype=float)


@pytest.fixture(scope="module")
def model(jr700):
    return jr700.visual_model()


@pytest.fixture(scope="module")
def written(tmp_path_factory, model):
    record = make_flight(
        parameters={"main_rotor.hub_stiffness": 86.0, "main_rotor.speed": SPEED},
        reached={"phases": [[0.02, "hover"], [1.5, "flare"]]},
    )
    path = tmp_path_factory.mktemp("scene") / "scene.rrd"
    write_recording(path, {"lat 1": record}, model=model)
    return record, path, read(path)


def test_signals_pose_and_rotor_come_back(written):
    """North, east, down, and body axes as phi, theta, psi turn them; the disc by b and a."""
    record, path, found = written
    for (family, unit), names in families(record, record.names).items():
        entity = found[f"/lat\\ 1/{rr.escape_entity_path_part(family)}"]
        turns = family in ("rates", "attitude")  # in degrees, as in reports
        values = record.select(names)[::2] * (np.rad2deg(1.0) if turns else 1.0)
        # rounding of a factor
        np.testing.assert_allclose(numbers(entity["Scalars:scalars"]), values, rtol=1e-15)
        np.testing.assert_array_equal(entity["time"], 20_000_000 * np.arange(len(record) // 2))
        moved = ("controls", "sticks", "servos", "servo positions")
        seen = "unitised" if family in moved else unit.replace("rad", "deg") if turns else unit
        labels = [f"{name} [{seen}]" for name in names]
        assert entity["SeriesLines:names"].ravel().tolist() == labels
    text = found["/__properties/lat\\ 1"]["provenance"].ravel()[0]
    assert json.loads(text) == json.loads(json.dumps(dict(record.provenance)))
    log = found["/lat\\ 1/log"]
    assert log["TextLog:text"].ravel().tolist() == ["hover", "flare"]
    assert log["time"].tolist() == [20_000_000, 1_500_000_000]
    assert len(RrdReader(path).blueprints()) == 1
    pose = found["/lat\\ 1/world/helicopter"]
    place = numbers(pose["Transform3D:translation"]).reshape(-1, 3)
    np.testing.assert_allclose(place, record.select(POSITIONS)[::2], atol=20 * SINGLE)
    x, y, z, w = numbers(pose["Transform3D:quaternion"]).reshape(-1, 4).T
    # aerospace sequence, yaw then pitch then roll, by its quaternion in closed form
    # (Diebel, "Representing attitude", 2006, section 8.11)
    (cr, cp, cy), (sr, sp, sy) = (
        [f(record[name][::2] / 2.0) for name in ("phi", "theta", "psi")] for f in (np.cos, np.sin)
    )
    expected = [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
    actual = np.array([x, y, z, w])
    actual *= np.sign(np.sum(actual * expected, axis=0))  # both signs are the same attitude
    np.testing.assert_allclose(actual, expected, atol=SINGLE)
    # blades turn clockwise from above, slowed, in a disc tilted ten times by b and a
    rotor = found["/lat\\ 1/world/helicopter/rotor"]
    drawn = Rotation.from_quat(numbers(rotor["Transform3D:quaternion"]).reshape(-1, 4))
    a, b, time = record["a"][::2], record["b"][::2], record.time[::2]
    zero = np.zeros(len(time))
    tilt = Rotation.from_rotvec(TILT_GAIN * np.column_stack([b, a, zero]))
    turn = Rotation.from_rotvec(np.column_stack([zero, zero, SPEED * time / SLOWED]))
    np.testing.assert_allclose((drawn.inv() * tilt * turn).magnitude(), 0.0, atol=4.0 * SINGLE)
    hub = numbers(rotor["Transform3D:translation"]).reshape(-1, 3)
    np.testing.assert_allclose(hub, np.tile([0.0, 0.0, -0.28], (len(hub), 1)), atol=1e-5)  # MJCF


def test_a_log_without_the_rotors_truth_and_the_models_own_geoms_are_drawn(tmp_path, model):
    names = tuple(name for name in CHANNELS if name not in ROTOR)
    strange = (channel("p"), channel("LAT"), Channel("rpm", "1/min", "OTHER"))
    short = FlightRecord([0.0, 1.0], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], strange)
    told = []
    both = {"f": make_flight(names), "s": short}
    path = tmp_path / "real.rrd"
    found = read(write_recording(path, both, model=model, on_progress=told.append))
    assert told == ["f", "s"]
    assert "/f/world/helicopter" in found
    signals = {name for name in found if name.startswith("/s/")}
    assert signals == {"/s/rates", "/s/sticks", "/s/rpm"}
    rates = numbers(found["/s/rates"]["Scalars:scalars"]).ravel()
    np.testing.assert_allclose(rates, np.rad2deg([1.0, 4.0]), rtol=1e-15)
    shapes = model_shapes(model)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    root = model.body("jr700").id
    own = (model.body_rootid[model.geom_bodyid] == root) & (model.geom_group < 3)
    turning = np.isin(model.geom_bodyid, [model.body(one).id for one in ("rotor", "tail_rotor")])
    boxes = own & ~turning & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
    away = data.geom_xpos[boxes] - data.subtree_com[root]
    expected = np.column_stack(flip(*(away @ data.xmat[root].reshape(3, 3)).T))
    centres = shapes["body"][0]["box"].centers.as_arrow_array().to_pylist()
    np.testing.assert_allclose(centres, expected, atol=1e-5)
    count = 0
    for part, _ in shapes.values():
        count += len(part["mesh"].vertex_positions.as_arrow_array())
    meshes = own & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    assert count == 3 * model.mesh_facenum[model.geom_dataid[meshes]].sum()


def test_the_ground_is_drawn_as_it_was_flown_over(tmp_path, jr700, model):
    slope = Ground(slope=0.2, uphill=0.5 * np.pi)
    deck = Ground(deck=Deck(above=2.0, heave=Swing(amplitude=0.5, period=6.0)))
    seen = {}
    for name, ground in (("slope", slope), ("deck", deck)):
        excitation = Pulse(axis="ped", duration=2.0, trim_time=0.2)
        (record,) = fly(jr700, FlightPlan(excitation=excitation, ground=ground), seed=1)
        seen[name] = read(write_recording(tmp_path / f"{name}.rrd", {"f": record}, model=model))
    axis = np.ravel(seen["slope"]["/f/world/ground"]["Transform3D:rotation_axis_angle"])[0]
    turned = Rotation.from_rotvec(np.array(axis["axis"]) * axis["angle"])
    # a metre east, on the slope, is a fifth of a metre up
    east = turned.apply([0.0, 1.0, 0.0])
    assert east == pytest.approx([0.0, np.cos(0.2), -np.sin(0.2)], abs=SINGLE)
    place = numbers(seen["deck"]["/f/world/deck"]["Transform3D:translation"]).reshape(-1, 3)
    assert place[:, 2] == pytest.approx(-deck.deck.heave.at(record.time[::2]), abs=SINGLE)


@tabled("name", "flights", "error", "message")
def test_a_recording_that_can_not_be_made_is_refused(
    tmp_path, model, name, flights, error, message
):
    with pytest.raises(error, match=message):
        write_recording(tmp_path / name, flights, model=model)
    assert list(tmp_path.iterdir()) == []


# The commands `record` and `report`: what they write.


def test_a_log_becomes_a_recording(tmp_path, capsys):
    log, out = tmp_path / "a.parquet", tmp_path / "a.rrd"
    write_record(make_flight(), log)
    assert main(["rerun", str(log), "--out", str(out)]) == 0
    assert f"rerun {out}" in capsys.readouterr().out
    assert out.stat().st_size > 0
    assert main(["rerun", str(log), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_the_vehicle_that_flew_is_drawn(tmp_path, capsys, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "helisim.show.recording.write_recording",
        lambda path, flights, *, model, **_: drawn.append(model.names),
    )
    both = [str(tmp_path / f"{name}.parquet") for name in ("blade360", "jr700")]
    for path in both:
        write_record(make_flight(vehicle=Path(path).stem), path)
    out = ["--out", str(tmp_path / "a.rrd")]
    assert main(["rerun", both[0], *out]) == 0
    assert drawn[0].startswith(b"blade360 ")
    capsys.readouterr()
    assert "'blade360', 'jr700'" in fails(capsys, "rerun", *both, *out)
