"""Pilot, gyro, servos and air, as the callbacks write them, against the same restated in matrices.

Random states far from hover, with all that air, pilot, gyro and faults can do switched on, so that
no term is near zero. What differs is rounding: sums of some ten terms of at most 1e5.
"""

import copy
import math

import mujoco
import numpy as np
import pytest
import restated
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from scipy.integrate import quad

from helisim.physics import air, gyro, pilot
from helisim.physics.layout import DOUBLET, HISTORY, PARAM, ROTOR_STATES, STATE, SWEEP  # noqa: F401  (rows name them)
from helisim.physics.native import installed
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import Motion, rotation_matrix, write_motion
from tabled import rows

STEP = 0.002
ROTOR = np.isin(np.arange(ROTOR_STATES + STATE.flap_a), np.r_[STATE.flap_a : STATE.warming + 1])
RATES = np.roll(ROTOR, STATE.flap_a_rate - STATE.flap_a)
"""Which activations are the rotor's states, and which keep their rates."""


def named(prefix, **numbers):
    return {f"{prefix}_{name}": number for name, number in numbers.items()}


WINDY = {
    **named("gust", north=2.0, east=-1.5, down=0.7, start=0.01, rise=0.05, hold=0.02),
    **named("turbulence", on=1.0, seed=5.0, cosine=np.cos(0.7), sine=np.sin(0.7), span=1.534),
    **named("turbulence", u=0.8, v=0.6, w=0.4, p=0.3),
    **named("turbulence_lag", u=0.9, v=0.7, w=0.5, p=0.3),
    "ground_effect": 1.0,
}
PILOTED = {
    **named("pilot", on=1.0, north=0.5, east=-0.4, down=-2.0, psi=3.0, phi=0.04, theta=-0.03),
    **named("pilot", col=0.01, lon=-0.02, lat=0.03, ped=-0.04, seed=7.0),
    **named("remnant", col=0.01, lon=0.02, lat=0.015, ped=0.012, interval=0.03),
    **named("excitation", start=0.003, duration=0.2, col=0.05, lon=0.04, lat=0.03, ped=-0.02),
    **named("sweep", w_min=20.0, w_max=60.0, fade=0.01, unsteadiness=0.2),
}
FAULTY = {
    "faults": 1.0,
    **named("front_fault", at=0.02, rate_limit=0.5, low=-1.0, high=1.0),
    **named("left_fault", at=0.1, rate_limit=0.0, low=-1.0, high=1.0),
    **named("right_fault", at=0.04, rate_limit=100.0, low=0.01, high=0.02),
    **named("tail_fault", at=0.05, rate_limit=1.5, low=-0.1, high=0.1),
}
CASES = dict(rows(globals(), "CASES"))
ODD = {"hub_x": 0.03, "tail_z": -0.05, "gyro_collective": 0.7, "spring_ab": 0.3}
"""Not the JR700's, whose are 0 or 1."""


LAGS = {"filter": 0.004, "derivative_filter": 0.0065, "lead_filter": 0.003}
"""Of the gyro's filters, s, near the JR700's."""


