"""The wrench of rotors and airframe: symmetry, dissipation, superposition."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from helisim.physics import flow as loads
from helisim.physics import motion as frames
from helisim.physics import rotor as main_rotor
from helisim.physics import rotor as tail_rotor
from helisim.physics.flow import Flow, wash
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import Velocities
from helisim.vehicle.trim import Motion, write_motion
from plates import H3_120

speed = st.floats(-4.0, 4.0)
stick = st.floats(-0.4, 0.4)
CALM = Velocities(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def activations(a=0.0, b=0.0, col=0.0, ped=0.0):
    act = np.zeros(len(STATE))
    act[STATE.flap_a], act[STATE.flap_b] = a, b
    act[STATE.front_position : STATE.tail_rate + 1 : 2] = [*H3_120.mix(col, 0.0, 0.0), ped]
    return act


def wrench(par, act, motion, speed_ratio=1.0):
    col, _, _ = H3_120.unmix(*act[STATE.front_position : STATE.tail_position : 2])
    pedal, a, b = act[[STATE.tail_position, STATE.flap_a, STATE.flap_b]]
    main = lifting(par, *motion, speed_ratio=speed_ratio, col=col, tips=(a, b))
    motion = Velocities(*motion)
    wake = wash(par, motion, main, speed_ratio)
    tail = tail_rotor.tail_rotor(par, motion, speed_ratio, pedal, wake.tail)
    flow = Flow(motion, motion, speed_ratio, main, tail, wake, CALM, 0.0, speed_ratio)
    return np.array(loads.wrench(par, a, b, flow, main.torque))


def lifting(
    par, u=0.0, v=0.0, w=0.0, p=0.0, q=0.0, r=0.0, *, speed_ratio=1.0, col=0.0, tips=(0.0, 0.0)
):
    motion = Velocities(u, v, w, p, q, r)
    return main_rotor.main_rotor(par, motion, speed_ratio, col, tips, (0.0, 0.0))


@given(speed_=st.floats(0.0, 8.0), heading=st.floats(-3.2, 3.2), w=speed, col=stick)
def test_rotor_has_no_favourite_heading(jr700, speed_, heading, w, col):
    """What it does depends on the airspeed in the disc, not on its direction; drag turns along."""
    numbers = jr700.model.actuator_user[jr700.model.actuator("rotor").id].copy()
    u, v = speed_ * math.cos(heading), speed_ * math.sin(heading)
    turned = lifting(numbers, u, v, w, col=col)
    ahead = lifting(numbers, speed_, 0.0, w, col=col)
    along = math.hypot(turned.drag_x, turned.drag_y)
    turned = turned._replace(drag_x=-along, drag_y=0.0)
    assert tuple(turned) == pytest.approx(tuple(ahead), rel=1e-9, abs=1e-9)  # rounding of hypot


def test_drag_is_half_rho_v_squared(par):
    """Drag along x at 10 m/s is rho/2 V^2 times the drag area, and points back."""
    force = wrench(par, activations(), (10.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0)
    # closed form; density and area from Table 1 and parameters.toml
    assert force == pytest.approx([-0.5 * 1.225 * 100.0 * 0.03, 0, 0, 0, 0, 0], abs=1e-12)


def test_stopped_rotor_has_no_hub_moment(par):
    moment = wrench(par, activations(0.1, -0.1), (0.0,) * 6, 0.0)
    assert moment == pytest.approx(np.zeros(6), abs=0.0)


@pytest.mark.parametrize(("a", "b"), [(0.02, 0.0), (0.0, 0.02)])
def test_hub_moment_is_spring_plus_tilted_thrust(par, a, b):
    """M = (K_beta + T h) a and L = (K_beta + T h) b for small tilt (design, section 3)."""
    par[[PARAM.main_induced_factor, PARAM.main_profile_drag, PARAM.main_lift_drag]] = 0.0
    par[PARAM.hub_cross] = 0.0  # no torque
    level = wrench(par, activations(), (0.0,) * 6)
    tilted = wrench(par, activations(a, b), (0.0,) * 6)
    thrust = -level[2]
    spring = par[PARAM.hub_stiffness] + thrust * 0.28
    # a slope x leans by x (1 - x^2 / 2): relative 2e-4 of T h, a quarter of the sum
    assert tilted[3] - level[3] == pytest.approx(spring * b, rel=5e-5)
    assert tilted[4] - level[4] == pytest.approx(spring * a, rel=5e-5)
    # thrust tilts back for a > 0 and right for b > 0
    lean = thrust / math.hypot(1.0, a, b)
    assert tilted[0] == pytest.approx(-lean * a, rel=1e-12, abs=1e-12)
    assert tilted[1] - level[1] == pytest.approx(lean * b, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_half_of_the_torque_tilts_with_the_disc(par, direction):
    """Drag of blades that flap, level with the hub and across each, summed over a turn."""
    a, b, drag, arm = 0.03, -0.02, 4.0, 0.5  # rad, rad, N on one blade, m
    azimuth = np.arange(36) * math.pi / 18.0
    out = np.stack([np.cos(azimuth), np.sin(azimuth), 0.0 * azimuth])  # in the hub's plane, FRD
    behind = direction * np.stack([np.sin(azimuth), -np.cos(azimuth), 0.0 * azimuth])
    # the disc is high ahead where it tilts back, and low on the right where it tilts right
    down = b * np.sin(azimuth) - a * np.cos(azimuth)
    place = arm * (out + down * np.array([[0.0], [0.0], [1.0]]))
    moment = 2.0 * np.mean(np.cross(place.T, drag * behind.T), axis=0)
    main = main_rotor.MainRotor(0.0, 2.0 * drag * arm, *[0.0] * 9)
    par[[PARAM.hub_stiffness, PARAM.hub_cross, PARAM.main_direction]] = 0.0, 0.0, direction
    found = loads.hub_wrench(par, a, b, main, 1.0, main.torque)
    # sines of the tilt, and its cosine in the arm: a^2 / 6 and a^2 / 2
    assert found[3:] == pytest.approx(moment, rel=1e-3)
    assert abs(found[3]) > 0.05


LENGTHS = "main_radius hub_x hub_z tail_radius tail_x tail_z drag_centre_x drag_centre_z fin_x "
LENGTHS += "fin_z tailplane_x tailplane_z"
AREAS = "drag_x drag_y drag_z fin_area tailplane_area"
SOLID = "pitch_volume yaw_volume"
MOMENTS = "hub_stiffness hub_cross"
TURNS = "main_speed tail_speed"
three = st.tuples(*[speed] * 3)


MORE = """hub_x 0.05 hub_cross 0.7 tail_z -0.06 tail_blockage 0.1 download 1.3
fin_z -0.1 fin_sine 0.1 drag_centre_x -0.1 drag_centre_z 0.05 pitch_volume 0.01 pitch_zero 0.05
yaw_volume 0.02 tailplane_area 0.01 tailplane_x -0.7 tailplane_z -0.03 tailplane_slope 3
tailplane_stall 1.1 tailplane_cosine 0.99 tailplane_sine -0.1"""
"""What the JR700 lacks: surfaces, moments and places off its axes."""


@pytest.fixture(scope="module")
def whole(jr700):
    par = jr700.model.actuator_user[jr700.model.actuator("rotor").id].copy()
    words = MORE.split()
    par[[getattr(PARAM, name) for name in words[::2]]] = np.array(words[1::2], dtype=float)
    return par


@given(moving=three, turning=three)
def test_each_part_feels_the_air_where_it_is(whole, moving, turning):
    """At r a part has the velocity v + omega x r, and r x F of moment beside its own."""
    par = whole
    tilt = 0.05, -0.03

    def hub(par, motion):
        main = main_rotor.main_rotor(par, motion, 1.0, 0.05, tilt, (0.02, 0.01))
        return [*loads.hub_wrench(par, *tilt, main, 1.0, 0.0), *wash(par, motion, main)]

    def tail(par, motion):
        return tail_rotor.tail_wrench(par, tail_rotor.tail_rotor(par, motion, 1.0, 0.1, 3.0))

    def fin(par, motion):
        return loads.fin(par, motion, 2.0)

    def tailplane(par, motion):
        return loads.tailplane(par, motion, 2.0)

    for part in (hub, tail, fin, tailplane):
        x, z = getattr(PARAM, f"{part.__name__}_x"), getattr(PARAM, f"{part.__name__}_z")
        at, bare = np.array([par[x], 0.0, par[z]]), par.copy()
        bare[[x, z]] = 0.0
        expected = np.array(part(bare, Velocities(*(moving + np.cross(turning, at)), *[0.0] * 3)))
        expected[3:6] += np.cross(at, expected[:3])
        found = part(par, Velocities(*moving, *turning))
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)  # rounding of 1e2 N


@given(size=st.floats(0.3, 3.0), density=st.floats(0.3, 3.0), moving=three, turning=three)
def test_loads_go_with_density_and_size(whole, size, density, moving, turning):
    """At the same speeds forces go with rho L^2 and moments with rho L^3 (Buckingham)."""
    par = whole
    act, other = activations(0.05, -0.03, 0.05, 0.1), par.copy()
    other[PARAM.air_density] *= density
    powers = {LENGTHS: size, AREAS: size**2, SOLID: size**3, TURNS: 1.0 / size}
    for names, factor in {**powers, MOMENTS: density * size**3}.items():
        other[[getattr(PARAM, name) for name in names.split()]] *= factor
    found = wrench(other, act, (*moving, *np.divide(turning, size)))
    expected = wrench(par, act, (*moving, *turning)) * density * size**2
    expected[3:] *= size
    # Newton's last step, and rounding of 1e2 N
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * density * size**2)


@given(faster=st.floats(1e-3, 10.0), moving=three, turning=three)
def test_loads_of_the_airframe_go_with_the_square_of_speed(whole, faster, moving, turning):
    par = whole
    motion = np.array([*moving, *turning])
    found = wrench(par, activations(), tuple(faster * motion), 0.0)
    expected = faster**2 * wrench(par, activations(), tuple(motion), 0.0)
    size = faster**2 * np.abs(motion).max() ** 2
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12 * size)  # rounding


@given(part=st.floats(0.0, 1.0))
def test_a_rotor_that_stops_fades_out(part):
    """Without a kink at either end, and alike from both: its share of the forces and the rest."""
    _, share = main_rotor.turning(part * main_rotor.STOPPED)
    _, rest = main_rotor.turning((1.0 - part) * main_rotor.STOPPED)
    assert share + rest == pytest.approx(1.0, rel=1e-14)
    assert 0.0 <= share <= 3.0 * part**2
    assert main_rotor.turning(-part)[1] == 0.0
    assert main_rotor.turning(main_rotor.STOPPED + part) == (main_rotor.STOPPED + part, 1.0)


# The frames: MuJoCo's forward-left-up and the field's forward-right-down.

ROUNDING = 1e-13
FREE = """
<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/>
<inertial pos="0 0 0" mass="2" diaginertia="0.2 0.3 0.4"/></body></worldbody></mujoco>
"""

number = st.floats(-20.0, 20.0)
roll = st.floats(-3.0, 3.0)
pitch = st.floats(-1.5, 1.5)
yaw = st.floats(-3.0, 3.0)


@pytest.fixture(scope="module")
def free():
    model = mujoco.MjModel.from_xml_string(FREE)
    return model, mujoco.MjData(model)


def placed(free, **motion):
    model, data = free
    write_motion(model, data, Motion(**motion))
    mujoco.mj_forward(model, data)
    return data.xmat[1].copy(), data


@given(phi=roll, theta=pitch, psi=yaw)
def test_euler_angles_are_scipys(free, phi, theta, psi):
    """Angles written through scipy's rotations come back out of MuJoCo's matrix."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    # near theta = pi/2 arcsine loses digits: 1e-16 / cos(theta)
    bound = ROUNDING / np.cos(theta)
    assert frames.euler_angles(matrix) == pytest.approx((phi, theta, psi), abs=bound)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_straight_up_and_down_are_right_angles(up):
    _, theta, _ = frames.euler_angles([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, up * (1.0 + 4e-16), 0.0, 0.0])
    assert theta == up * 0.5 * np.pi


@given(phi=roll, theta=pitch, psi=yaw, u=number, v=number, w=number)
def test_to_world_is_the_field_rotation(free, phi, theta, psi, u, v, w):
    """North, east and down of a body vector are those of the aerospace 3-2-1 rotation."""
    matrix, _ = placed(free, phi=phi, theta=theta, psi=psi)
    ned = frames.flip(*frames.to_world(matrix, u, v, w))
    direct = Rotation.from_euler("ZYX", [psi, theta, phi]).apply([u, v, w])
    assert ned == pytest.approx(direct, abs=1e-12)


def test_a_leaning_shaft_turns_velocities_and_forces(par):
    par[[PARAM.shaft_cosine, PARAM.shaft_sine]] = np.cos(0.1), np.sin(0.1)
    moving = frames.to_shaft(par, frames.Velocities(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    turn = Rotation.from_euler("y", -0.1).inv()
    assert moving == pytest.approx(turn.apply([[1, 2, 3], [4, 5, 6]]).ravel(), rel=1e-14)
    assert frames.from_shaft(par, frames.Wrench(*moving)) == pytest.approx(range(1, 7), rel=1e-14)
