import json
import subprocess
import sys

import mujoco
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from helisim.base.errors import InputError, StorageError
from helisim.records.record import (
    AIR,
    CHANNELS,
    IN2,
    POSITIONS,
    RATES,
    Channel,
    FlightRecord,
    channel,
)
from helisim.show.recording import GROUPS, write_recording

SINGLE = 1e-6
"""Rerun keeps poses and shapes in single precision: 6e-8 of the largest number, here below 10."""

MODEL = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <mesh name="tetra" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body pos="0 0 5" euler="0 0 90">
      <freejoint/>
      <inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/>
      <geom type="box" size="0.3 0.2 0.1" pos="0.1 0.2 0.3" material="red"/>
      <geom type="capsule" fromto="0 0 0  0 0 1" size="0.05" contype="0"/>
      <geom type="sphere" size="0.4" group="3"/>
      <body pos="1 0 0"><geom type="mesh" mesh="tetra" mass="0"/></body>
    </body>
  </worldbody>
</mujoco>
"""


def make_flight(names=tuple(CHANNELS), n: int = 200, **provenance) -> FlightRecord:
    rng = np.random.default_rng(len(names))
    values = np.cumsum(0.1 * rng.standard_normal((n, len(names))), axis=0)
    return FlightRecord(
        np.arange(n) / 100.0, values, tuple(channel(name) for name in names), provenance
    )


def read(path) -> dict[str, dict[str, np.ndarray]]:
    """Return the recording as entity -> column -> array, the time in whole nanoseconds."""
    contents: dict[str, dict[str, np.ndarray]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns):
            if name == "time":
                rows = column.to_numpy(zero_copy_only=False).astype("int64")
            elif name == "LineStrips2D:strips":  # of different lengths
                rows = np.empty(len(column), dtype=object)
                rows[:] = column.to_pylist()
            else:
                rows = np.array(column.to_pylist())
            contents.setdefault(chunk.entity_path, {})[name] = rows
    return contents


def test_the_signals_come_back(tmp_path):
    """Every channel, its name with its unit, and its time to the nanosecond are in the file."""
    flights = {"lat-1": make_flight(seed=1), "ped 2": make_flight(n=150, seed=2)}
    contents = read(write_recording(tmp_path / "sweeps.rrd", flights))
    for root, record in zip(("/lat-1", "/ped\\ 2"), flights.values()):
        for group, names in GROUPS.items():
            entity = contents[f"{root}/{group}"]
            singles = record.select(names).astype(np.float32)
            np.testing.assert_array_equal(entity["Scalars:scalars"], singles)
            np.testing.assert_array_equal(entity["time"], 10_000_000 * np.arange(len(record)))
            labels = [f"{name} [{record.unit(name)}]" for name in names]
            assert entity["SeriesLines:names"].ravel().tolist() == labels


def test_the_pose_is_the_records(tmp_path):
    """Translations are north, east, down; quaternions turn body axes as phi, theta, psi do."""
    record = make_flight()
    contents = read(write_recording(tmp_path / "pose.rrd", {"flight": record}))
    pose = contents["/flight/world/helicopter"]
    translation = pose["Transform3D:translation"].reshape(-1, 3)
    np.testing.assert_allclose(translation, record.select(POSITIONS), atol=SINGLE)

    x, y, z, w = pose["Transform3D:quaternion"].reshape(-1, 4).T
    # aerospace sequence, yaw then pitch then roll, by its quaternion in closed form
    # (Diebel, "Representing attitude", 2006, section 8.11)
    (cr, cp, cy), (sr, sp, sy) = (
        [f(record[name] / 2.0) for name in ("phi", "theta", "psi")] for f in (np.cos, np.sin)
    )
    expected = np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )
    actual = np.array([x, y, z, w])
    actual *= np.sign(np.sum(actual * expected, axis=0))  # both signs are the same attitude
    np.testing.assert_allclose(actual, expected, atol=SINGLE)


def test_the_recording_is_complete(tmp_path):
    """Rerun's own check passes, with footers: nothing was cut off."""
    path = write_recording(tmp_path / "complete.rrd", {"flight": make_flight()})
    check = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stderr
    assert len(RrdReader(path).blueprints()) == 1


def test_provenance_is_a_property(tmp_path):
    """Each flight's provenance is in the recording, as JSON."""
    record = make_flight(seed=5, versions={"helisim": "0.1.0"})
    contents = read(write_recording(tmp_path / "properties.rrd", {"flight": record}))
    text = contents["/__properties/flight"]["provenance"].ravel()[0]
    assert json.loads(text) == dict(record.provenance)


