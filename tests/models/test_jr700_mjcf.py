"""The JR700's MJCF: what it weighs, what it is called, and that stock MuJoCo runs it."""

import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from helisim.physics.layout import PARAM, STATE
from helisim.vehicle import standard_parameters

FOLDER = Path(__file__).parents[2] / "models" / "jr700"
VEHICLE = FOLDER / "jr700.xml"
SCENE = FOLDER / "scene.xml"

STICKS = ["COL", "LON", "LAT", "PED"]
SERVOS = ["servo_front", "servo_left", "servo_right", "servo_tail"]
# The rigid body's state lives in qpos and qvel; these are the states of the callbacks' laws.
STATES = dict.fromkeys(STICKS, 0) | dict.fromkeys(SERVOS, 2) | {"rotor": 50}
SENSORS = {
    "imu_gyro": 3,
    "imu_accelerometer": 3,
    "imu_velocity": 3,
    "imu_attitude": 4,
    "imu_position": 3,
    "gyro_rate": 3,
    "stick": 4,
    "servo_command": 4,
    "servo_position": 4,
    "flapping": 2,
    "rotor": 5,
    "power": 4,
    "air": 6,
    "contact": 3,
    "clock": 1,
}
SAFETY_BARS = ["safety_bar_1", "safety_bar_2"]

# The fuselage's closing numbers are written with 12 digits: what is left is rounding.
ROUNDING = 1e-9


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_path(str(VEHICLE))


@pytest.fixture
def level(model):
    """The vehicle at the height of its hover and level: body axes and world axes agree."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.qpos[3:7] = [1.0, 0.0, 0.0, 0.0]
    mujoco.mj_forward(model, data)
    return data


def turned_inertia(model, data, body):
    turn = data.ximat[body].reshape(3, 3)
    return turn @ np.diag(model.body_inertia[body]) @ turn.T


def warnings_of(data):
    return {str(mujoco.mjtWarning(i)): w.number for i, w in enumerate(data.warning) if w.number}


def test_total_mass(model):
    """The vehicle weighs the 8.01 kg of the paper's Table 1."""
    assert model.body_subtreemass[model.body("jr700").id] == pytest.approx(8.01, abs=ROUNDING)


def test_centre_of_gravity_is_the_frame_of_the_vehicle(model, level):
    """The vehicle's frame sits at its centre of gravity, so trim and records need no offset."""
    offset = level.body("jr700").subtree_com - level.body("jr700").xpos
    # Weight on a micrometre is 8e-5 N m: what the hub (108 N m/rad) makes of a microradian.
    np.testing.assert_allclose(offset, 0.0, atol=1e-6)


def test_total_inertia(model, level):
    """About the centre of gravity: 0.200, 0.3424, 0.4185 kg m2, and no product of inertia."""
    origin = level.body("jr700").xpos
    inertia = np.zeros((3, 3))
    for body in range(1, model.nbody):
        r = level.xipos[body] - origin
        inertia += turned_inertia(model, level, body)
        inertia += model.body_mass[body] * (r @ r * np.eye(3) - np.outer(r, r))
    moments = np.diag(inertia)
    # The values have four digits; a calibration that solves for more may rewrite them.
    np.testing.assert_allclose(moments, [0.200, 0.3424, 0.4185], rtol=1e-3)
    np.testing.assert_allclose(inertia - np.diag(moments), 0.0, atol=ROUNDING)


