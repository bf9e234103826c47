"""The flight envelope: a limit ends a flight where it is exceeded; a healthy one stays."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helisim.base.errors import DivergedError, IdentificationError
from helisim.cli import main
from helisim.ident import RecordQualityWarning, frequency_response
from helisim.physics.native import installed
from helisim.records.record import ATTITUDES, POSITIONS
from helisim.records.storage import read_record, write_record
from helisim.sim import (
    Doublet,
    FlightEnvelope,
    FlightPlan,
    Pilot,
    ServoStuck,
    Step,
    Sweep,
    Weather,
    fly,
    simulate,
)
from helisim.sim.flight import fly_from
from helisim.sim.ground import outline
from helisim.sim.limits import hover_induced_velocity
from helisim.vehicle import load
from helisim.vehicle.folder import model_folder
from helisim.vehicle.trim import place

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
WILD = Sweep(axis="lat", amplitude=0.5, duration=20.0)


@pytest.fixture(scope="module")
def healthy(jr700):
    return next(simulate(jr700, SHORT, seed=3, jobs=1))


@pytest.fixture(scope="module")
def wild(jr700):
    """Half the stick on a lateral sweep, which turns the helicopter over."""
    with pytest.raises(DivergedError) as caught:
        fly(jr700, WILD, jobs=1)
    return caught.value


def changed(truth, row, **columns):
    """Return the truth with what is given added to some columns from a row on."""
    new = {}
    for name, (column, by) in columns.items():
        new[name] = getattr(truth, name).copy()
        new[name][row:, column] += by
    return replace(truth, **new)


def test_a_watched_flight_is_the_same_to_the_bit(jr700):
    """Watched or not, a healthy flight has the same numbers."""
    watched, unwatched = (
        fly(jr700, FlightPlan(excitation=SHORT, envelope=watch), seed=3, jobs=1)[0]
        for watch in (FlightEnvelope(), FlightEnvelope.off())
    )
    assert watched.values.tobytes() == unwatched.values.tobytes()
    assert not watched.ended


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"attitudes": (0, 1.3)}, "rolled or pitched beyond 1.2 rad"),
        ({"attitudes": (1, -1.3)}, "rolled or pitched beyond 1.2 rad"),
        ({"rates": (2, 21.0)}, "turned faster than 20 rad/s"),
        ({"positions": (2, 19.9)}, "touched the ground"),
        ({"flapping": (1, 0.36)}, "flapped beyond 0.35 rad"),
        ({"velocities": (0, 42.0)}, "advance ratio of 0.3"),
        ({"air": (1, 42.0)}, "advance ratio of 0.3"),
        ({"velocities": (2, 8.5)}, "2 times the hover's induced velocity"),
    ],
)
def test_each_limit_ends_the_flight_where_it_is_exceeded(jr700, healthy, columns, says):
    """At the first sample beyond it; one within it doesn't."""
    row, why = FlightEnvelope().end(jr700, changed(healthy, 1234, **columns))
    assert row == 1234
    assert says in why
    half = {name: (column, 0.5 * by) for name, (column, by) in columns.items()}
    assert FlightEnvelope().end(jr700, changed(healthy, 1234, **half)) is None
    assert FlightEnvelope.off().end(jr700, changed(healthy, 1234, **columns)) is None


def test_a_gust_from_below_is_a_descent(jr700, healthy):
    """What counts is the air's motion through the disc, and not where it passes across fast."""
    induced = hover_induced_velocity(jr700)
    # momentum theory: v_h^2 = W / (2 rho A), Table 1
    assert induced**2 == pytest.approx(8.01 * 9.8015 / (2 * 1.225 * np.pi * 0.767**2), rel=1e-9)
    gust = changed(healthy, 1000, air=(2, -2.1 * induced))
    assert FlightEnvelope().end(jr700, gust)[0] == 1000
    fast = changed(gust, 1000, velocities=(0, 1.5 * induced))
    assert FlightEnvelope().end(jr700, fast) is None


