"""Wind, gusts and turbulence in flight: the same air for any thread or step."""

import math

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from helisim.base.errors import UnknownNameError
from helisim.physics import air as law
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.records.record import AIR
from helisim.sim import FlightPlan, Gust, Pilot, Recorder, Sweep, Weather, fly, simulate
from helisim.sim.flight import prepare, start_state
from helisim.vehicle import load
from helisim.vehicle.trim import Motion, addresses, write_motion

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)
SPAN = 2.0 * 0.767
KNOT = 0.514444


@pytest.fixture(scope="module")
def rough(jr700):
    return fly(
        jr700,
        FlightPlan(excitation=SHORT, weather=Weather(turbulence="light")),
        count=3,
        seed=7,
        jobs=1,
    )


def same(one, other):
    return np.array_equal(one.values, other.values)


@pytest.mark.parametrize("jobs", [2, 3])
def test_threads_do_not_matter(jr700, rough, jobs):
    """Turbulence is the same bits for any number of threads, and another in each flight."""
    weather = Weather(turbulence="light")
    again = fly(jr700, FlightPlan(excitation=SHORT, weather=weather), count=3, seed=7, jobs=jobs)
    assert all(same(one, other) for one, other in zip(rough, again))
    assert not same(rough[0], rough[1])


def test_turbulence_survives_a_copied_state(jr700):
    """It lives in the state: a flight goes on elsewhere bit for bit, and none of it is left."""
    weather = Weather(turbulence="severe")
    plan = FlightPlan(excitation=SHORT, pilot=Pilot(), weather=weather)
    model = prepare(jr700, plan, seed=1, number=0)
    start = start_state(jr700, plan, model, seed=1, number=0)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    one, other = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_setState(model, one, start, kind)
    state = np.empty(mujoco.mj_stateSize(model, kind))
    with installed():
        mujoco.mj_step(model, one, 300)
        mujoco.mj_getState(model, one, state, kind)
        mujoco.mj_setState(model, other, state, kind)
        mujoco.mj_step(model, one, 300)
        mujoco.mj_step(model, other, 300)
    assert np.array_equal(one.qpos, other.qpos)
    assert np.array_equal(one.act, other.act)


def down_in_body(attitudes):
    """Return the body components of a unit vector downwards, (n, 3)."""
    phi, theta, _ = attitudes.T
    along, across = -np.sin(theta), np.sin(phi) * np.cos(theta)
    return np.column_stack([along, across, np.cos(phi) * np.cos(theta)])


def test_time_step_does_not_matter():
    """Half the step: the same noise at the same ticks, the same air."""
    weather = Weather(turbulence="light")
    air = []
    for step in (0.002, 0.001):
        vehicle = load(timestep=step)
        (truth,) = simulate(
            vehicle, FlightPlan(excitation=SHORT, weather=weather, pilot=Pilot(remnant=0.0)), seed=2
        )
        seen = truth.at_ticks()
        air.append(np.sum(down_in_body(seen.attitudes) * seen.air[:, :3], axis=1))
    assert np.std(air[0]) > 0.1
    # truncation of (2 ms / 2.6 s)^5 / 120 in each of 4000 steps is below rounding
    assert air[0] == pytest.approx(air[1], abs=1e-12)


