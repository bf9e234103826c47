"""Turbulence: the standard's spectra, levels and lengths, in closed form and as simulated."""

import math

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from helisim.physics import air as law
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.sim import FlightPlan, Pilot, Sweep, Weather
from helisim.sim.flight import prepare, start_state
from helisim.vehicle.motion import addresses

SPAN = 2.0 * 0.767
KNOT = 0.514444


def spectra(dryden, omega):
    """MIL-F-8785C's one-sided Dryden spectra of u, v, w, p, q, r, (6, n), by the standard's text.

    Section 3.7.1.2 for the velocities, 3.7.5 for the rates; V for the airspeed, b for the span.
    """
    (s_u, s_v, s_w), (l_u, l_v, l_w), v = dryden.rms, dryden.lengths, dryden.speed
    x = [length * omega / v for length in (l_u, l_v, l_w)]
    along = s_u**2 * 2.0 * l_u / (math.pi * v) / (1.0 + x[0] ** 2)
    across = s_v**2 * l_v / (math.pi * v) * (1.0 + 3.0 * x[1] ** 2) / (1.0 + x[1] ** 2) ** 2
    down = s_w**2 * l_w / (math.pi * v) * (1.0 + 3.0 * x[2] ** 2) / (1.0 + x[2] ** 2) ** 2
    wide = 1.0 + (4.0 * SPAN * omega / (math.pi * v)) ** 2
    roll = s_w**2 / (v * l_w) * 0.8 * (math.pi * l_w / (4.0 * SPAN)) ** (1 / 3) / wide
    pitch = (omega / v) ** 2 / wide * down
    yaw = (omega / v) ** 2 / (1.0 + (3.0 * SPAN * omega / (math.pi * v)) ** 2) * across
    return np.array([along, across, down, roll, pitch, yaw])


def outputs(states):
    """Return u, v, w, p, q, r of the air from rows of states, (6, n)."""
    return np.array(law.turbulence(states.T, SPAN))


@pytest.mark.parametrize("drift", [None, 30.0])
def test_filters_have_the_standards_spectra(drift):
    """The filters' own frequency responses are the closed-form spectra, to rounding."""
    dryden = Weather(turbulence="moderate", drift=drift).dryden
    a, b = dryden.filters(SPAN)
    c = outputs(np.eye(8))
    omega = np.geomspace(1e-3, 1e3, 60)
    found = []
    for w in omega:
        response = c @ np.linalg.solve(1j * w * np.eye(8) - a, b)
        found.append(np.sum(np.abs(response) ** 2, axis=1) / math.pi)
    np.testing.assert_allclose(np.transpose(found), spectra(dryden, omega), rtol=1e-9)


def test_levels_and_lengths_are_the_standards():
    """Light at 20 m: W20 15 kt, L_w = h, sigma_w = W20 / 10, and the others by the formulas."""
    dryden = Weather(turbulence="light").dryden
    feet = 20.0 / 0.3048
    shape = 0.177 + 0.000823 * feet
    assert dryden.rms[2] == pytest.approx(0.1 * 15.0 * KNOT, rel=1e-5)
    assert dryden.rms[0] == dryden.rms[1] == pytest.approx(dryden.rms[2] / shape**0.4, rel=1e-12)
    assert dryden.lengths[2] == 20.0
    assert dryden.lengths[0] == dryden.lengths[1] == pytest.approx(20.0 / shape**1.2, rel=1e-12)
    assert dryden.speed == pytest.approx(15.0 * KNOT, rel=1e-5)
    moderate, severe = (Weather(turbulence=name).dryden for name in ("moderate", "severe"))
    assert moderate.rms[2] == pytest.approx(2.0 * dryden.rms[2], rel=1e-12)
    assert severe.rms[2] == pytest.approx(3.0 * dryden.rms[2], rel=1e-12)


