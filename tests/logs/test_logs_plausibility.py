"""What a flight's channels can't be: units, signs and axes, told from the data alone."""

from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import helisim as hs
from helisim.base.units import RAD_PER_DEG, STANDARD_GRAVITY
from helisim.logs import Column, Map, read_log
from helisim.logs.examples import examples
from helisim.logs.screening import Channels, implausible
from remedies import said

SI = {
    **dict.fromkeys("pqr", "rad/s"),
    **dict.fromkeys(("phi", "theta", "psi"), "rad"),
    **dict.fromkeys("uvw", "m/s"),
    **dict.fromkeys(("north", "east", "down"), "m"),
    **dict.fromkeys(("ax", "ay", "az"), "m/s^2"),
}
ANGLES, FORCES = ("phi", "theta", "psi"), ("ax", "ay", "az")


@cache
def flight(seed=0, size=1.0):
    return turned_flight(60.0, seed, size=size, noise=0.02)[1]


def found(columns, step=0.01, **declared):
    """Return the findings of columns that are declared in SI, but for those in `declared`."""
    said = {name: Column(f"{name}_raw", SI.get(name, "1")) for name in columns}
    return implausible(Channels(step, columns, said | declared))


def options(columns, **declared):
    return {said(finding) for finding in found(columns, **declared)}


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_said_of_a_sound_flight(seed):
    """Attitudes to 60 degrees and noise of 2 %: each channel goes with the others."""
    assert found(flight(seed)) == []


def test_rates_and_angles_in_another_unit_are_told():
    """By their size, by what they would swing, or where they are small by their angles."""
    fast = flight() | {name: flight()[name] / RAD_PER_DEG for name in "pqr"}
    expected = {f"--channel {name}={name}_raw:deg/s" for name in "pqr"}
    assert options(fast) == expected
    alone = {"p": flight(size=0.2)["p"] / RAD_PER_DEG}
    (swing,) = found(alone)
    assert said(swing) == "--channel p=p_raw:deg/s"
    assert "more than it can" in swing.text
    slow = flight(size=0.05) | {name: flight(size=0.05)[name] / RAD_PER_DEG for name in "pqr"}
    assert options(slow) == expected
    (one, *_) = found(slow)
    assert "times d(phi)/dt" in one.text
    assert float(one.text.split()[2]) == pytest.approx(57.3, rel=0.03)
    columns = flight() | {name: flight()[name] / RAD_PER_DEG for name in ANGLES}
    assert options(columns) == {f"--channel {name}={name}_raw:deg" for name in ("phi", "theta")}
    degrees = {name: Column(f"{name}_raw", "deg") for name in ANGLES}
    gentle = flight(size=0.2)
    columns = gentle | {name: RAD_PER_DEG * gentle[name] for name in ANGLES}
    assert options(columns, **degrees) == {f"--channel {name}={name}_raw:rad" for name in ANGLES}


def test_swapped_axes_are_told_with_their_signs():
    own = flight()
    (two,) = options(own | {"p": own["q"], "q": -own["p"]})
    assert two == "--channel q=p_raw:rad/s --channel p=q_raw:rad/s:sign=-1"
    (ring,) = options(own | {"p": own["q"], "q": own["r"], "r": own["p"]})
    assert ring == "--channel q=p_raw:rad/s --channel r=q_raw:rad/s --channel p=r_raw:rad/s"


@pytest.mark.parametrize("name", ["p", "q", "r"])
def test_a_wrong_sign_is_told(name):
    (finding,) = found(flight() | {name: -flight()[name]})
    assert finding.kind == "sign"
    assert f"{name}={name}_raw:{SI[name]}:sign=-1" in said(finding)


def test_gravity_alone_tells_an_accelerometer():
    random = np.random.default_rng(0)
    rest = {name: 0.02 * random.standard_normal(6000) for name in FORCES}
    down = rest | {"az": rest["az"] - STANDARD_GRAVITY}
    assert found(down) == []
    assert options(down | {"az": -down["az"]}) == {"--channel 'az=az_raw:m/s^2:sign=-1'"}
    in_g = {name: down[name] / STANDARD_GRAVITY for name in FORCES}
    assert options(in_g) == {"--channel az=az_raw:g"}
    assert options({"az": -down["az"] / STANDARD_GRAVITY}) == {"--channel az=az_raw:g:sign=-1"}


