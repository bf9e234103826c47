"""The flight envelope: a limit ends a flight where it is exceeded; a healthy one stays."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helisim.base.errors import DivergedError
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim import FlightEnvelope, Sweep, fly, simulate
from helisim.sim.ground import Ground, outline
from helisim.sim.limits import Contact, hover_induced_velocity
from helisim.vehicle import load
from helisim.vehicle.parameters import model_folder
from tabled import tabled

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)


@pytest.fixture(scope="module")
def healthy(jr700):
    return next(simulate(jr700, SHORT, seed=3, jobs=1))


def test_a_rotors_rim_is_sixteen_points_round_its_disc(jr700):
    shape = outline(jr700)
    for (_, rim), (centre, axis, radius) in zip(shape.rims(), shape.discs, strict=True):
        off = rim - centre
        assert off.sum(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)
        assert off @ axis == pytest.approx(np.zeros(16), abs=1e-12)
        assert off @ off[0] == pytest.approx(radius**2 * np.cos(np.arange(16) * np.pi / 8.0))


@pytest.mark.parametrize(("sinking", "hard"), [(2.4, False), (2.6, True)])
def test_a_landing_is_hard_by_the_last_step_before_it_touches(jr700, sinking, hard):
    """Gear stands 2.5 m/s (14 CFR 27.725); nothing is said of a fall, or of what stands already."""
    contact, level = Contact(jr700, Ground()), np.eye(3)
    at = {k: (0.01 * k, np.array([0.0, 0.0, -9.0 + 0.01 * sinking * k]), level) for k in range(5)}
    assert [contact.found(*at[k], False) for k in range(3)] == [""] * 3
    said = f"the helicopter hit the ground at {sinking:g} m/s"
    assert contact.found(*at[3], True) == (said if hard else "")
    assert contact.found(*at[4], True) == ""


def changed(truth, row, **columns):
    new = {}
    for name, (column, by) in columns.items():
        new[name] = getattr(truth, name).copy()
        new[name][row:, column] += by
    return replace(truth, **new)


@tabled("columns", "says")
def test_each_limit_ends_the_flight_where_it_is_exceeded(jr700, healthy, columns, says):
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


@tabled("held", "over")
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
    place, turns = np.array([[0.0, 0.0, -height]]), np.array([[*attitude, 0.0]])
    shape = outline(vehicle)

    turned = turn.apply(-imu * [1.0, -1.0, -1.0])  # the body from the IMU, NED
    spec = mujoco.MjSpec.from_file(str(model_folder(name) / f"{name}.xml"))
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(type=plane, size=[0, 0, 1], contype=1, conaffinity=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    x, y, z, w = turn.as_quat()
    data.qpos[:] = [0.0, 0.0, -turned[2], w, x, -y, -z]  # so low that the gear is in the ground
    mujoco.mj_forward(model, data)
    gear = height + min(contact.dist for contact in data.contact)
    angle = np.linspace(0.0, 2.0 * np.pi, 100_000)
    c, s, zero, discs = np.cos(angle), np.sin(angle), 0.0 * angle, np.inf
    for hub, rotor, rim in (
        ("hub", "main_rotor", (c, s, zero)),
        ("tail_hub", "tail_rotor", (c, zero, s)),
    ):
        rim = vehicle.parameters[f"{rotor}.radius"] * np.array(rim).T
        arm = (vehicle.model.site(hub).pos - imu) * [1.0, -1.0, -1.0]
        discs = min(discs, height - turn.apply(arm + rim)[:, 2].max())
    # the rim's points are 6e-5 rad apart; MuJoCo's contact is exact to rounding
    for off, closer in ((1e-8, True), (-1e-8, False)):
        assert shape.closer_than(min(gear, discs) + off, place, turns).all() == closer


def test_the_record_goes_to_the_end_and_is_marked(jr700):
    with pytest.raises(DivergedError) as caught:
        fly(jr700, Sweep(axis="lat", amplitude=0.5, duration=20.0), jobs=1)
    record = caught.value.record
    end = record.provenance["ended"]
    assert record.ended == f"{end['why']} at {end['at']:.2f} s"
    assert str(caught.value).startswith(record.ended)
    assert 0.0 < end["at"] - record.time[-1] <= 0.01


def test_a_diverged_flight_on_the_command_line(tmp_path, capsys):
    out = tmp_path / "lat.parquet"
    asked = ["fly", "--axis", "lat", "--amplitude", "0.5", "--duration", "20", "--quiet"]
    asked += ["--set", "sweep.lat_w_min=0.8"]
    recording = tmp_path / "lat.rrd"
    assert main([*asked, "--out", str(out), "--rerun", str(recording)]) == 3
    assert recording.read_bytes().startswith(b"RRF2")
    error = capsys.readouterr().err
    assert error.startswith("helisim fly: the helicopter rolled or pitched beyond 1.2 rad at ")
    assert error.count("\n") == 1
    assert read_record(out).ended
    assert main([*asked, "--out", str(tmp_path / "many"), "--count", "2", "--jobs", "1"]) == 3
    assert capsys.readouterr().err.count("\n") == 2