def test_scales_meet_at_a_thousand_feet():
    """At 1000 ft all three lengths are 1000 ft and all three rms the same (figure 10, 11)."""
    dryden = Weather(turbulence="light", height=304.8).dryden
    assert dryden.lengths == pytest.approx((304.8,) * 3, rel=1e-12)
    assert dryden.rms == pytest.approx((dryden.rms[2],) * 3, rel=1e-12)


ROUGH = Weather(rms=(0.4, 0.3, 0.2), drift=40.0)
"""Quick turbulence, so that five minutes hold 100 of its longest correlation times."""


@pytest.fixture(scope="module")
def five_minutes(jr700):
    """The native simulation's turbulence states at each tick of five minutes of hover."""
    quiet = Pilot(remnant=0.0)
    hover = Sweep(axis="lat", duration=300.0, amplitude=1e-9)
    plan = FlightPlan(excitation=hover, pilot=quiet, weather=ROUGH)
    model = prepare(jr700, plan, seed=1, number=0)
    where = addresses(model)
    state = start_state(jr700, plan, model, seed=1, number=0)
    first = 1 + model.nq + model.nv + where.state + STATE.air_u
    data, rows = mujoco.MjData(model), []
    with installed():
        for _ in range(30):
            states, _ = rollout.rollout(model, data, initial_state=state, nstep=5000)
            rows.append(states[0, :, first : first + 8])
            state = states[0, -1]
    return np.concatenate(rows)


def test_simulated_spectra_are_the_standards(five_minutes):
    """Periodograms of the simulated air average to the closed form in each of three bands.

    A Hann-windowed periodogram over its spectrum has mean 1 and variance 1; neighbours hang
    together, so the mean of n has a variance of 1.94 / n. Four of its standard deviations.
    """
    air = outputs(five_minutes)
    n, step = air.shape[1], 0.002
    window = np.hanning(n)
    omega = 2.0 * np.pi * np.fft.rfftfreq(n, step)
    power = np.abs(np.fft.rfft((air - air.mean(axis=1, keepdims=True)) * window)) ** 2
    power *= step / (np.pi * np.mean(window**2) * n)
    for low, high in ((0.2, 2.0), (2.0, 10.0), (10.0, 100.0)):
        band = (omega >= low) & (omega < high)
        ratio = (power[:, band] / spectra(ROUGH.dryden, omega[band])).mean(axis=1)
        assert ratio == pytest.approx(np.ones(6), abs=4.0 * math.sqrt(1.94 / band.sum()))


def test_simulated_variance_is_the_standards(five_minutes):
    """Variances of u, v, w within four standard deviations, 2 sqrt(T_c / T) each.

    T_c is the integral of the squared correlation, at most the lag L / V.
    """
    dryden = ROUGH.dryden
    found = outputs(five_minutes)[:3].var(axis=1) / np.square(dryden.rms)
    spread = np.sqrt(2.0 * np.array(dryden.lengths) / dryden.speed / 300.0)
    assert (np.abs(found - 1.0) < 4.0 * spread).all()


def test_turbulences_components_are_independent(five_minutes):
    """u, v, w and p have noise of their own: no correlation beyond chance."""
    u, v, w, p, _, _ = outputs(five_minutes)
    lag = ROUGH.dryden.lengths[0] / 40.0
    # the correlation of independent signals scatters by sqrt(T_c / T), T_c <= the longest lag
    limit = 4.0 * math.sqrt(lag / 300.0)
    assert np.abs(np.corrcoef([u, v, w, p]) - np.eye(4)).max() < limit


def test_a_flight_starts_in_rough_air():
    """The first state is drawn with the variance of the whole flight."""
    dryden = Weather(turbulence="light").dryden
    rng = np.random.default_rng(3)
    states = np.array([dryden.start(SPAN, rng) for _ in range(500)])
    found = outputs(states)[:3].var(axis=1) / np.square(dryden.rms)
    assert found == pytest.approx(np.ones(3), abs=4.0 * math.sqrt(2.0 / 500))  # of a variance