def test_long_recordings_are_thinned_and_say_so(tmp_path):
    """More than 100,000 samples: each kept one is a recorded one, at 20 to 5 a second."""
    few, many = make_flight(n=200), make_flight(n=100_001)
    said = []
    for name, record in (("few.rrd", few), ("many.rrd", many)):
        found = read(write_recording(tmp_path / name, {"f": record}))
        said.append(json.loads(found["/__properties/helisim"]["shown"].ravel()[0])["samples"])
    assert said[0] == "all"
    assert "20 a second in space" in said[1]
    for group, every in (("rates", 5), ("velocities", 10), ("positions", 20)):
        kept = many.select(GROUPS[group])[::every].astype(np.float32)
        np.testing.assert_array_equal(found[f"/f/{group}"]["Scalars:scalars"], kept)
    pose = found["/f/world/helicopter"]["Transform3D:translation"].reshape(-1, 3)
    np.testing.assert_array_equal(pose, many.select(POSITIONS)[::5].astype(np.float32))
    thrust = found["/f/world/helicopter/rotor/thrust"]["time"]
    np.testing.assert_array_equal(thrust, 100_000_000 * np.arange(10_001))


def test_a_straight_level_line_of_a_long_recording_is_its_ends(tmp_path):
    """First and last sample draw all of still air; a line that moves once keeps its samples."""
    time = np.arange(100_001) / 100.0
    still = np.full((len(time), len(AIR)), 0.25)
    gust = still.copy()
    gust[50_000, 0] = 1.25
    channels = tuple(channel(name) for name in AIR)
    flights = {
        name: FlightRecord(time, values, channels)
        for name, values in (("still", still), ("gust", gust))
    }
    found = read(write_recording(tmp_path / "air.rrd", flights))
    assert found["/still/other"]["time"].tolist() == [0, 1_000_000_000_000]
    assert found["/still/other"]["Scalars:scalars"].tolist() == [[0.25] * len(AIR)] * 2
    assert len(found["/gust/other"]["time"]) == 10_001
    assert found["/gust/other"]["Scalars:scalars"].max() == 1.25


def test_flights_share_one_fuselage(tmp_path):
    """Its shape is in the file once; each world hangs on its frame by the flight's own pose."""
    found = read(write_recording(tmp_path / "a.rrd", {"a": make_flight(), "b c": make_flight(n=9)}))
    shapes = [name for name in found if "visual_geometries" in name]
    assert all(name.startswith("/shapes/") for name in shapes)
    for root in ("a", "b\\ c"):
        pose = found[f"/{root}/world/helicopter"]
        assert set(pose["Transform3D:parent_frame"].ravel()) == {"fuselage"}
        assert set(pose["Transform3D:child_frame"].ravel()) == {f"tf#/{root}/world"}


def test_the_same_flights_are_the_same_recording(tmp_path):
    """The recording's identity is its contents: the viewer does not show them twice."""

    def identity(name: str, flight: FlightRecord) -> str:
        path = write_recording(tmp_path / name, {"flight": flight})
        return RrdReader(path).recordings()[0].recording_id

    assert identity("a.rrd", make_flight()) == identity("b.rrd", make_flight())
    assert identity("a.rrd", make_flight()) != identity("c.rrd", make_flight(n=99))


