"""A vehicle with dynamic inflow: beside the quasi-steady one, closed forms and single blades."""

import copy

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from helisim.physics.layout import CONTROL, PARAM, STATE
from helisim.physics.native import installed
from helisim.vehicle import Vehicle, load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.swashplate import flapping_from_blade
from helisim.vehicle.trim import place

SERVOS = ("front_position", "left_position", "right_position")
INFLOW = ("inflow_0", "inflow_s", "inflow_c")


@pytest.fixture(scope="module")
def moving() -> Vehicle:
    return load("jr700", parameters={"main_rotor.inflow": "pitt-peters"})


def rotor_numbers(vehicle):
    own = vehicle.parameters
    speed, radius = own["main_rotor.speed"], own["main_rotor.radius"]
    sigma = own["main_rotor.blades"] * own["main_rotor.chord"] / (np.pi * radius)
    mean = vehicle.trim.inflow_0 / (speed * radius)
    return speed, speed * radius, own["main_rotor.lift_slope"] * sigma, mean


CONTROLS = ("phi", "theta", "col", "lon", "lat", "ped", "a", "b")


def test_hover_and_derivatives_are_the_quasi_steady_ones(jr700, moving):
    """Inflow at rest carries the same thrust, and inflow that has followed leaves nothing.

    But for what drift tilts the disc by: a wake that drift skews at once is in Pitt and Peters'.
    """
    for name in CONTROLS:
        # both trims leave 1e-9 m/s^2 at most: 1e-10 of a control unit of 42 m/s^2 and more
        at_rest, still = getattr(moving.trim, name), getattr(jr700.trim, name)
        assert at_rest == pytest.approx(still, abs=1e-9), name
    for name, value in jr700.derivatives.items():
        if not name.endswith(("_u", "_v")):
            # central differences of steps of 1e-5, here of one state more on the way: 2e-7 of N_v
            assert moving.derivatives[name] == pytest.approx(value, rel=1e-6, abs=1e-7), name


def test_hovers_inflow_row_is_chen_and_hindsons(moving):
    """NASA TM 88327, Table 1, first row, for Carpenter and Fridovich's mass: C_0 = 0.639.

    v' = -75 pi W/32 (v + as/16) C_0 v + 75 pi W/64 (v + as/8) C_0 w + 25 pi W^2 R as/256 C_0 theta
    """
    speed, tip, loading, mean = rotor_numbers(moving)
    linear, row = moving.linearize(), 75.0 * np.pi * speed * 0.639
    collective = sum(linear.derivative("inflow_0", name) for name in SERVOS)
    found = [
        linear.derivative("inflow_0", "inflow_0"),
        linear.derivative("inflow_0", "w"),
        collective / moving.parameters["main_rotor.pitch_range"],
    ]
    printed = [
        -row / 32.0 * (mean + loading / 16.0),
        row / 64.0 * (mean + loading / 8.0),
        25.0 * np.pi * speed * tip * loading * 0.639 / 256.0,
    ]
    assert found == pytest.approx(printed, rel=5e-3)  # 0.639 has three digits; tilt of 3.8 deg


