"""The main rotor's three planes: blades summed over the disc, energy, drag in the hub's plane."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import fsolve

from helisim.physics import rotor as rotors
from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities
from tabled import tabled

speed = st.floats(-25.0, 25.0)
sinking = st.floats(-8.0, 16.0)
tilt = st.floats(-0.15, 0.15)
stick = st.floats(-0.5, 0.5)


@pytest.fixture(scope="module")
def numbers(jr700):
    return jr700.model.actuator_user[jr700.model.actuator("rotor").id].copy()


def turning(par, u=0.0, v=0.0, w=0.0, *, col=0.0, tips=(0.0, 0.0), swashplate=(0.0, 0.0)):
    motion = Velocities(u, v, w, 0.0, 0.0, 0.0)
    return rotors.main_rotor(par, motion, 1.0, col, tips, swashplate)


def test_thrust_is_that_of_the_blades_summed_over_the_disc(numbers):
    """A blade that flaps and feathers, element by element around the shaft: 300 x 72 of them.

    In shaft axes u_T = r + mu sin psi and u_P = lambda + r dbeta/dpsi + mu beta cos psi, psi
    from the rear, the advancing blade on the right: lift a sigma / 2 (u_T^2 theta - u_T u_P).
    """
    par = numbers.copy()
    par[PARAM.main_twist], par[PARAM.main_stall], par[PARAM.main_mach] = -0.15, 1e3, 0.0
    tip = par[PARAM.main_speed] * par[PARAM.main_radius]
    cyclic_sine, cyclic_cosine, flap_cosine, flap_sine = 0.06, -0.03, 0.02, 0.04
    main = turning(
        par,
        0.2 * tip,
        0.0,
        0.01 * tip,
        tips=(-flap_cosine, -flap_sine),
        swashplate=(cyclic_sine, -cyclic_cosine),
    )
    r = (np.arange(300) + 0.5)[:, None] / 300
    psi = np.arange(72) * 2.0 * math.pi / 72
    sine, cosine = np.sin(psi), np.cos(psi)
    pitch = par[PARAM.main_pitch_trim] - 0.15 * (r - 0.75)
    pitch = pitch + cyclic_sine * sine + cyclic_cosine * cosine
    flap = 0.05 + flap_cosine * cosine + flap_sine * sine
    flapping = flap_sine * cosine - flap_cosine * sine
    across = r + 0.2 * sine
    down = main.induced - 0.01 + r * flapping + 0.2 * flap * cosine
    slope = 0.5 * par[PARAM.main_lift_slope] * par[PARAM.main_solidity]
    summed = slope * np.mean(across**2 * pitch - across * down)
    force = par[PARAM.air_density] * math.pi * par[PARAM.main_radius] ** 2 * tip**2
    # 300 strips leave 1 / (24 x 300^2) of the second derivative along the blade
    assert main.thrust / force == pytest.approx(summed, rel=1e-5)


@tabled("airspeed", "sinks", "col", "twist")
def test_torque_is_that_of_the_blades_in_equilibrium(numbers, airspeed, sinks, col, twist):
    """Free blades that flap until no moment is left, their drag aside: work and force in the plane.

    Lift leans with its local flow, u_P / u_T, and turns or drives the shaft: a sigma / 2
    (u_T u_P theta - u_P^2) r, summed on the tips' plane with the feathering, coning and uniform
    inflow that hold it. The force laws leave coning out here, which moves the force by 0.07 N.
    """
    par = numbers.copy()
    par[PARAM.main_induced_factor], par[PARAM.main_profile_drag] = 1.0, 0.0
    par[[PARAM.main_lift_drag, PARAM.main_mach]], par[PARAM.main_twist] = 0.0, twist
    tip = par[PARAM.main_speed] * par[PARAM.main_radius]
    mu, climb = airspeed / tip, -sinks / tip
    r = (np.arange(200) + 0.5)[:, None] / 200
    psi = np.arange(72) * 2.0 * math.pi / 72
    sine, cosine = np.sin(psi), np.cos(psi)
    half = 0.5 * par[PARAM.main_lift_slope] * par[PARAM.main_solidity]

    def blades(unknown):
        cyclic_cosine, cyclic_sine, coning, induced = unknown
        pitch = par[PARAM.main_pitch_trim] + par[PARAM.main_pitch_range] * col
        pitch = pitch + twist * (r - 0.75) + cyclic_cosine * cosine + cyclic_sine * sine
        across, down = r + mu * sine, climb + induced + mu * coning * cosine
        return across**2 * pitch - across * down, across * down * pitch - down**2

    def unbalanced(unknown):
        lift, _ = blades(unknown)
        momentum = 2.0 * unknown[3] * math.hypot(mu, climb + unknown[3])
        loose = [np.mean(lift * r * sine), np.mean(lift * r * cosine)]
        lock = 6.0  # of a blade of mean weight; coning is 0.03 rad
        return [
            *loose,
            unknown[2] - 0.5 * lock * np.mean(lift * r),
            half * np.mean(lift) - momentum,
        ]

    solved = fsolve(unbalanced, [0.0, -0.01, 0.03, 0.02], xtol=1e-12)
    lift, leaning = blades(solved)
    swashplate = solved[1], -solved[0]
    main = turning(par, airspeed, 0.0, sinks, col=col, swashplate=swashplate)
    force = par[PARAM.air_density] * math.pi * par[PARAM.main_radius] ** 2 * tip**2
    assert main.thrust == pytest.approx(force * half * np.mean(lift), rel=1e-4)  # 200 strips
    power = force * tip * half * np.mean(leaning * r)
    # 90 to 400 W
    assert main.torque * par[PARAM.main_speed] == pytest.approx(power, abs=0.08 * airspeed)
    across = force * half * np.mean(leaning * sine - lift * solved[2] * cosine)
    assert main.drag_x == pytest.approx(-across, abs=0.08)


@given(u=speed, v=speed, w=sinking, col=stick, a=tilt, b=tilt, lon=tilt, lat=tilt)
def test_shaft_power_is_work_and_heat(numbers, u, v, w, col, a, b, lon, lat):
    """What the shaft gives is the work of the hub's force on the vehicle and what the air keeps."""
    main = turning(numbers, u, v, w, col=col, tips=(a, b), swashplate=(lon, lat))
    force = main.thrust * np.array(rotors.normal(numbers, (a, b)))
    force += [main.drag_x, main.drag_y, 0.0]
    shaft = main.torque * numbers[PARAM.main_speed]
    # the rounding of kilowatts
    assert shaft == pytest.approx(float(force @ [u, v, w]) + main.heat, abs=1e-8)
    assert main.heat > 0.0