def test_a_record_without_pose_has_its_signals(tmp_path):
    """Some channels are enough, also ones that are in no group; there is no helicopter then."""
    record = FlightRecord(
        [0.0, 1.0],
        [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        (channel("p"), channel("LAT"), Channel("rpm", "1/min", "OTHER")),
    )
    contents = read(write_recording(tmp_path / "short.rrd", {"flight": record}))
    entities = {name for name in contents if not name.startswith("/__")}
    assert entities == {"/flight/rates", "/flight/sticks", "/flight/other"}
    assert contents["/flight/rates"]["SeriesLines:names"].ravel().tolist() == ["p [rad/s]"]
    assert contents["/flight/other"]["SeriesLines:names"].ravel().tolist() == ["rpm [1/min]"]
    assert contents["/flight/rates"]["Scalars:scalars"].ravel().tolist() == [1.0, 4.0]


def test_a_models_geoms_are_the_shape(tmp_path):
    """Geoms of the free body appear forward-right-down from its centre of gravity.

    The model's body is turned and lifted, and weighs 2 kg at x = 0.1 plus its geoms.
    """
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rotation = data.xmat[1].reshape(3, 3)
    centre = rotation.T @ (data.subtree_com[1] - data.xpos[1])  # forward-left-up
    flip = np.array([1.0, -1.0, -1.0])

    contents = read(write_recording(tmp_path / "m.rrd", {"f": make_flight()}, model=model))
    base = "/shapes/visual_geometries"
    shapes = {name for name in contents if name.startswith(base)}
    # neither the floor nor the collision sphere, which is in group 3
    assert shapes == {f"{base}/boxes", f"{base}/capsules", f"{base}/meshes"}

    box = contents[f"{base}/boxes"]
    expected = flip * ([0.1, 0.2, 0.3] - centre)
    np.testing.assert_allclose(box["Boxes3D:centers"].ravel(), expected, atol=SINGLE)
    np.testing.assert_allclose(box["Boxes3D:half_sizes"].ravel(), [0.3, 0.2, 0.1], atol=SINGLE)
    assert box["Boxes3D:colors"].ravel().tolist() == [0xFF0000FF]  # the material's red

    # the capsule rises from the body's origin: one end there, or one at 1 m, its axis vertical
    capsule = contents[f"{base}/capsules"]
    start = capsule["Capsules3D:translations"].ravel()
    x, y, z, w = capsule["Capsules3D:quaternions"].ravel()
    along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    ends = np.array([start, start + capsule["Capsules3D:lengths"].ravel()[0] * along])
    bottom, top = flip * ([0, 0, 0] - centre), flip * ([0, 0, 1] - centre)
    np.testing.assert_allclose(sorted(ends[:, 2]), [top[2], bottom[2]], atol=SINGLE)
    np.testing.assert_allclose(ends[:, :2], [bottom[:2]] * 2, atol=SINGLE)

    vertices = contents[f"{base}/meshes"]["Mesh3D:vertex_positions"].reshape(-1, 3)
    corners = flip * (np.array([[1, 0, 0], [2, 0, 0], [1, 1, 0], [1, 0, 1]]) - centre)
    order = np.lexsort(np.round(vertices, 4).T), np.lexsort(np.round(corners, 4).T)
    np.testing.assert_allclose(vertices[order[0]], corners[order[1]], atol=SINGLE)


@pytest.mark.parametrize(
    ("name", "flights", "error", "message"),
    [
        ("a.mcap", {"f": make_flight(RATES)}, InputError, r"suffix \.rrd, got '\.mcap'"),
        ("a.rrd", {}, InputError, "at least one flight"),
        ("absent/a.rrd", {"f": make_flight(IN2)}, StorageError, "is not a folder"),
    ],
)
def test_a_recording_that_can_not_be_made_is_refused(tmp_path, name, flights, error, message):
    """The fault is named and nothing is written."""
    with pytest.raises(error, match=message):
        write_recording(tmp_path / name, flights)
    assert list(tmp_path.iterdir()) == []


def test_a_model_without_a_free_body_is_refused(tmp_path):
    """A scene without a helicopter has nothing to draw, and no file stays."""
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(InputError, match="no free body"):
        write_recording(tmp_path / "a.rrd", {"f": make_flight()}, model=model)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_recording_leaves_nothing(tmp_path, monkeypatch):
    """A failure while logging removes the unfinished file."""

    def fail(*_args, **_options):
        raise KeyboardInterrupt

    monkeypatch.setattr(rr.RecordingStream, "send_columns", fail)
    with pytest.raises(KeyboardInterrupt):
        write_recording(tmp_path / "a.rrd", {"f": make_flight()})
    assert list(tmp_path.iterdir()) == []


def test_each_flight_of_a_recording_is_progress(tmp_path):
    """The caller is told each flight's name, in order."""
    reported = []
    flights = {"b": make_flight(), "a": make_flight(RATES)}
    write_recording(tmp_path / "a.rrd", flights, on_progress=reported.append)
    assert reported == ["b", "a"]


def test_a_missions_phases_are_in_the_log(tmp_path):
    """With their times, and where a manoeuvre begins that is flown on top."""
    record = make_flight(
        RATES,
        300,
        reached={"phases": [[0.02, "hover"], [1.5, "flare"]]},
        excitation={"kind": "Doublet", "axis": "lat", "trim_time": 1.0, "width": 0.5},
    )
    found = read(write_recording(tmp_path / "a.rrd", {"landing": record}))["/landing/log"]
    texts = [str(text) for text in found["TextLog:text"].ravel()]
    assert texts == ["hover", "lat doublet begins", "flare"]
    assert found["time"].tolist() == [20_000_000, 1_000_000_000, 1_500_000_000]


def test_flights_stand_side_by_side(tmp_path):
    """Each compared channel has one series a flight, as it was recorded."""
    flights = {"shipped gyro": make_flight(), "designed law": make_flight(n=150)}
    shown = read(write_recording(tmp_path / "two.rrd", flights, side_by_side=True))
    for name, record in flights.items():
        series = shown[f"/side_by_side/phi/{rr.escape_entity_path_part(name)}"]["Scalars:scalars"]
        np.testing.assert_allclose(
            np.ravel(series.tolist()), record["phi"], rtol=SINGLE, atol=SINGLE
        )


def test_only_what_every_flight_has_is_compared(tmp_path):
    """A channel that one flight lacks has no plot of all."""
    flights = {"a": make_flight(), "b": make_flight(("theta", "lat"))}
    shown = read(write_recording(tmp_path / "two.rrd", flights, side_by_side=True))
    found = {entity.split("/")[2] for entity in shown if entity.startswith("/side_by_side/")}
    assert found == {"theta", "lat"}