class Blades:
    """Four blades, one by one, in the published inflow: first principles, hub fixed in a wind.

    Strips and each blade's own second-order flapping; loads summed over the blades; L and M as
    printed (Peters and HaQuang, J. AHS 33, 1988), azimuth by geometry; flight is straight ahead.

    Args:
        lock: gamma.
        spring: nu^2 - 1.
        speed: rad/s.
        hand: 1 clockwise seen from above, -1 the other way.
        loading: a sigma.
        pitch: collective, rad.
        advance: of the hub ahead, over the tip speed.
        climb: likewise, up the shaft.
    """

    def __init__(self, lock, spring, speed, hand, loading, pitch, advance, climb):
        self.lock, self.spring, self.speed, self.hand = lock, spring, speed, hand
        self.loading, self.pitch, self.advance, self.climb = loading, pitch, advance, climb

    def azimuth(self, t):
        return self.speed * t + 0.5 * np.pi * np.arange(4)  # from the tail, as it turns

    def rates(self, t, state, cyclic):
        up, rising, inflow = state[:4], state[4:8], state[8:]
        psi, r = self.azimuth(t), (np.arange(40)[:, None] + 0.5) / 40
        ahead, right = -np.cos(psi), -self.hand * np.sin(psi)
        tangential = r + self.advance * np.sin(psi)
        angle = self.pitch + cyclic[0] * np.sin(psi) + self.hand * cyclic[1] * np.cos(psi)
        # a blade that points ahead and is coned has the wind on its lower side
        blown = self.climb + inflow[0] - self.advance * ahead * up
        down = blown + r * (inflow[1] * right - inflow[2] * ahead + rising / self.speed)
        lift = tangential**2 * angle - tangential * down
        moment = np.mean(r * lift, axis=0)
        swing = self.speed**2 * (0.5 * self.lock * moment - (1.0 + self.spring) * up)
        loads = np.array([np.mean(lift, axis=0), moment * right, -moment * ahead])
        through = self.climb + inflow[0]
        total = np.hypot(self.advance, through)
        harmonic = (self.advance**2 + through * (through + inflow[0])) / total
        x, c = np.tan(0.5 * np.arctan2(self.advance, through)), 15.0 * np.pi / 64.0
        influence = [[0.5, 0, -c * x], [0, 2 * (1 + x * x), 0], [c * x, 0, 2 * (1 - x * x)]]
        held = np.array([total, harmonic, harmonic]) * np.linalg.solve(influence, inflow)
        mass = np.array([8.0 / 3.0, 16.0 / 45.0, 16.0 / 45.0]) / np.pi
        growth = self.speed * (0.5 * self.loading * np.mean(loads, axis=1) - held) / mass
        return np.concatenate([rising, swing, growth])

    def fly(self, start, cyclic, times):
        return solve_ivp(
            self.rates, times[[0, -1]], start, args=(cyclic,), t_eval=times, rtol=1e-7,
            max_step=2e-3,
        ).y  # fmt: skip

    def disc(self, states, times):
        """Return tilts a, b, and mean and slopes of the inflow by a turn's mean, (5, n_time)."""
        up, psi = states[:4], np.array([self.azimuth(t) for t in times]).T
        a = -2.0 * np.mean(up * np.cos(psi), axis=0)
        b = 2.0 * self.hand * np.mean(up * np.sin(psi), axis=0)
        return np.vstack([a, b, states[8:]])


HALF = [(1.0, "b", 0.0), (-1.0, "a", 0.0), (-1.0, "b", 15.0)]
HALF = [pytest.param(*one, marks=pytest.mark.slow) for one in HALF]
"""Of all: each two of the three in all their ways."""