def rigid_body_matrix(model):
    """MuJoCo's own mass matrix at the hover keyframe."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


def test_mujoco_feels_one_rigid_body(model):
    """The welded parts act as one body whose mass matrix is diagonal."""
    expected = np.diag([8.01, 8.01, 8.01, 0.200, 0.3424, 0.4185])
    # As above; the mass times the centre's micrometre is the largest coupling allowed.
    np.testing.assert_allclose(rigid_body_matrix(model), expected, rtol=1e-3, atol=8.01e-6)


def test_lean_copy_flies_the_same(model):
    """Without drawn geoms and with its parts fused, the model keeps its dynamics and its names."""
    spec = mujoco.MjSpec.from_file(str(VEHICLE))
    spec.compiler.discardvisual = True
    spec.compiler.fusestatic = True
    lean = spec.compile()
    assert (lean.nbody, lean.ngeom) == (2, 4)  # world and vehicle; two skids, two bars
    np.testing.assert_allclose(rigid_body_matrix(lean), rigid_body_matrix(model), atol=ROUNDING)
    for kind, count in (("site", "nsite"), ("sensor", "nsensor"), ("actuator", "nu")):
        names = [getattr(model, kind)(i).name for i in range(getattr(model, count))]
        assert [getattr(lean, kind)(i).name for i in range(getattr(lean, count))] == names
    assert np.array_equal(lean.site_pos, model.site_pos)


def test_fuselage_that_closes_the_balance_is_a_possible_body(model):
    """The fuselage has positive inertia, obeys the triangle inequality, and is of its size."""
    body = model.body("fuselage")
    assert body.mass[0] > 0
    moments = np.sort(body.inertia)
    assert moments[0] > 0
    assert moments[0] + moments[1] > moments[2]
    gyration = np.sqrt(moments / body.mass[0])
    # The canopy is 0.48 m long, the frame 0.22 m high: its radii of gyration lie between a solid
    # 0.2 m ball's (0.06 m) and half its length.
    assert np.all(gyration > 0.06)
    assert np.all(gyration < 0.24)
    assert np.linalg.norm(body.ipos) < 0.05  # inside the frame, near the mast


def test_fuselage_inertial_is_one_line_that_a_calibration_can_rewrite():
    """The closing element is the first inertial inside the body fuselage, on one line."""
    after = VEHICLE.read_text().partition('<body name="fuselage">')[2]
    line = next(text.strip() for text in after.splitlines() if "<inertial" in text)
    assert line.endswith("/>")
    assert all(f'{name}="' in line for name in ("pos", "mass", "fullinertia"))


def test_parts_are_named(model):
    """Each part that a person would point at is a body with its own mass."""
    parts = [
        "fuselage",
        "boom",
        "head",
        "rotor",
        "tail",
        "battery",
        "flight_computer",
        "gyro",
        "skids",
        *SAFETY_BARS,
    ]
    assert all(model.body(part).mass[0] > 0 for part in parts)


@pytest.mark.parametrize("bar", SAFETY_BARS)
def test_safety_bars(model, level, bar):
    """Each bar is 1.5 m long and weighs 0.18 kg (paper, section 2)."""
    body, rod = model.body(bar), model.geom(bar)
    assert body.mass[0] == pytest.approx(0.18)
    assert 2 * rod.size[1] == pytest.approx(1.5)
    # A thin uniform rod's m l^2 / 12; its 10 mm thickness adds 3e-5 of that.
    assert body.inertia.max() == pytest.approx(0.18 * 1.5**2 / 12, rel=1e-4)


def test_safety_bars_cross_at_right_angles_under_the_fuselage(level):
    """The bars lie level, crossed, on the landing gear."""
    axes = [level.geom(bar).xmat.reshape(3, 3)[:, 2] for bar in SAFETY_BARS]
    # The angles are written with seven digits.
    assert abs(axes[0] @ axes[1]) < 1e-6
    assert all(abs(axis[2]) < 1e-6 for axis in axes)
    height = [level.geom(bar).xpos[2] - level.body("jr700").xpos[2] for bar in SAFETY_BARS]
    assert max(height) < -0.1


def test_imu_is_off_the_centre_of_gravity_and_inside_the_flight_computer(model, level):
    """The lever arm exists, and the IMU is where the recorder is."""
    arm = level.site("imu").xpos - level.body("jr700").xpos
    np.testing.assert_allclose(arm, [0.08, 0.01, -0.12], atol=1e-12)
    box = model.geom("flight_computer")
    assert np.all(np.abs(level.site("imu").xpos - level.geom("flight_computer").xpos) < box.size)


def test_rotor_places_and_sizes(model, level):
    """Hubs and discs have the radii of Table 1 and sit at the hub sites."""
    centre = level.body("jr700").xpos
    np.testing.assert_allclose(level.site("hub").xpos - centre, [0, 0, 0.28], atol=1e-12)
    np.testing.assert_allclose(level.site("tail_hub").xpos - centre, [-0.90, 0, 0], atol=1e-12)
    assert model.geom("rotor_disc").size[0] == 0.767
    assert model.geom("tail_rotor_disc").size[0] == 0.137
    np.testing.assert_allclose(level.geom("rotor_disc").xpos, level.site("hub").xpos, atol=1e-12)
    assert 0 < model.mat_rgba[model.geom("rotor_disc").matid[0], 3] < 0.5  # one sees through it


def test_fuselage_length(model, level):
    """From nose to tail 1.332 m (Table 1, whose unit is misprinted)."""
    x = []
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        if model.body(model.geom_bodyid[geom]).name in ("fuselage", "tail"):
            start = model.mesh_vertadr[model.geom_dataid[geom]]
            points = model.mesh_vert[start : start + model.mesh_vertnum[model.geom_dataid[geom]]]
            x.append(
                (points @ level.geom_xmat[geom].reshape(3, 3).T)[:, 0] + level.geom_xpos[geom, 0]
            )
    x = np.concatenate(x)
    # Mesh files are written to 10 micrometres, and read as single precision.
    assert x.max() - x.min() == pytest.approx(1.332, abs=2e-5)


def test_actuators(model):
    """Names, order and number of states are those that helisim's callbacks look for."""
    assert [model.actuator(i).name for i in range(model.nu)] == [*STICKS, *SERVOS, "rotor"]
    assert dict(zip(STATES, model.actuator_actnum.tolist(), strict=True)) == STATES
    assert np.all(model.actuator_dyntype[model.actuator_actnum > 0] == mujoco.mjtDyn.mjDYN_USER)
    assert np.all(model.actuator_ctrlrange[:4] == [-0.5, 0.5])
    assert np.all(model.actuator_ctrlrange[4:8] == [-1.0, 1.0])
    assert np.all(model.actuator_ctrlrange[8] == [0.0, 1.2])


