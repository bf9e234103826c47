"""The exact loop: as `Vehicle.loop`, as the vehicle flies, and over the air that it meets."""

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import InputError
from helisim.design.exact import MeanLoop, exact_loop, exact_over, hands_off
from helisim.handling.figures import margins, rejection
from helisim.handling.loop import NoResponse
from helisim.sim import FlightPlan, Pilot, Step, simulate


@pytest.fixture(scope="module")
def exact(jr700):
    return exact_loop(jr700)


@pytest.mark.parametrize("axis", ["lat", "lon", "ped"])
def test_a_broken_loop_is_the_vehicles(jr700, exact, axis):
    """`Vehicle.loop` cuts matrices where this inverts responses: the same to rounding."""
    loop = jr700.loop(axis)
    found = exact.broken(axis)
    cut = -np.array([loop(np.exp(1j * w * loop.dt)) for w in found.frequency])
    # rounding of 1 / S - 1, which loses log10 |1 + L| digits
    assert np.abs(found.response - cut).max() < 1e-11 * np.abs(1.0 + cut).max()


def test_commands_poles_and_steps_are_the_closed_systems(jr700, exact):
    """Against the system from the sticks that `Vehicle.linearize` closes by itself."""
    whole = jr700.linearize("IN2")
    point = np.exp(1j * exact.frequency * whole.system.dt)
    row = whole.system.output_labels.index("phi")
    answer = np.array([whole.system(one)[row, 2] for one in point])
    assert np.abs(exact.command("lat").response / answer - 1.0).max() < 1e-9
    # the pedal is late by 11.4 ticks, linear between two: less than (w T)^2 / 8 from a pure delay
    turn = whole.system.output_labels.index("psi")
    late = np.exp(-1j * exact.frequency * whole.delays["PED"])
    answer = np.array([whole.system(one)[turn, 3] for one in point]) * late
    assert np.abs(exact.command("ped").response / answer - 1.0).max() < 0.15**2 * 4.0 / 8.0
    poles = np.linalg.eigvals(np.asarray(whole.system.A))
    slow = np.log(poles[np.abs(poles) > 0.5]) / whole.system.dt
    for pole in slow[np.abs(slow) > 0.1]:
        assert np.abs(exact.poles - pole).min() < 1e-6 * abs(pole)


def test_a_step_is_what_flies(jr700, exact):
    """A small step of the stick moves the nonlinear vehicle as the exact loop says."""
    step = Step(axis="ped", amplitude=0.002, trim_time=0.1, duration=1.0)
    plan = FlightPlan(excitation=step, pilot=Pilot(remnant=0.0))
    flown = next(simulate(hands_off(jr700), plan, jobs=1))
    found = exact.step("ped", size=0.002, duration=0.8)
    first = int(np.searchsorted(flown.time, 0.1 - 1e-9))
    rate = flown.rates[first : first + found.time.size, 2] - flown.rates[0, 2]
    # nonlinear by 1 % at 0.02 rad/s; nothing is fitted
    assert found.signals["r"] == pytest.approx(rate, abs=0.01 * np.abs(rate).max())


def test_the_shipped_gyros_figures(exact):
    """Margins and rejection of the gyro as they were computed before, by cutting the system."""
    found = {axis: margins(exact.broken(axis)) for axis in ("lat", "lon", "ped")}
    phases = {axis: np.degrees(one.least_phase) for axis, one in found.items()}
    assert phases == pytest.approx({"lat": 72.1, "lon": 107.3, "ped": 51.6}, abs=0.1)
    assert found["lat"].least_gain == pytest.approx(17.8, abs=0.05)
    bandwidths = [rejection(exact.disturbance(axis)).bandwidth for axis in ("lat", "lon", "ped")]
    assert bandwidths == pytest.approx([9.91, 20.9, 15.8], rel=0.005)


def test_what_is_added_elsewhere_is_refused(exact):
    """A place that sweeps don't know."""
    with pytest.raises(InputError, match="add at actuators, sensors or sticks, not at 'servos'"):
        exact.reached("servos", "lat")


def test_hands_off_changes_the_pilot_alone(jr700):
    """The same trim and linear model; no stick answers the motion."""
    free = hands_off(jr700)
    assert free.trim == jr700.trim
    assert free.parameters["pilot.k_attitude"] == 0.0
    plan = FlightPlan(
        excitation=Step(axis="lat", amplitude=0.02, trim_time=0.1, duration=1.0),
        pilot=Pilot(remnant=0.0),
    )
    flown = next(simulate(free, plan, jobs=1))
    assert np.ptp(flown.sticks[:, [1, 3]], axis=0).max() == 0.0
    assert np.ptp(next(simulate(jr700, plan, jobs=1)).sticks[:, 1]) > 0.0


GRID = np.geomspace(1.0, 100.0, 20)
SAME = 1e-9
"""Rounding of some hundred products of numbers of order one, and of solving for a trim."""


def test_in_calm_air_it_is_the_exact_loop(jr700):
    """There is one air to meet."""
    found = exact_over(jr700, hs.Weather(), GRID).broken("ped")
    np.testing.assert_allclose(
        found.response, exact_loop(jr700, GRID).broken("ped").response, rtol=SAME
    )


def test_in_a_steady_wind_it_is_that_of_the_trim_there(jr700):
    """As of the vehicle that is trimmed in it, which isn't the hover's."""
    weather = hs.Weather(wind=4.0)
    found = exact_over(jr700, weather, GRID).command("lat").response
    there = exact_loop(weather.trimmed(jr700), GRID).command("lat").response
    np.testing.assert_allclose(found, there, rtol=SAME)
    still = exact_loop(jr700, GRID).command("lat").response
    assert np.max(np.abs(found / still - 1.0)) > 1e6 * SAME


def test_sensitivities_are_averaged_not_loops(jr700):
    """An estimate averages what reaches the actuator, in each half of a flight alike."""
    one = exact_loop(jr700, GRID)
    other = exact_loop(jr700.with_settings({"gyro.k_p": 1.5}), GRID)
    mean = MeanLoop(((0.5, one), (0.5, other))).broken("ped").response
    each = [1.0 / (1.0 + half.broken("ped").response) for half in (one, other)]
    np.testing.assert_allclose(1.0 / (1.0 + mean), np.mean(each, axis=0), rtol=SAME)
    loops = np.mean([half.broken("ped").response for half in (one, other)], axis=0)
    assert np.max(np.abs(mean / loops - 1.0)) > 0.001


def test_a_mean_has_no_poles(jr700):
    """Who asks is told so."""
    one = exact_loop(jr700, GRID)
    with pytest.raises(NoResponse, match="no poles"):
        _ = MeanLoop(((1.0, one),)).poles