@pytest.mark.parametrize(
    ("hand", "axis", "airspeed"),
    [(1.0, "a", 15.0), *HALF],
)
def test_tilt_and_slopes_are_those_of_blades_one_by_one(hand, axis, airspeed):
    stock = load("jr700").parameters
    reduction, speed = stock["flapping.lock_reduction"], stock["main_rotor.speed"]
    lock, nu, step = 6.0, 1.03, 0.02
    turning = {"lock_number": lock / reduction, "speed": speed, "direction": hand}
    unit = {"lon_range": 1.0, "lat_range": 1.0}
    flapping = flapping_from_blade(**turning, **unit, flap_frequency=nu).to_parameters()
    changes = {**flapping, "main_rotor.direction": hand, "main_rotor.inflow": "pitt-peters"}
    vehicle = load("jr700", parameters=changes).trimmed(speed=airspeed)
    _, tip, loading, mean = rotor_numbers(vehicle)
    trim, own = vehicle.trim, vehicle.parameters
    system = vehicle.linearize().system
    states = [system.state_labels.index(name) for name in ("flap_a", "flap_b", *INFLOW)]
    servos = [system.state_labels.index(name) for name in SERVOS]
    matrix = np.asarray(system.A)
    tilt = step * np.array([axis == name for name in ("a", "b")], dtype=float)
    driven = matrix[np.ix_(states, servos)] @ vehicle.swashplate.mix(0.0, tilt[0], tilt[1])
    grown = np.zeros((6, 6))
    grown[:5, :5], grown[:5, 5] = matrix[np.ix_(states, states)], driven
    pitch = own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * trim.col
    motion = trim.motion
    blades = Blades(lock, nu**2 - 1.0, speed, hand, loading, pitch, motion.u / tip, -motion.w / tip)
    cyclic = np.array([trim.lon, trim.lat])
    slopes = np.array([mean, trim.inflow_s / tip, trim.inflow_c / tip])
    settling = np.linspace(0.0, 12.0 * 2.0 * np.pi / speed, 200)
    settled = blades.fly(np.concatenate([np.zeros(8), slopes]), cyclic, settling)[:, -1]
    time = settling[-1] + np.linspace(0.0, 0.15, 300)
    plain, moved = (
        blades.disc(blades.fly(settled, asked, time), time) for asked in (cyclic, cyclic + tilt)
    )
    truth = dict(zip(("a", "b", "mean", "right", "aft"), moved - plain))
    since = time - time[0]
    disc = np.array([expm(grown * t)[:5, 5] for t in since]).T / np.array([[1, 1, tip, tip, tip]]).T
    found = dict(zip(truth, disc))
    # a turn's mean of four blades is left with 1e-4 rad of their four beats a turn
    assert plain[:2, -1] == pytest.approx([trim.a, trim.b], abs=2e-4)
    assert plain[2:, -1] == pytest.approx(slopes, abs=1e-4)
    # the disc's equations have no nutation, near twice the rotor's speed, gone after 16 / (gamma
    # Omega) = 15 ms: an eighth of the tilt at first, and of second order in mu what flight adds
    late = since > 0.08
    most = max(np.abs(truth["right"]).max(), np.abs(truth["aft"]).max())
    for name, size in (("a", step), ("b", step), ("mean", most), ("right", most), ("aft", most)):
        assert found[name] == pytest.approx(truth[name], abs=0.25 * size), name
        assert found[name][late] == pytest.approx(truth[name][late], abs=0.08 * size), name
    for name in ("a", "b"):
        assert found[name][late] == pytest.approx(truth[name][late], abs=0.015 * step), name


def stepped(step, until=0.06):
    parameters = {"main_rotor.inflow": "pitt-peters"}
    vehicle = load("jr700", parameters=parameters, integrator="Euler", timestep=step)
    model, where = copy.copy(vehicle.model), addresses(vehicle.model)
    model.actuator_user[where.rotor, PARAM.gyro_on] = 0.0
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim)
    still, level = data.qvel.copy(), data.qpos.copy()
    servos = slice(where.control + CONTROL.servo_front, where.control + CONTROL.servo_tail)
    data.ctrl[servos] += vehicle.swashplate.mix(0.05, 0.03, 0.02)
    with installed():
        for _ in range(round(until / step)):
            mujoco.mj_step(model, data)
            data.qvel[:], data.qpos[:] = still, level
        mujoco.mj_forward(model, data)
    disc = slice(where.state + STATE.flap_a, where.state + STATE.inflow_c + 1)
    sensed = data.sensor("flapping").data, data.sensor("rotor").data[[0, 2]]
    # what is kept is half a step old, what is sensed is not
    return np.concatenate([data.act[disc] + 0.5 * step * data.act_dot[disc], *sensed])


def test_eulers_error_falls_with_the_square_of_its_step():
    """Staggered steps, as the tilt's: 0.1 % of what moves at 2 ms, a quarter of that at 1 ms."""
    truth = stepped(0.00025)
    moved = np.abs(truth - stepped(0.00025, until=0.0))
    coarse, fine = (np.abs(stepped(step) - truth) for step in (0.002, 0.001))
    assert np.all(np.delete(coarse / moved, 4) < 1e-3)  # the slope fore and aft moves little
    # the truth has 1/64 of the error of 2 ms itself: 4.2 instead of 4
    assert coarse / fine == pytest.approx(4.2, abs=0.4)
