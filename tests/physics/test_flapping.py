"""The tip-path plane against one blade that flaps, against books, and where the rotor is slow."""

import numpy as np
import pytest
from scipy.linalg import expm

from helisim.physics import flapping
from helisim.physics.inflow import inflow_rates, wake
from helisim.physics.layout import PARAM
from helisim.physics.motion import Velocities
from helisim.physics.rotor import MainRotor
from helisim.vehicle.swashplate import TipPathPlane, flapping_from_blade
from one_blade import OneBlade
from tabled import tabled

SPEED = 100.0
STILL = Velocities(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def held_by(par, lock, frequency=1.0, direction=-1.0, speed=1.0) -> flapping.Disc:
    found = flapping_from_blade(
        lock_number=lock,
        speed=SPEED,
        direction=direction,
        flap_frequency=frequency,
        lon_range=1.0,
        lat_range=1.0,
    )
    turns = {"main_rotor.speed": SPEED, "main_rotor.direction": direction}
    plane = TipPathPlane.of(found.to_parameters() | turns)
    par[PARAM.main_speed], par[PARAM.main_direction] = SPEED, direction
    par[PARAM.flap_hold] = lock / par[PARAM.air_density]
    par[PARAM.flap_reduction] = 1.0
    par[PARAM.flap_stiffness] = frequency**2 - 1.0
    springs = plane.share * SPEED * plane.springs
    par[PARAM.spring_aa : PARAM.spring_ba + 1] = springs.ravel()[:3]
    return flapping.disc(par, speed)


def rates(held, tilt, motion=STILL, air=STILL, target=(0.0, 0.0), step=0.0):
    return np.array(flapping.flapping_rates(*tilt, motion, air, *target, held, step))


def motion_of(held):
    return np.column_stack([rates(held, (1.0, 0.0)), rates(held, (0.0, 1.0))])


def steady(held, **given):
    return np.linalg.solve(motion_of(held), -rates(held, (0.0, 0.0), **given))


def test_without_air_the_disc_stays_where_it_is_in_space(par):
    """A turn that begins leaves it behind, as a gyroscope, whatever its own tilt."""
    turn = Velocities(3.0, 2.0, 1.0, 0.3, -0.4, 0.5)
    held = held_by(par, 6.0)._replace(share=0.0, air=0.0)
    assert rates(held, (0.1, -0.2), motion=turn) == pytest.approx([0.4, -0.3], rel=1e-12)


ROTORS = [(2.0, 1.0), (2.0, 1.07), (5.0, 1.0), (8.0, 1.03), (10.0, 1.12)]
"""Lock numbers and flap frequencies: models with and without springs, full size to a Bo 105."""


@tabled("direction", "lock", "frequency", "turning")
def test_a_turn_tilts_the_disc_as_one_blade(par, direction, lock, frequency, turning):
    """Body, air, or both together in a steady turn, which leaves the gyroscopic lag alone."""
    body = (0.3, -0.4) if turning != "air" else (0.0, 0.0)
    air = (0.3, -0.4) if turning != "body" else (0.0, 0.0)
    held = held_by(par, lock, frequency, direction)
    through = Velocities(0.0, 0.0, 0.0, body[0] - air[0], body[1] - air[1], 0.0)
    found = steady(held, motion=through, air=Velocities(0.0, 0.0, 0.0, *air, 0.0))
    spring = frequency**2 - 1.0
    blade = OneBlade(lock=lock, spring=spring, direction=direction, rates=body, air=air)
    # nothing is neglected in a steady turn but 60 strips' 1 / (2 x 60^2)
    assert found == pytest.approx(blade.steady()[1:], abs=3e-4 * np.hypot(*found))


@pytest.mark.parametrize(("lock", "frequency"), ROTORS)
def test_a_tilt_dies_as_one_blades(par, lock, frequency):
    """Time constant and precession of the slow mode.

    Of a blade s = -gamma / 16 + i (sqrt(nu^2 - (gamma / 16)^2) - 1), in radians of rotation; the
    tip-path plane leaves out the second derivative of the tilt, so it is off by the square of s
    over twice the rotor's speed: 1/2 |s|^2.
    """
    held = held_by(par, lock, frequency)
    pole = np.linalg.eigvals(motion_of(held))[0] / SPEED
    share = lock / 16.0
    exact = complex(-share, np.sqrt(frequency**2 - share**2) - 1.0)
    exact = complex(exact.real, np.copysign(exact.imag, pole.imag))
    assert abs(pole - exact) < 0.5 * abs(exact) ** 2 * 1.15  # and its next order


def flight(par, held, pitch, through, advance, sideways=0.0, induced=0.0, twist=0.0):
    """Return the tilts that flight asks for, with uniform inflow through the disc."""
    tip = 100.0
    motion = STILL._replace(u=advance * tip, v=sideways * tip)
    main = MainRotor(*[0.0] * len(MainRotor._fields))
    main = main._replace(inflow=through, induced=induced, tip_speed=tip, pitch=pitch)
    main = main._replace(climb=through - induced, advance=np.hypot(advance, sideways))
    par[PARAM.main_twist] = twist
    way = flapping.advance_ratios(motion, main)
    return flapping.tilt_by_flight(par, main, held, *way, *flapping.skewed_slopes(par, main, *way))


@tabled("direction", "way", "advance", "twist")
def test_a_disc_in_flight_tilts_as_one_blade(par, direction, way, advance, twist):
    """Forward, sideways and aslant, with coning, twist and inflow that rises to the rear.

    The pitch of the tip-path plane is that at three quarters of the radius.
    """
    lock, pitch, through = 6.0, 0.16, 0.03
    par[PARAM.flap_back], par[PARAM.flap_stop] = 1.0, 1.0
    par[PARAM.inflow_skew] = 15.0 * np.pi / 32.0
    held = held_by(par, lock, 1.0, direction)
    induced = 0.02
    skew = np.arctan2(advance, through)
    rear = 15.0 * np.pi / 32.0 * np.tan(0.5 * skew) * induced
    found = flight(par, held, pitch, through, advance * way[0], advance * way[1], induced, twist)
    blade = OneBlade(
        lock=lock,
        direction=direction,
        pitch=pitch - 0.75 * twist,
        twist=twist,
        advance=(advance * way[0], advance * way[1]),
        inflow=through,
        rear=rear,
    )
    _, a, b = blade.steady()
    # books stop at the first harmonic: the second comes back as mu^2 gamma^2 / 450 or less of the
    # first
    assert found == pytest.approx([a, b], abs=np.hypot(a, b) * (0.005 + 0.6 * advance**2))


@pytest.mark.parametrize("advance", [0.1, 0.2, 0.3])
def test_flapping_of_nasa_tp_1285(par, advance):
    """Shaughnessy, Deaux and Yenni, NASA TP-1285 (1979), eqs. (29) and (32), as JSBSim flies them.

    theta_0 is at the root, lambda upwards. Uneven inflow, which they lack, is left out here.
    """
    lock, root, twist, through = 7.0, 0.22, -0.14, 0.025
    par[PARAM.flap_back], par[PARAM.flap_stop] = 1.0, 1.0
    par[PARAM.inflow_skew] = 15.0 * np.pi / 32.0
    square = advance**2
    cone = lock * (
        -through / 6.0 + (1.0 + square) / 8.0 * root + (1.0 / 10.0 + square / 12.0) * twist
    )
    back = advance * (-2.0 * through + 8.0 / 3.0 * (root + 0.75 * twist)) / (1.0 - 0.5 * square)
    aside = 4.0 / 3.0 * advance * cone / (1.0 + 0.5 * square)
    held = held_by(par, lock, 1.0, -1.0)
    found = flight(par, held, root + 0.75 * twist, through, advance, twist=twist)
    # theirs has 0.04 mu^3 lambda more of coning, of a reversed flow that is not here
    assert found == pytest.approx([back, aside], rel=1e-12)


def test_a_slower_rotor_is_the_same_blade(par):
    """At half speed the law is that of the slower rotor's own section, where springs are soft."""
    lock, frequency = 4.0, 1.02
    half = held_by(par, lock, frequency, speed=0.5)
    stiffness = (frequency**2 - 1.0) / 0.5**2
    found = flapping_from_blade(
        lock_number=lock,
        speed=0.5 * SPEED,
        direction=-1.0,
        flap_frequency=np.sqrt(1.0 + stiffness),
        lon_range=1.0,
        lat_range=1.0,
    )
    own = np.array([[-1.0, found.a_b], [found.b_a, -1.0]]) / found.tau_f
    # nu - 1 in place of (nu^2 - 1) / 2, of which it is stiffness / 4 less
    assert motion_of(half) == pytest.approx(own, rel=0.25 * stiffness, abs=0.01 * abs(own).max())


@pytest.mark.parametrize(("lock", "frequency"), ROTORS[1:4:2])
def test_a_rotor_that_stops_lays_its_blades_down(par, lock, frequency):
    rolling = Velocities(3.0, -2.0, 1.0, 1.0, -0.5, 0.2)
    before, hung = None, held_by(par, lock, frequency)
    for speed in np.linspace(1.2, 0.0, 1201):
        held = flapping.disc(par, speed)
        now = rates(held, (0.2, -0.1), motion=rolling, target=(0.1, 0.1))
        growth = np.linalg.eigvals(motion_of(held)).real
        assert np.all(growth < 0.0)
        assert np.all(np.isfinite(now))
        if before is not None:
            # a thousandth of the speed: as much of rates near 100 rad/s times the tilt
            assert np.abs(now - before).max() < 0.05 * np.abs(motion_of(hung)).max() * 0.2
        before = now
    assert rates(held, (0.0, 0.0), motion=rolling, target=(0.1, 0.1)) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("step", [0.002])
def test_a_step_is_the_implicit_midpoint(par, step):
    """Against the matrix exponential: third order in a step, whatever the time constant."""
    held = held_by(par, 2.0, 1.07)
    start, target = np.array([0.1, -0.05]), (0.02, 0.03)
    matrix = motion_of(held)
    rest = np.linalg.solve(matrix, -rates(held, (0.0, 0.0), target=target))
    exact = rest + expm(matrix * step) @ (start - rest)
    found = start + step * rates(held, start, target=target, step=step)
    size = np.abs(np.linalg.eigvals(matrix)).max()
    error = np.abs(found - exact).max()
    # (s step)^3 / 12 of the way to go
    assert error < 1.05 * (size * step) ** 3 / 12.0 * np.abs(start - rest).max() * np.sqrt(2.0)


@pytest.mark.parametrize("climb", [0.0, 0.02, -0.06])
@pytest.mark.parametrize("advance", [1e-6, 0.01, 0.1, 0.4])
def test_slopes_are_those_at_which_dynamic_inflow_rests(par, climb, advance):
    """Without a moment on the hub; 15 pi / 32 tan(chi / 2) of the mean (Pitt and Peters, 1981)."""
    par[PARAM.flap_back], par[PARAM.inflow_skew] = 1.0, 15.0 * np.pi / 32.0
    ahead, right, mean = 0.6 * advance, -0.8 * advance, 0.03
    main = MainRotor(*[0.0] * len(MainRotor._fields))
    main = main._replace(induced=mean, climb=climb, advance=advance)
    across, aft = flapping.skewed_slopes(par, main, ahead, right)
    behind = wake(mean, climb, advance, ahead, right)
    thrust = 2.0 * behind.flow * mean  # momentum
    rates = inflow_rates(mean, across, aft, thrust, 0.0, 0.0, behind, 1.0, 1.0, 15.0 * np.pi / 32.0)
    # rounding, over the flow's inertia of 0.1
    assert rates == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
    if climb == 0.0:
        skew = np.arctan2(advance, mean)
        gain = 15.0 * np.pi / 32.0 * np.tan(0.5 * skew) * mean
        assert (across, aft) == pytest.approx((0.8 * gain, 0.6 * gain), rel=1e-12)
