"""A vehicle whose rotor speed moves: trim, linear model, stock MuJoCo, what it needs to be told."""

import mujoco
import numpy as np
import pytest

from command import fails
from helisim.base.errors import ModelError, TrimError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.build import write_numbers
from own_vehicle import copied, edited
from tabled import tabled

MOTOR = {"drive.governor": "motor"}


@pytest.fixture(scope="module")
def motor():
    """The JR700 with its electric motor."""
    return load("jr700", parameters=MOTOR)


def largest_difference(name, response, low, high):
    """Return by how much a frequency response with the motor differs from the ideal, relative."""
    omega = np.geomspace(low, high, 60)
    output, cause = response.split("/")
    found = []
    for parameters in ({}, MOTOR):
        linear = load(name, parameters=parameters).linearize()
        labels = linear.system.output_labels, linear.system.input_labels
        row, column = (known.index(one) for known, one in zip(labels, (output, cause)))
        found.append(linear.response(omega)[row, column])
    return np.abs(found[1] / found[0] - 1.0).max()


@pytest.mark.parametrize("name", ["jr700", "blade360"])
@tabled("response", "band", "most")
def test_the_hover_s_responses_are_those_of_the_ideal_governor(name, response, band, most):
    """From 3 rad/s up, where the paper's structures hold, an electric motor changes little.

    Its own mode, of back-EMF and governor against the inertia, is at 50 rad/s (JR700) and 36 rad/s
    (Blade 360); up to there speed and collective part by the motor's resistance alone, 1 % of
    w/col. Cyclic takes no power to first order. The tail's torque comes from the motor below that
    mode, and above it out of the main rotor's inertia, on whose mast the body is: r/ped is 9 %
    larger there, and by half of it in phase or gain an octave or two below. Below that mode the
    motor turns the blades with the body, above it the body is without them, 17 % of what is left.
    A body that yaws changes the rotor's speed through the air: 2 Q / Omega of yaw damping, and what
    collective yaws comes back in w/col, to 5 %.
    """
    assert largest_difference(name, response, *band) < most


def test_the_motor_s_own_mode_is_that_of_its_data(motor):
    """d(speed rate)/d(speed): back-EMF against resistance and inertia, and 2 Q / (I Omega) of air.

    The closed form of a motor's data sheet; 2 %: the torque of the rotor doesn't go with the
    square of its speed exactly, at a collective that is held.
    """
    own = motor.parameters
    spin, inertia = own["main_rotor.speed"], own["drive.inertia"]
    per_speed = (own["drive.gear"] / own["drive.speed_constant"]) ** 2 / own["drive.resistance"]
    _, main, tail, _ = power_of(motor)
    wanted = -(per_speed + 2.0 * (main + tail) / spin / spin) / inertia
    assert motor.linearize().derivative("speed", "speed") == pytest.approx(wanted, rel=0.02)


def power_of(vehicle):
    data = vehicle.hovering()
    with installed():
        mujoco.mj_forward(vehicle.model, data)
    return data.sensor("power").data.copy()


def test_the_trim_s_throttle_is_that_of_the_torque(motor, jr700):
    own = motor.parameters
    drive, main, tail, _ = power_of(motor)
    assert drive == pytest.approx(main + tail, rel=1e-9)
    torque = drive / own["main_rotor.speed"] + own["drive.friction"]
    current = torque / own["drive.gear"] * own["drive.speed_constant"]
    current += own["drive.no_load_current"]
    emf = own["main_rotor.speed"] * own["drive.gear"] / own["drive.speed_constant"]
    volts = emf + current * own["drive.resistance"]
    assert motor.trim.throttle == pytest.approx(volts / own["drive.voltage"], rel=1e-12)
    assert jr700.trim.throttle == 0.0
    assert motor.trim.col == jr700.trim.col


def test_stock_mujoco_starts_in_the_trim_or_from_rest(tmp_path):
    own = copied(tmp_path / "own")
    edited(own, "parameters.toml", 'governor = { value = "ideal"', 'governor = { value = "motor"')
    write_numbers(own)
    model = mujoco.MjModel.from_xml_path(str(own / "jr700.xml"))
    data, where = mujoco.MjData(model), addresses(model)
    states = slice(where.state + STATE.speed, where.state + STATE.governor + 1)
    with installed():
        mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
        settled = data.act[states].copy()
        for _ in range(500):
            mujoco.mj_step(model, data)
        assert data.act[states] == pytest.approx(settled, abs=1e-8)  # digits of the keyframe
        assert settled[0] == 1.0
        mujoco.mj_resetData(model, data)
        assert not np.any(data.act[states])
        data.ctrl[where.control + 8] = 1.0
        model.opt.gravity[:] = 0.0  # not to fall through air that would turn the rotor
        speeds = []
        for _ in range(1000):
            mujoco.mj_step(model, data)
            speeds.append(data.act[states][0])
    assert np.all(np.diff(speeds) >= 0.0)
    assert 0.1 < speeds[-1] < 0.4


def test_euler_steps_fly_the_motor_as_runge_kutta_does(motor):
    """A step of collective in the hover: 2e-5 of the speed, the staggered step's second order."""
    histories = []
    for name in ("RK4", "Euler"):
        vehicle = load("jr700", parameters=MOTOR, integrator=name)
        data = vehicle.hovering()
        where = addresses(vehicle.model)
        data.ctrl[where.control] += 0.05
        speeds = []
        with installed():
            for _ in range(500):
                mujoco.mj_step(vehicle.model, data)
                speeds.append(data.act[where.state + STATE.speed])
        histories.append(speeds)
    one, other = map(np.array, histories)
    assert np.abs(one - 1.0).max() > 5e-4
    assert np.abs(one - other).max() < 2e-5


def test_a_motor_needs_its_numbers_and_its_power(tmp_path, capsys):
    with pytest.raises(TrimError, match=r"hover takes a torque of 5\..* N m .* full throttle"):
        load(parameters={**MOTOR, "drive.voltage": 30.0})
    own = copied(tmp_path / "own")
    text = (own / "parameters.toml").read_text()
    start = text.index("# What turns the rotor")
    (own / "parameters.toml").write_text(text[:start] + text[text.index("[servo]") :])
    assert load(own).trim.throttle == 0.0
    with pytest.raises(ModelError, match=r"positive drive\.inertia \(kg m\^2\), got 0"):
        load(own, parameters=MOTOR)
    assert "drive.inertia" in fails(capsys, "vehicle", "trim", own, "--set", "drive.governor=motor")