def moment(altered, case, seed, *, integrator="RK4"):
    rng = np.random.default_rng(seed)
    model = altered(**ODD, **case)
    model.opt.wind[:] = rng.normal(size=3)
    sample_filters(model.actuator_user[addresses(model).rotor])
    model.actuator_delay[addresses(model).rotor - 5] = 0.0073
    model.body_ipos[model.jnt_bodyid[0]] = (0.1, -0.05, 0.08)  # the body's origin is elsewhere
    where, data = addresses(model), mujoco.MjData(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER  # the run-up, for what pedals did
    times, pedals = [], []
    with installed():
        for _ in range(int(rng.integers(5, 60))):
            data.ctrl[where.control : where.control + 4] = rng.uniform(-0.3, 0.3, 4)
            times.append(data.time)
            mujoco.mj_step(model, data)
            pedals.append(data.ctrl[where.control + 3])
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    motion = Motion(*rng.uniform(-1.5, 1.5, 6), *rng.uniform(-0.6, 0.6, 2), rng.uniform(-3, 3))
    motion = Motion(**{**vars(motion), "north": 0.3, "east": -0.2, "down": -0.6 - rng.uniform()})
    write_motion(model, data, motion)
    data.act[:] = rng.uniform(-0.15, 0.15, model.na)
    data.ctrl[:] = rng.uniform(-0.4, 0.4, model.nu)
    data.userdata[:] = rng.uniform(-0.1, 0.1, model.nuserdata)
    data.act_dot[:] = 7.0  # what isn't written would stay
    data.ctrl[where.control + 8] = rng.uniform(0.9, 1.1)
    par = model.actuator_user[where.rotor].copy()
    now = restated.Moment(
        par=par,
        time=data.time,
        clock=data.time,
        tick=ticks(data.time, par[PARAM.gyro_period]),
        earth=rotation_matrix(motion.phi, motion.theta, motion.psi),
        position=np.array([motion.north, motion.east, motion.down]),
        velocity=np.array([motion.u, motion.v, motion.w]),
        rates=np.array([motion.p, motion.q, motion.r]),
        act=data.act.copy(),
        ctrl=data.ctrl[where.control : where.control + 9].copy(),
        late_pedal=late(times, pedals, data.time, par[PARAM.gyro_period]),
        lags=LAGS,
        wind=model.opt.wind * [1.0, -1.0, -1.0],
        added=data.userdata.copy(),
    )
    return model, data, now


def sample_filters(par):
    period, fast, slow = par[PARAM.gyro_period], LAGS["filter"], LAGS["derivative_filter"]
    par[PARAM.gyro_lead_share] = gyro.filter_share(LAGS["lead_filter"], period)
    par[PARAM.gyro_filter_share] = gyro.filter_share(fast, period)
    par[PARAM.gyro_filter_mean] = gyro.filter_mean(fast, period)
    par[PARAM.gyro_derivative_share] = gyro.filter_share(slow, period)
    par[PARAM.gyro_derivative_through] = gyro.filter_through(fast, slow, period)


def ticks(time, period):
    now, every = round(time / 1e-3), round(period / 1e-3)
    return any((now - back) % every == 0 for back in range(round(STEP / 1e-3)))


def late(times, pedals, time, period):
    """Return the pedal 7.3 ms before the last tick, linear between what two ticks saw."""
    wanted = period * np.floor(time / period + 1e-6) - 0.0073
    before = period * np.floor(wanted / period + 1e-6)

    def held(when):
        earlier = [pedal for one, pedal in zip(times, pedals) if one <= when + 1e-9]
        return earlier[-1] if earlier else 0.0

    share = (wanted - before) / period
    return (1.0 - share) * held(before) + share * held(before + period)


def forward(model, data):
    with installed():
        mujoco.mj_forward(model, data)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("case", CASES)
def test_every_number_is_the_restated_one(altered, case, seed):
    model, data, now = moment(altered, CASES[case], seed)
    where = addresses(model)
    forward(model, data)
    now.ctrl, now.act = restated.control(now)
    ours = slice(where.control, where.control + 9)
    assert data.ctrl[ours] == pytest.approx(now.ctrl, rel=1e-9, abs=1e-11)
    # sums of errors of 1e2 rad/s over periods of 1e-2 s
    assert data.act[~RATES] == pytest.approx(now.act[~RATES], rel=1e-12, abs=1e-15)
    assert data.act_dot[ROTOR] == pytest.approx(data.act[RATES], rel=1e-15)
    assert data.act_dot[~ROTOR] == pytest.approx(
        restated.state_rates(now)[~ROTOR], rel=1e-8, abs=1e-8
    )
    speed = 1.0 if now.p.pilot_on == 1.0 else now.ctrl[8]  # also between ticks
    assert data.sensor("rotor").data[4] == speed
    for name, expected in reports(now).items():
        assert data.sensor(name).data == pytest.approx(expected, rel=1e-9, abs=1e-9)


def reports(now):
    return {
        "stick": now.ctrl[:4],
        "servo_command": now.ctrl[4:8],
        "servo_position": now.act[STATE.front_position : STATE.tail_rate + 1 : 2],
        "flapping": now.act[[STATE.flap_a, STATE.flap_b]],
        "air": restated.air(now),
    }


@pytest.mark.parametrize("case", ["calm", "wind", "no gyro"])
def test_a_held_evaluation_is_the_mean_over_the_step(altered, case):
    """With Euler the derivatives are means: of x' over h, sum of (h A)^k / (k + 1)! x'.

    The exponential's series for the restated equations, which are linear here: six terms for the
    servos, four for the air. The tilt's is the midpoint rule, with other tests.
    """
    linear = {"servo_rate_limit": 1e3, "servo_travel": 1.0}
    model, data, now = moment(altered, CASES[case] | linear, 4, integrator="Euler")
    forward(model, data)
    now.ctrl, start = restated.control(now)

    def rates(act):
        now.act = act
        return restated.state_rates(now)

    first, still = rates(start), rates(np.zeros(start.size))
    matrix = STEP * np.column_stack([rates(one) - still for one in np.eye(start.size)])
    for states, terms in ((slice(0, STATE.flap_a), 6), (slice(STATE.air_u, STATE.feels_x), 4)):
        term, mean = first[states], 0.0
        for k in range(terms):
            mean, term = mean + term, matrix[states, states] @ term / (k + 2.0)
        assert data.act_dot[states] == pytest.approx(mean, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("case", ["calm", "wind"])
def test_a_held_tilt_is_that_of_the_steps_middle(altered, case):
    """With Euler: the implicit midpoint, the collective where its servos will be in half a step."""
    model, data, now = moment(altered, CASES[case], 9, integrator="Euler")
    state = addresses(model).state
    tilt = slice(state + STATE.flap_a, state + STATE.flap_b + 1)
    continuous = copy.copy(model)
    continuous.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    soon = copy.copy(data)
    servos = soon.act[state + STATE.front_position : state + STATE.tail_position].reshape(3, 2)
    limit = now.p.servo_rate_limit
    servos[:, 0] += 0.5 * STEP * np.mean(np.clip(servos[:, 1], -limit, limit))
    forward(continuous, soon)
    first = soon.act_dot[tilt].copy()
    kept = data.act[tilt].copy()
    forward(model, data)
    found = data.act_dot[tilt]
    soon.act[tilt] += 0.5 * STEP * found
    forward(continuous, soon)
    # the inflow is that at the start's tilt, whose change in half a step moves it by 4e-6, and the
    # slopes that go with it by five times as much
    assert found == pytest.approx(soon.act_dot[tilt], rel=3e-5)
    assert np.all(np.abs(first - found) > 1e-3 * np.abs(found))
    # reported half a step on, as the tilt is kept half a step early
    assert data.sensor("flapping").data == pytest.approx(kept + 0.5 * STEP * found, rel=1e-9)


def test_the_noise_is_splitmix64_of_the_seed_channel_and_knot():
    """In whole numbers modulo 2^64: two rounds of the mix, then the sum of four 16-bit lanes."""
    whole = (1 << 64) - 1
    golden, first, second = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
    for seed, channel, knot in ((0, 0, 0), (1, 0, 5), (7, 3, 10**6), (2**31, 12, -4)):
        x = (seed * golden + channel * 0xD1342543DE82EF95 + knot * first) & whole
        for _ in range(2):
            x = (x + golden) & whole
            x = ((x ^ (x >> 30)) * first) & whole
            x = ((x ^ (x >> 27)) * second) & whole
            x ^= x >> 31
        lanes = sum((x >> shift) & 0xFFFF for shift in (0, 16, 32, 48))
        expected = (lanes / 65535.0 - 2.0) * np.sqrt(3.0)
        with np.errstate(over="ignore"):
            found = pilot.hashed_noise(seed, channel, knot)
        assert found == pytest.approx(expected, abs=1e-15)


def test_a_gust_comes_and_goes_by_its_cosine():
    times = np.linspace(-0.5, 2.5, 301)
    found = [air.one_minus_cosine(since, 0.7, 0.4) for since in times]
    assert found == pytest.approx(restated.gust(times, 0.7, 0.4), abs=1e-14)
    # where hold is nothing, half a turn up and half down is 1 - cosine's own mean, 1/2
    assert np.mean([air.one_minus_cosine(t, 1.0, 0.0) for t in np.arange(200) / 100.0]) == (
        pytest.approx(0.5, abs=1e-14)
    )


# Sweeps, doublets and the hashed noise behind the human remnant.

hashed_noise, remnant, sweep = (
    njit(law) for law in (pilot.hashed_noise, pilot.remnant, pilot.sweep)
)  # the hash wraps around at 64 bits, of which Python's own arithmetic warns

W_MIN, W_MAX, DURATION = 0.3, 30.0, 84.0
SIGMAS = 4.5
"""Chance of a false alarm 7e-6 for each statement, were the seeds not fixed."""


@given(time=st.floats(0.5, DURATION - 0.5))
def test_phase_derivative_is_the_frequency_formula(time):
    """d(phase)/dt = w_min + C2 (exp(C1 t/T) - 1)(w_max - w_min), C1 = 4, C2 = 1/(e^4 - 1)."""
    h = 1e-3
    phase = [pilot.sweep_phase(time + k * h, DURATION, W_MIN, W_MAX) for k in (-1, 1)]
    formula = W_MIN + (math.exp(4.0 * time / DURATION) - 1.0) / (math.exp(4.0) - 1.0) * (
        W_MAX - W_MIN
    )
    # truncation h^2/6 (C1/T)^2 w_max = 1.2e-8; rounding 1e-13 / h
    assert (phase[1] - phase[0]) / (2.0 * h) == pytest.approx(formula, abs=2e-8)


def test_unsteady_sweep_differs_by_seed():
    time = np.linspace(2.0, DURATION - 2.0, 400)
    flown = [
        np.array([sweep(t, DURATION, W_MIN, W_MAX, 1.0, u, s) for t in time])
        for u, s in ((0.0, 1.0), (0.1, 1.0), (0.1, 2.0))
    ]
    assert not np.allclose(flown[1], flown[2])
    for wobbling in flown[1:]:
        # rms of 0.1 in amplitude and 0.1 rad in phase: 0.1 of the sweep, within a factor 2
        assert 0.05 < np.std(wobbling - flown[0]) / np.std(flown[0]) < 0.2


def test_remnant_is_continuous_with_unit_variance():
    interval = 0.1
    knots = [remnant(k * interval, interval, 4.0, 1) for k in range(1, 6)]
    for k, value in enumerate(knots, start=1):
        around = [remnant(k * interval + d, interval, 4.0, 1) for d in (-1e-9, 1e-9)]
        assert around == pytest.approx([value, value], abs=1e-7)  # slope below 100 / s x 1e-9 s
    time = np.linspace(0.0, 2000.0, 80_001)
    values = np.array([remnant(t, interval, 4.0, 1) for t in time])
    # 20000 independent knots; kurtosis of a mixture of neighbours stays below 3
    assert abs(values.var() - 1.0) < SIGMAS * math.sqrt(2.0 / 20_000)


def test_a_sweep_fades_in_and_out():
    time = np.linspace(-2.0, DURATION + 2.0, 2001)
    shape = np.interp(time, [0.0, 3.0, DURATION - 3.0, DURATION], [0.0, 1.0, 1.0, 0.0])
    phase = [pilot.sweep_phase(t, DURATION, W_MIN, W_MAX) for t in time]
    found = [pilot.sweep(t, DURATION, W_MIN, W_MAX, 3.0, 0.0, 1.0) for t in time]
    assert found == pytest.approx(shape * np.sin(phase), abs=1e-12)  # rounding
    assert pilot.sweep_phase(0.0, DURATION, W_MIN, W_MAX) == 0.0


def test_a_doublet_is_as_long_one_way_as_the_other():
    found = [pilot.doublet(t, 3.0) for t in (-0.1, 0.0, 0.7, 1.49, 1.5, 2.9, 3.0, 9.0)]
    assert found == [0.0, 1.0, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0]


# The gyro's filters, the swashplate's mixing and the servos' delay.

FREQUENCY, DAMPING = 175.0, 0.7


@given(
    first=st.floats(1e-4, 0.1),
    second=st.floats(1e-4, 0.1),
    period=st.sampled_from([0.001, 0.002, 0.01]),
)
def test_filters_are_sampled_exactly(first, second, period):
    """Two filters in a row, what drives them held: their convolution, also if they are alike."""
    decay = math.exp(-period / first)
    assert gyro.filter_share(first, period) == pytest.approx(1.0 - decay, rel=1e-12)
    for other in (second, first, first * (1.0 + 1e-9)):

        def arriving(time, other=other):
            return math.exp(-time / first - (period - time) / other) / other

        wanted, _ = quad(arriving, 0.0, period, epsabs=1e-14, epsrel=1e-12, limit=200)
        assert gyro.filter_through(first, other, period) == pytest.approx(wanted, rel=1e-9)
    mean = first / period * (1.0 - decay)
    assert gyro.filter_mean(first, period) == pytest.approx(mean, rel=1e-12)


@pytest.mark.parametrize("period", [0.001, 0.002, 0.004])
def test_held_lag_is_the_lag_of_the_sampled_filter(period):
    """A ramp through the filter of held samples comes out late by `held_lag`."""
    time_constant = 0.003
    decay = math.exp(-period / time_constant)
    state, ramp = 0.0, 0.0
    for k in range(200):
        ramp = k * period
        late = ramp - state
        state = decay * state + (1.0 - decay) * ramp
    assert late == pytest.approx(gyro.held_lag(time_constant, period), rel=1e-9)  # settled


@given(omega=st.floats(0.1, 10.0))
def test_equivalent_delay_is_the_low_frequency_phase(omega):
    """Well below its bandwidth the servo's phase is that of a delay 2 z / w."""
    phase = -np.angle(FREQUENCY**2 / (FREQUENCY**2 - omega**2 + 2j * DAMPING * FREQUENCY * omega))
    delay = gyro.equivalent_delay(FREQUENCY, DAMPING)
    assert delay == pytest.approx(0.008, rel=1e-12)  # 8 ms (design, section 5)
    # next term of the phase is of relative order (omega / frequency)^2
    assert phase / omega == pytest.approx(delay, rel=(omega / FREQUENCY) ** 2 + 1e-12)