def test_only_the_pedal_is_delayed(model):
    """PED reaches the yaw gyro 23 ms late through MuJoCo's own history buffer."""
    delays = dict(zip([*STICKS, *SERVOS, "rotor"], model.actuator_delay, strict=True))
    assert delays.pop("PED") == standard_parameters("jr700")["gyro.ped_latency"]
    assert not any(delays.values())


def test_actuators_make_no_force(model, level):
    """Without callbacks the sticks move nothing: the vehicle falls freely."""
    level.ctrl[:] = model.actuator_ctrlrange[:, 1]
    mujoco.mj_forward(model, level)
    np.testing.assert_allclose(level.qacc, [0, 0, -9.8015, 0, 0, 0], atol=1e-5)


def test_sensors(model):
    """Names, order and sizes of the sensors; the user sensors are contiguous."""
    names = {model.sensor(i).name: int(model.sensor_dim[i]) for i in range(model.nsensor)}
    assert names == SENSORS
    assert list(names) == list(SENSORS)
    users = np.flatnonzero(model.sensor_type == mujoco.mjtSensor.mjSENS_USER)
    assert [model.sensor(i).name for i in users] == list(SENSORS)[6:-1]
    assert np.all(model.sensor_needstage[users] == mujoco.mjtStage.mjSTAGE_ACC)


def test_room_for_parameters_and_state(model):
    """The callbacks keep parameters in the actuators' user data and memory in mjData's."""
    assert model.nuser_actuator == len(PARAM)


def test_options(model):
    """MuJoCo adds no air, and never resets a diverged flight by itself."""
    assert model.opt.timestep == 0.002
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert model.opt.density == model.opt.viscosity == 0
    assert list(model.opt.gravity) == [0, 0, -9.8015]
    assert model.opt.disableflags == mujoco.mjtDisableBit.mjDSBL_AUTORESET


def test_hover_keyframe(model):
    """Hover: 10 m up, rolled against the tail's thrust, at rest, sticks centred, full speed."""
    key = model.key("hover")
    assert list(key.qpos[:3]) == [0, 0, 10]
    # tail thrust over weight is 5.25 N / 78.5 N, to the right: 3.8 degrees, half of that here; the
    # tail's torque, 59 W / 840 rad/s, pitches the disc back over a hub of 108 N m/rad, and the
    # nose down by as much
    nose_down = 59.0 / 840.2 / 108.0
    wanted = [0.99944, 0.03345, 0.5 * nose_down, 0]
    assert key.qpos[3:] == pytest.approx(wanted, abs=1.2e-5)  # and yaw, of both turns
    assert not np.any(key.qvel)
    # calibration centres collective and pedals in the hover; the cyclic holds the tail's torque
    plate = key.ctrl[4:7]
    assert key.ctrl == pytest.approx([*[0] * 4, *plate, 0, 1], abs=1e-9)
    assert plate == pytest.approx(0, abs=0.003)
    assert plate.sum() == pytest.approx(0, abs=1e-9)
    assert key.act[: STATE.flap_a : 2] == pytest.approx([*plate, 0], abs=1e-9)
    assert key.act[STATE.flap_a] == pytest.approx(nose_down, rel=0.02)
    assert np.linalg.norm(key.act[STATE.feels_x : STATE.felt_x]) == pytest.approx(9.8015, rel=1e-9)


def test_only_skids_and_bars_collide_and_never_with_the_vehicle(model):
    """In the air a step pays for no contact."""
    touching = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    owners = {model.body(model.geom_bodyid[i]).name for i in touching}
    assert owners == {"skids", *SAFETY_BARS}
    assert not np.any(model.geom_contype)  # two geoms of the vehicle can never meet
    assert np.all(model.geom_group[touching] == 3)


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
def test_compiles_silently(file, tmp_path):
    """Loading prints nothing, and leaves no MuJoCo log behind."""
    code = "import sys, mujoco; mujoco.MjModel.from_xml_path(sys.argv[1])"
    run = subprocess.run(
        [sys.executable, "-W", "always::UserWarning", "-c", code, str(file)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("file", [VEHICLE, SCENE], ids=lambda path: path.stem)
@pytest.mark.parametrize("start", ["hover", None], ids=["hover", "ground"])
def test_runs_under_random_control_without_a_warning(file, start):
    """Two seconds of pseudo-random control without callbacks raise no warning."""
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    if start:
        mujoco.mj_resetDataKeyframe(model, data, model.key(start).id)
    random = np.random.default_rng(7)
    low, high = model.actuator_ctrlrange.T
    while data.time < 2.0:
        data.ctrl[:] = random.uniform(low, high)
        mujoco.mj_step(model, data)
    assert warnings_of(data) == {}
    assert np.all(np.isfinite(data.qpos))


def test_stands_on_its_skids():
    """In the scene it settles on the skids, upright, and stays."""
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    data = mujoco.MjData(model)
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    # Skids' underside 0.196 m below the centre of gravity; soft contact gives way by a few mm.
    assert data.qpos[2] == pytest.approx(0.196, abs=5e-3)
    assert abs(data.body("jr700").xmat[8] - 1.0) < 1e-4
    assert np.abs(data.qvel).max() < 1e-3
