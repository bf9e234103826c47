"""Wind, gusts and turbulence in flight: the same air for any thread or step."""

import math

import mujoco
import numpy as np
import pytest

from helisim.physics import air as law
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.sim import FlightPlan, Gust, Pilot, Sweep, Weather, simulate
from helisim.sim.flight import prepare
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import Motion, write_motion

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
SPAN = 2.0 * 0.767
KNOT = 0.514444


def down_in_body(attitudes):
    """Return the body components of a unit vector downwards, (n, 3)."""
    phi, theta, _ = attitudes.T
    along, across = -np.sin(theta), np.sin(phi) * np.cos(theta)
    return np.column_stack([along, across, np.cos(phi) * np.cos(theta)])


def test_time_step_does_not_matter():
    calm, air = {"excitation": SHORT, "pilot": Pilot(remnant=0.0)}, []
    plan = FlightPlan(**calm, weather=Weather(turbulence="light"))
    for step in (0.002, 0.001):
        (truth,) = simulate(load(timestep=step), plan, seed=2)
        seen = truth.at_ticks()
        air.append(np.sum(down_in_body(seen.attitudes) * seen.air[:, :3], axis=1))
    assert np.std(air[0]) > 0.1
    # truncation of (2 ms / 2.6 s)^5 / 120 in each of 4000 steps is below rounding
    assert air[0] == pytest.approx(air[1], abs=1e-12)


@pytest.mark.parametrize(("heading", "start"), [(0.0, -0.5), (0.7, -10.5)])
def test_air_is_reported_in_body_axes(jr700, heading, start):
    gust = Gust(east=4.0, start=start, rise=1.0, hold=9.0)  # half of it, rising or falling
    weather = Weather(wind=3.0, wind_from=heading, rms=(1.0, 1.0, 1.0), gust=gust)
    vehicle = weather.trimmed(jr700)
    plan = FlightPlan(excitation=SHORT, pilot=Pilot(), weather=weather)
    model = prepare(vehicle, plan, seed=1, number=0)
    data = mujoco.MjData(model)
    first = addresses(model).state + STATE.air_u
    data.act[first : first + 8] = states = np.arange(1.0, 9.0)
    write_motion(model, data, Motion(psi=0.5, theta=0.3, phi=-0.2))
    with installed():
        mujoco.mj_forward(model, data)
    u, v, w, p, q, r = law.turbulence(states, SPAN)
    c, s = math.cos, math.sin
    turn = np.array([[c(heading), -s(heading), 0], [s(heading), c(heading), 0], [0, 0, 1]])
    earth = turn @ [u, v, w] + turn @ [-3.0, 0.0, 0.0] + [0.0, 2.0, 0.0]
    yaw = np.array([[c(0.5), s(0.5), 0], [-s(0.5), c(0.5), 0], [0, 0, 1]])
    pitch = np.array([[c(0.3), 0, -s(0.3)], [0, 1, 0], [s(0.3), 0, c(0.3)]])
    roll = np.array([[1, 0, 0], [0, c(-0.2), s(-0.2)], [0, -s(-0.2), c(-0.2)]])
    to_body = roll @ pitch @ yaw
    expected = [*(to_body @ earth), *(to_body @ turn @ [p, q, r])]
    assert data.sensor("air").data == pytest.approx(expected, abs=1e-12)  # rounding of 10 m/s


# Turbulence: the standard's spectra, levels and lengths, in closed form and as simulated


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