@pytest.mark.parametrize(
    ("held", "over"), [(0.98, None), (1.02, 0.02)], ids=["less than a second", "more"]
)
def test_saturation_that_lasts_ends_the_flight(jr700, healthy, held, over):
    """A second at the stop, not before; also in pieces, if they come within ten seconds."""
    stop = healthy.servo_commands.copy()
    steps, pieces = round(held / healthy.timestep), 4
    each = -(-steps // pieces)
    last = 0
    for k in range(pieces):
        first = 500 + 2 * k * each
        last = first + min(each, steps - k * each)
        stop[first:last, 3] = 0.5
    found = FlightEnvelope().end(jr700, replace(healthy, servo_commands=stop))
    if over is None:
        assert found is None
    else:
        row, why = found
        assert "had ped at its limit for 1 s of 10 s" in why
        # the window's sum passes a second so many steps before the last piece is over
        assert last - row == pytest.approx(over / healthy.timestep, abs=1.0)
        apart = replace(FlightEnvelope(), saturation_window=1.5)
        assert apart.end(jr700, replace(healthy, servo_commands=stop)) is None


def test_a_limit_cycle_is_a_saturation(jr700):
    """All of the base's delay inside the gyro's loop: its tail servo runs at full speed."""
    late = {"gyro.period": 0.001, "gyro.latency": 0.041, "gyro.lead": 0.0}
    with pytest.raises(DivergedError, match=r"servo_tail at its limit .* check the gyro's gains"):
        fly(load(parameters=late, timestep=0.001), Sweep(axis="ped", duration=12.0), jobs=1)


def test_a_stuck_tail_servo_ends_the_flight(jr700):
    """The heading turns away and the pedal's command stays at its stop."""
    stuck = ServoStuck(servo="servo_tail", at=3.0)
    with pytest.raises(DivergedError, match="ped at its limit"):
        fly(
            jr700,
            FlightPlan(excitation=Sweep(axis="ped", duration=20.0), faults=[stuck]),
            seed=1,
            jobs=1,
        )


def test_a_stuck_servo_that_nobody_watched_is_flagged(jr700):
    """The identification sees in the record that the pedal's command stayed at its stop."""
    stuck = ServoStuck(servo="servo_tail", at=10.0)
    sweep = Sweep(axis="ped", duration=20.0)
    record = fly(
        jr700,
        FlightPlan(excitation=sweep, faults=[stuck], envelope=FlightEnvelope.off()),
        seed=1,
        jobs=1,
    )[0]
    with pytest.warns(RecordQualityWarning, match="'ped' is at its stop for"):
        frequency_response(record, inputs="ped", outputs="r", band=(3.0, 20.0))


@pytest.mark.parametrize("attitude", [(0.0, 0.0), (0.4, 0.0), (-0.3, 0.7), (1.1, -1.0)])
@pytest.mark.parametrize("name", ["jr700", "blade360"])
def test_the_lowest_point_is_where_mujoco_touches(name, attitude):
    """The gear: how deep MuJoCo's own contact says that it is in a plane.

    Rotor discs, which collide with nothing in MuJoCo, are as low as a dense rim of points.
    """
    vehicle = load(name)
    imu = vehicle.model.site("imu").pos
    turn = Rotation.from_euler("ZYX", [0.0, attitude[1], attitude[0]])
    height = 3.0
    found = outline(vehicle).clearance(
        np.array([[0.0, 0.0, -height]]), np.array([[*attitude, 0.0]])
    )[0]
    turned = turn.apply(-imu * [1.0, -1.0, -1.0])  # the body from the IMU, NED
    spec = mujoco.MjSpec.from_file(str(model_folder(name) / f"{name}.xml"))
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=1, conaffinity=1
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    x, y, z, w = turn.as_quat()
    data.qpos[:] = [0.0, 0.0, -turned[2], w, x, -y, -z]  # so low that the gear is in the ground
    mujoco.mj_forward(model, data)
    gear = height + min(contact.dist for contact in data.contact)
    angle = np.linspace(0.0, 2.0 * np.pi, 100_000)
    own = vehicle.parameters
    rims = [
        (
            vehicle.model.site("hub").pos,
            own["main_rotor.radius"] * np.array([np.cos(angle), np.sin(angle), 0.0 * angle]),
        ),
        (
            vehicle.model.site("tail_hub").pos,
            own["tail_rotor.radius"] * np.array([np.cos(angle), 0.0 * angle, np.sin(angle)]),
        ),
    ]
    discs = min(
        height - turn.apply(((site - imu) * [1.0, -1.0, -1.0]) + rim.T)[:, 2].max()
        for site, rim in rims
    )
    # the rim's points are 6e-5 rad apart; MuJoCo's contact is exact to rounding
    assert found == pytest.approx(min(gear, discs), abs=1e-8)


def test_the_record_goes_to_the_end_and_is_marked(wild):
    """Time, reason and state stand in its provenance; the last second has the simulation's rate."""
    record, last = wild.record, wild.last_second
    end = record.provenance["ended"]
    assert record.ended == f"{end['why']} at {end['at']:.2f} s"
    assert str(wild).startswith(record.ended)
    assert 0.0 < end["at"] - record.time[-1] <= 0.01
    assert last.sample_time == pytest.approx(0.002, rel=1e-9)
    assert last.duration == pytest.approx(1.0, abs=0.003)
    assert 0.0 < end["at"] - last.time[-1] <= 0.002 + 1e-9
    tilt = np.abs(last.select(["phi", "theta"])).max(axis=1)
    assert 1.15 < tilt[-1] <= 1.2
    # the same flight: what the recorder saw at 100 Hz, without its filter and noise
    common = record.time[record.time >= last.time[0]]
    assert np.interp(common, last.time, last["phi"]) == pytest.approx(
        record["phi"][-common.size :], abs=0.05
    )


def test_the_state_at_the_end_flies_on_as_the_flight_did(jr700, wild):
    """It is MuJoCo's full physics state at the last sample."""
    state = np.array(wild.record.provenance["ended"]["state"])
    data = mujoco.MjData(jr700.model)
    mujoco.mj_setState(jr700.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    with installed():
        mujoco.mj_forward(jr700.model, data)
    last = wild.last_second
    assert data.time == pytest.approx(last.time[-1], abs=1e-9)
    rates = data.sensor("imu_gyro").data * [1.0, -1.0, -1.0]
    assert rates == pytest.approx(last.select(["p", "q", "r"])[-1], abs=1e-12)


def test_a_mujoco_warning_ends_the_flight_by_its_name(jr700, monkeypatch, tmp_path):
    """A velocity that grows without bound: MuJoCo warns of it, and the flight says of what."""
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its MUJOCO_LOG.TXT
    model = copy.copy(jr700.model)
    data = mujoco.MjData(model)
    place(model, data, jr700.trim)
    data.qvel[0] = 9.9999999e9  # m/s; MuJoCo takes 1e10 for broken
    model.opt.gravity[0] = 1e12
    start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    plan = FlightPlan(excitation=Step(axis="lat"), envelope=FlightEnvelope.off())
    truth = fly_from(jr700, plan, model, start, jr700.trim)
    assert "MuJoCo warned of BAD" in truth.end.why
    assert truth.time.size < 20
    assert np.isfinite(truth.end.state).all()


def test_the_identification_refuses_a_flight_that_was_over(jr700, tmp_path, wild):
    """By its place among the records; told to, it takes it, as it does without the mark."""
    good = fly(jr700, Sweep(axis="lat", duration=20.0), seed=3, jobs=1)[0]
    asked = {"inputs": "LAT", "outputs": "p", "band": (10.0, 30.0)}
    with pytest.raises(IdentificationError, match=r"record 2 .*terminated early.*use_ended"):
        frequency_response([good, wild.record], **asked)
    allowed = frequency_response([good, wild.record], **asked, use_ended=True)
    unmarked = replace(wild.record, provenance={})
    assert np.array_equal(allowed.response, frequency_response([good, unmarked], **asked).response)
    part = wild.record.slice(0.0, 3.0)
    with pytest.raises(IdentificationError, match="record 1"):
        frequency_response(part, **asked)


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_the_commands_refuse_it_too(tmp_path, capsys, wild, suffix):
    """`identify` and `frf` name the file, also where a map says which column is which."""
    path = tmp_path / f"wild{suffix}"
    write_record(wild.record, path)
    asked = ["frf", str(path), "--inputs", "LAT", "--outputs", "p", "--band", "10", "30"]
    for further in ([], ["--channel", f"p={'p [rad/s]' if suffix == '.csv' else 'p'}"]):
        assert main([*asked, *further]) == 2
        error = capsys.readouterr().err
        assert str(path) in error
        assert "--use-ended" in error
        assert error.count("\n") == 1
    assert main([*asked, "--use-ended"]) == 0


def test_a_diverged_flight_on_the_command_line(tmp_path, capsys):
    """One line, status 3, the record marked and its last second beside it."""
    out = tmp_path / "lat.parquet"
    asked = ["fly", "--axis", "lat", "--amplitude", "0.5", "--duration", "20", "--quiet"]
    recording = tmp_path / "lat.rrd"
    assert main([*asked, "--out", str(out), "--rerun", str(recording)]) == 3
    assert recording.read_bytes().startswith(b"RRF2")
    error = capsys.readouterr().err
    assert error.startswith("helisim fly: the helicopter rolled or pitched beyond 1.2 rad at ")
    assert error.count("\n") == 1
    assert read_record(out).ended
    assert read_record(tmp_path / "last_second" / "lat.parquet").duration > 0.99
    assert main([*asked, "--out", str(tmp_path / "many"), "--count", "2", "--jobs", "1"]) == 3
    assert capsys.readouterr().err.count("\n") == 2
    limits = ["--envelope", "tilt=off", "--envelope", "rate=off", "--envelope", "saturation=off"]
    further = [
        "--envelope",
        "clearance=off",
        "--envelope",
        "descent=off",
        "--envelope",
        "advance=off",
    ]
    asked[asked.index("--duration") + 1] = "13"
    assert main([*asked, "--out", str(out), *limits, *further, "--envelope", "flapping=off"]) == 0
    assert main([*asked, "--out", str(out), "--envelope", "off"]) == 0
    assert not read_record(out).ended


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("speed=3", "tilt, rate"),
        ("tilt=-1", "must be a number above 0 rad"),
        ("rate=0", "above 0"),
        ("saturation_window=off", "number"),
        ("tilt=x", "number"),
        ("tilt", "number"),
    ],
)
def test_a_bad_limit_is_one_line(tmp_path, capsys, text, says):
    """With the limits that there are, and nothing is flown."""
    asked = ["fly", "--axis", "lat", "--out", str(tmp_path / "a.parquet"), "--envelope", text]
    assert main(asked) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_flight_that_starts_beyond_a_limit_is_no_record(jr700):
    """There is nothing to keep, and the message is the same."""
    with pytest.raises(DivergedError, match=r"came within 30 m of the ground at 0\.00 s") as caught:
        fly(jr700, FlightPlan(excitation=SHORT, envelope=FlightEnvelope(clearance=30.0)), jobs=1)
    assert caught.value.record is None


def test_the_ground_ends_a_flight(jr700):
    """A swashplate servo that sticks low: it is over when gear or disc is at height 0."""
    manoeuvre = Doublet(axis="ped", amplitude=1e-6, duration=12.0)
    low = ServoStuck(servo="servo_front", at=1.0, position=-0.02)
    weather = Weather(height=2.0)
    with pytest.raises(DivergedError, match="touched the ground") as caught:
        fly(
            jr700,
            FlightPlan(
                excitation=manoeuvre, pilot=Pilot(remnant=0.0), faults=[low], weather=weather
            ),
            jobs=1,
        )
    last = caught.value.last_second
    height = outline(jr700).clearance(last.select(POSITIONS), last.select(ATTITUDES))
    sinking = last["w"][-1]
    assert sinking > 0.1
    assert 0.0 <= height[-1] <= 2.0 * sinking * last.sample_time
