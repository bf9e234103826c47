"""The exact loop: as `Vehicle.loop`, as the vehicle flies, and in the air that it meets."""

import numpy as np
import pytest

from helisim.design.exact import air_met, exact_loop, hands_off
from helisim.physics.motion import flip
from helisim.sim import FlightPlan, Pilot, Step, Weather, simulate


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
    step = Step(axis="ped", amplitude=0.002, trim_time=0.1, duration=1.0)
    plan = FlightPlan(excitation=step, pilot=Pilot(remnant=0.0))
    flown = next(simulate(hands_off(jr700), plan, jobs=1))
    assert not np.ptp(flown.sticks[:, [1, 2]], axis=0).any()  # hands off: col alone, and the step
    found = exact.step("ped", size=0.002, duration=0.8)
    first = int(np.searchsorted(flown.time, 0.1 - 1e-9))
    rate = flown.rates[first : first + found.time.size, 2] - flown.rates[0, 2]
    # nonlinear by 1 % at 0.02 rad/s; nothing is fitted
    assert found.signals["r"] == pytest.approx(rate, abs=0.01 * np.abs(rate).max())


def test_calm_air_is_met_as_it_is(jr700):
    """One wind, which blows all the time: the steady one."""
    ((share, there),) = air_met(jr700, Weather())
    assert (share, there) == (1.0, jr700)
    ((share, there),) = air_met(jr700, Weather(wind=3.0))
    assert share == 1.0
    assert there.derivatives["Z_w"] == jr700.trimmed(wind=(-3.0, 0.0, 0.0)).derivatives["Z_w"]


def test_gusts_lie_along_the_path_through_the_air(jr700):
    """Their covariance is that of independent gusts ahead, to the right and down of the path."""
    rms, heading = (2.0, 0.1, 0.4), 0.6
    weather = Weather(wind=1.0, wind_from=heading, rms=rms)
    air = air_met(jr700, weather, points=(3, 3, 3))
    assert sum(share for share, _ in air) == pytest.approx(1.0, rel=1e-12)
    winds = np.array([flip(*there.model.opt.wind) for _, there in air])
    shares = np.array([share for share, _ in air])
    mean = shares @ winds
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    assert mean == pytest.approx(-ahead, abs=1e-12)
    path = np.array([ahead, [-ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
    # the quadrature has the variance of the normal distribution
    found = (winds - mean).T @ (shares[:, None] * (winds - mean))
    assert found == pytest.approx(path.T @ np.diag(rms) ** 2 @ path, abs=1e-9)