def test_calm_is_calm(jr700):
    """No weather, and a weather without any, are the same flight, in still air."""
    recorder = Recorder(rotor=True)
    plans = [
        FlightPlan(excitation=SHORT, recorder=recorder),
        FlightPlan(excitation=SHORT, recorder=recorder, weather=Weather()),
    ]
    calm, still = (fly(jr700, plan, seed=1)[0] for plan in plans)
    assert same(calm, still)
    assert not np.any([calm[name] for name in AIR])


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_air_is_reported_in_body_axes(jr700, heading):
    """Wind, gust and turbulence add up, turned from the path and the earth into the body."""
    weather = Weather(
        wind=3.0, wind_from=heading, rms=(1.0, 1.0, 1.0), gust=Gust(east=2.0, start=-1.0, hold=9.0)
    )
    vehicle = weather.trimmed(jr700)
    model = prepare(
        vehicle, FlightPlan(excitation=SHORT, pilot=Pilot(), weather=weather), seed=1, number=0
    )
    data = mujoco.MjData(model)
    first = addresses(model).state + STATE.air_u
    data.act[first : first + 8] = states = np.arange(1.0, 9.0)
    write_motion(model, data, Motion(psi=0.5, theta=0.3, phi=-0.2))
    with installed():
        mujoco.mj_forward(model, data)
    u, v, w, p, q, r = law.turbulence(states, SPAN)
    turn = np.array(
        [
            [math.cos(heading), -math.sin(heading), 0.0],
            [math.sin(heading), math.cos(heading), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    earth = turn @ [u, v, w] + turn @ [-3.0, 0.0, 0.0] + [0.0, 2.0, 0.0]
    c, s = math.cos, math.sin
    yaw = np.array([[c(0.5), s(0.5), 0], [-s(0.5), c(0.5), 0], [0, 0, 1]])
    pitch = np.array([[c(0.3), 0, -s(0.3)], [0, 1, 0], [s(0.3), 0, c(0.3)]])
    roll = np.array([[1, 0, 0], [0, c(-0.2), s(-0.2)], [0, -s(-0.2), c(-0.2)]])
    to_body = roll @ pitch @ yaw
    expected = [*(to_body @ earth), *(to_body @ turn @ [p, q, r])]
    assert data.sensor("air").data == pytest.approx(expected, abs=1e-12)  # rounding of 10 m/s


def test_turning_air_is_felt_as_the_opposite_turn(jr700, altered):
    """Air that yaws pushes the tail as a vehicle does that yaws the other way."""
    still, moving = altered(), altered(turbulence_on=1.0, turbulence_span=SPAN)
    yawing, plan = [], FlightPlan(excitation=SHORT)
    for model, r, air in ((still, -0.4, 0.0), (moving, 0.0, 0.4)):
        data = mujoco.MjData(model)
        start = start_state(jr700, plan, model, seed=0, number=0)
        mujoco.mj_setState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        write_motion(model, data, Motion(r=r))
        # r = pi / (3 b) (v - v over the span): only the latter, so that v = 0
        data.act[addresses(model).state + STATE.air_r_lag] = -air * 3.0 * SPAN / math.pi
        model.actuator_user[addresses(model).rotor, PARAM.turbulence_cosine] = 1.0
        with installed():
            mujoco.mj_forward(model, data)
        yawing.append(data.sensor("rotor").data[3])
    assert yawing[1] == pytest.approx(yawing[0], rel=1e-12)  # rounding
    assert yawing[1] != pytest.approx(5.25, rel=1e-3)  # what the hover needs


def test_gust_has_the_standards_shape(jr700):
    """V_m / 2 (1 - cos(pi t / T)) up, then V_m, then down the same way (section 3.7.1.3)."""
    gust = Gust(down=-2.0, start=1.0, rise=0.5, hold=1.0)
    (truth,) = simulate(
        jr700,
        FlightPlan(
            excitation=Sweep(axis="lat", duration=5.0, trim_time=1.0), weather=Weather(gust=gust)
        ),
    )
    t = truth.time - 1.0
    shape = np.select(
        [t <= 0.0, t < 0.5, t <= 1.5, t < 2.0],
        [
            0.0,
            0.5 * (1.0 - np.cos(np.pi * t / 0.5)),
            1.0,
            0.5 * (1.0 + np.cos(np.pi * (t - 1.5) / 0.5)),
        ],
        0.0,
    )
    expected = down_in_body(truth.attitudes) * (-2.0 * shape)[:, None]
    # the attitude is that of the same instant: only rounding
    assert truth.air[:, :3] == pytest.approx(expected, abs=1e-12)


def test_an_updraught_lifts(jr700):
    """A gust from below carries the vehicle up: what moves is the air, felt by the rotor."""
    up = Weather(gust=Gust(down=-2.0, start=1.0, rise=0.5, hold=2.0))
    manoeuvre = Sweep(axis="lat", duration=5.0, trim_time=1.0, amplitude=1e-6)
    heights = [
        next(
            simulate(
                jr700, FlightPlan(excitation=manoeuvre, pilot=Pilot(remnant=0.0), weather=weather)
            )
        ).positions[-1, 2]
        for weather in (Weather(), up)
    ]
    # Z_w = -0.94 1/s: most of 2 m/s is taken up within the 2 s that the gust lasts
    assert heights[1] - heights[0] < -1.5


def test_wind_is_hovered_in(jr700):
    """Trimmed for the wind the vehicle stays where it is, nose into it, for any direction."""
    manoeuvre = Sweep(axis="lat", duration=6.0, trim_time=1.0, amplitude=1e-6)
    for origin in (0.0, 2.0):
        weather = Weather(wind=6.0, wind_from=origin)
        (truth,) = simulate(
            jr700, FlightPlan(excitation=manoeuvre, pilot=Pilot(remnant=0.0), weather=weather)
        )
        # amplitude of 1e-6 stick; the trim leaves 1e-9 m/s^2
        assert np.ptp(truth.positions, axis=0).max() < 1e-4


def test_record_says_what_the_weather_was(rough):
    """Weather and height are in the record, with the scales that follow from them."""
    kept = rough[0].provenance["weather"]
    assert (kept["turbulence"], kept["wind"], kept["height"]) == ("light", 0.0, 20.0)
    assert kept["dryden"]["lengths"][2] == 20.0
    assert kept["dryden"]["rms"][2] == pytest.approx(0.1 * 15.0 * KNOT, rel=1e-5)


def test_turbulence_of_no_wind_is_calm(jr700):
    """Zero is a level of turbulence: the flight is the calm one, bit for bit."""
    calm, still = (
        fly(jr700, FlightPlan(excitation=SHORT, weather=weather), seed=3, jobs=1)[0]
        for weather in (Weather(), Weather(turbulence=0.0))
    )
    np.testing.assert_array_equal(calm.values, still.values)


def test_unknown_turbulence_is_an_unknown_name():
    """So that a caller can tell it from a number out of range."""
    with pytest.raises(UnknownNameError):
        Weather(turbulence="rough")


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
