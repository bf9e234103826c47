"""The wrench of rotors and airframe: symmetry, dissipation, superposition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.physics import flow as loads
from helisim.physics import rotor as main_rotor
from helisim.physics import rotor as tail_rotor
from helisim.physics.flow import Flow, wash
from helisim.physics.layout import PARAM, STATE
from helisim.physics.motion import Velocities
from plates import H3_120

speed = st.floats(-4.0, 4.0)
rate = st.floats(-2.0, 2.0)
tilt = st.floats(-0.2, 0.2)
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
    flow = Flow(motion, motion, speed_ratio, main, tail, wake, CALM, 0.0)
    return np.array(loads.wrench(par, a, b, flow, main.torque))


def lifting(
    par, u=0.0, v=0.0, w=0.0, p=0.0, q=0.0, r=0.0, *, speed_ratio=1.0, col=0.0, tips=(0.0, 0.0)
):
    """Return what the main rotor does, its swashplate level."""
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


@given(u=speed, v=speed, w=speed, p=rate, q=rate, r=rate)
def test_airframe_drag_takes_energy(jr700, u, v, w, p, q, r):
    """With the rotors stopped, every motion loses energy to the air, none gains."""
    numbers = jr700.model.actuator_user[jr700.model.actuator("rotor").id].copy()
    motion = (u, v, w, p, q, r)
    work = float(np.dot(wrench(numbers, activations(0.05, 0.05), motion, 0.0), motion))
    assert work <= 0.0
    if abs(u) > 0.1:
        assert work < 0.0


def test_drag_is_half_rho_v_squared(par):
    """Drag along x at 10 m/s is rho/2 V^2 times the drag area, and points back."""
    force = wrench(par, activations(), (10.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0)
    # closed form; density and area from Table 1 and parameters.toml
    assert force == pytest.approx([-0.5 * 1.225 * 100.0 * 0.03, 0, 0, 0, 0, 0], abs=1e-12)


def test_stopped_rotor_has_no_hub_moment(par):
    """A rotor that stands still has no tip-path plane: its hub spring does nothing."""
    moment = wrench(par, activations(0.1, -0.1), (0.0,) * 6, 0.0)
    assert moment == pytest.approx(np.zeros(6), abs=0.0)


@pytest.mark.parametrize(("a", "b"), [(0.02, 0.0), (0.0, 0.02)])
def test_hub_moment_is_spring_plus_tilted_thrust(par, a, b):
    """M = (K_beta + T h) a and L = (K_beta + T h) b for small tilt (design, section 3)."""
    par[[PARAM.main_induced_factor, PARAM.main_profile_drag, PARAM.hub_cross]] = 0.0  # no torque
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


def test_hub_velocity_drives_the_rotor(par):
    """The hub, 0.28 m above, moves right in a right roll and back in a nose-up pitch."""
    rolling = lifting(par, v=1.0, p=3.0)
    assert rolling == lifting(par, v=1.0 + 3.0 * 0.28)
    pitching = lifting(par, u=1.0, q=3.0)
    assert pitching == lifting(par, u=1.0 - 3.0 * 0.28)