def test_controls_that_are_pulses_or_percent_are_told():
    """1100 to 1900 are a radio's pulses; -40 to 40 are no share of one."""
    t = 2.0 * np.pi * np.arange(6000) / 1000.0
    pulses = found({"lat": 1500.0 + 400.0 * np.sin(t)})
    assert said(pulses[0]) == "--channel lat=lat_raw:us:trim=1500:range=800"
    assert options({"LON": 40.0 * np.sin(t)}) == {"--channel LON=LON_raw:percent"}
    assert found({"lat": 0.5 * np.sin(t)}) == []


def test_example_flights_are_plausible():
    for example in examples().values():
        map_ = None if example.map is None else Map.from_toml(example.map)
        log = read_log(example.path, channels=map_)
        kinds = {one.kind for one in log.report.findings}
        assert not kinds & {"unit", "sign", "axes", "scale", "unit of time"}
        assert hs.open_example(example.name) == log.record


def test_a_log_that_is_read_is_told_so(tmp_path):
    t = np.arange(6000) / 100.0
    columns = np.column_stack([t, flight()["p"] / RAD_PER_DEG, flight()["phi"]])
    path = tmp_path / "a.csv"
    np.savetxt(path, columns, delimiter=",", header="t [s],p [rad/s],phi [rad]", comments="")
    report = read_log(path).report
    assert [finding.kind for finding in report.findings] == ["unit"]
    assert any(said(one) == "--channel 'p=p [rad/s]:deg/s'" for one in report.findings)


@pytest.mark.slow
def test_simulated_flights_are_plausible():
    """A mission at 20 m/s, with the sensors' noise and lags: nothing is said.

    The simulator integrates positions, attitudes and forces by MuJoCo, and knows none of this.
    """
    vehicle = hs.load("jr700")
    (record,) = hs.fly(vehicle, hs.missions.Forward(speed=20.0), seed=1)
    declared = {one.name: Column(one.name, one.unit) for one in record.channels}
    columns = {name: record[name] for name in record.names}
    assert implausible(Channels(record.sample_time, columns, declared)) == []
    flipped = Channels(record.sample_time, columns | {"q": -record["q"]}, declared)
    assert [one.kind for one in implausible(flipped)] == ["sign"]


RATE = 100.0
GRAVITY = 9.80665
_FINE = 1000.0
_POLE, _SLOW = np.exp(-2.0 * np.pi * np.array([1.2, 0.15]) / _FINE)


def turned_flight(duration=60.0, seed=0, *, size=1.0, noise=0.0):
    """Return time, and SI channels by name: p to r, phi to psi, u to w, north to down, ax to az.

    Rates and velocities are noise from 0.15 to 1.2 Hz; the rest follows from them.
    """
    random = np.random.default_rng(seed)
    fine, every = _FINE, round(_FINE / RATE)
    count = int(duration * fine)
    white = random.standard_normal((count, 6))
    columns = white - np.mean(white, axis=0)
    for _ in range(3):  # to about 1 Hz
        columns = lfilter([1.0 - _POLE], [1.0, -_POLE], columns, axis=0)
    drift = lfilter([1.0 - _SLOW], [1.0, -_SLOW], columns, axis=0)
    columns = (columns - drift) / np.std(columns - drift, axis=0)
    rates, velocity = 0.5 * size * columns[:, :3], 2.0 * size * columns[:, 3:]
    attitude = np.empty((count, 4))
    quaternions = Rotation.from_rotvec(rates / fine).as_quat()  # exact for a constant rate
    q = Rotation.identity().as_quat()
    for k in range(count):
        attitude[k] = q
        x, y, z, w = q
        a, b, c, d = quaternions[k]
        i, j = w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a
        q = np.array([i, j, w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c])
    turned = Rotation.from_quat(attitude)
    psi, theta, phi = turned.as_euler("ZYX").T
    world = turned.apply(velocity)
    position = np.cumsum(world, axis=0) / fine
    force = turned.inv().apply(np.gradient(world, 1.0 / fine, axis=0) - [0.0, 0.0, GRAVITY])
    table = {
        **dict(zip("pqr", rates.T)),
        "phi": phi,
        "theta": theta,
        "psi": np.unwrap(psi),
        **dict(zip("uvw", velocity.T)),
        **dict(zip(("north", "east", "down"), position.T)),
        **dict(zip(("ax", "ay", "az"), force.T)),
    }
    time = np.arange(count) / fine
    spoiled = {
        name: values[::every] + noise * np.std(values) * random.standard_normal(count // every)
        for name, values in table.items()
    }
    return time[::every], spoiled