def test_drag_in_the_plane_of_the_hub(numbers):
    """At 20 m/s sigma c_d0 mu / 4 of blades in straight flow are 0.94 N; yawed flow makes 1.4.

    Leishman (chapter 5) has the former, Johnson (Rotorcraft Aeromechanics, chapter 6) the
    latter: sigma c_d0 / 8 (3 mu + 1.98 mu^2.7).
    """
    numbers = numbers.copy()
    numbers[PARAM.main_lift_slope] = 1e-9  # drag alone
    main = turning(numbers, 20.0)
    tip = numbers[PARAM.main_speed] * numbers[PARAM.main_radius]
    mu = 20.0 / tip
    force = 1.225 * math.pi * 0.767**2 * tip**2
    section = numbers[PARAM.main_solidity] * numbers[PARAM.main_profile_drag]
    assert force * section * mu / 4.0 == pytest.approx(0.94, abs=0.01)
    published = force * section / 8.0 * (3.0 * mu + 1.98 * mu**2.7)
    assert main.drag_x == pytest.approx(-published, rel=0.009)  # that of the closed form
    assert main.drag_y == 0.0
    aslant = turning(numbers, 12.0, 16.0)
    assert (aslant.drag_x, aslant.drag_y) == pytest.approx(
        (0.6 * main.drag_x, 0.8 * main.drag_x), rel=1e-12
    )
