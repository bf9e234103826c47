"""What a flight's channels can't be: units, signs, axes and clocks, told from the data alone."""

from functools import cache

import numpy as np
import pytest

import helisim as hs
import turning
from helisim.base.units import METRE_PER_FOOT, RAD_PER_DEG, STANDARD_GRAVITY
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
    return turning.flight(60.0, seed, size=size, noise=0.02)[1]


def found(columns, step=0.01, **declared):
    """Return the findings of columns that are declared in SI, but for those in `declared`."""
    said = {name: Column(f"{name}_raw", SI.get(name, "1")) for name in columns}
    return implausible(Channels(step, columns, said | declared, "t"))


def options(columns, **declared):
    return {said(finding) for finding in found(columns, **declared)}


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_said_of_a_sound_flight(seed):
    """Attitudes to 60 degrees and noise of 2 %: each channel goes with the others."""
    assert found(flight(seed)) == []


def test_nothing_is_said_of_what_hardly_moves():
    """Noise alone, or a flight below its noise, shows nothing."""
    random = np.random.default_rng(0)
    noise = {
        name: 0.01 * random.standard_normal(6000) for name in SI if name not in ("ax", "ay", "az")
    }
    assert found(noise) == []
    quiet = {name: 0.003 * flight()[name] + noise[name] for name in noise}
    assert found(quiet | {"p": 57.3 * quiet["p"]}) == []
    assert found({name: values[:200] for name, values in flight().items()}) == []


def test_rates_in_degrees_are_told():
    """By their size, by what they would swing, or where they are small by their angles."""
    fast = flight() | {name: flight()[name] / RAD_PER_DEG for name in "pqr"}
    expected = {f"--channel {name}={name}_raw:deg/s" for name in "pqr"}
    assert options(fast) == expected
    alone = {"p": flight(size=0.2)["p"] / RAD_PER_DEG}
    (swing,) = found(alone)
    assert said(swing) == "--channel p=p_raw:deg/s"
    assert "would swing the vehicle to and fro" in swing.text
    slow = flight(size=0.05) | {name: flight(size=0.05)[name] / RAD_PER_DEG for name in "pqr"}
    assert options(slow) == expected
    (one, *_) = found(slow)
    assert "times d(phi)/dt (coherence 1.00)" in one.text
    assert float(one.text.split()[2]) == pytest.approx(57.3, rel=0.03)


def test_angles_in_degrees_are_told():
    """Declared as rad they reach what no angle can; and so the rates aren't blamed."""
    columns = flight() | {name: flight()[name] / RAD_PER_DEG for name in ANGLES}
    assert options(columns) == {f"--channel {name}={name}_raw:deg" for name in ANGLES}


def test_angles_in_radians_declared_as_degrees_are_told():
    """They hardly move as what they are declared to be."""
    degrees = {name: Column(f"{name}_raw", "deg") for name in ANGLES}
    columns = flight() | {name: RAD_PER_DEG * flight()[name] for name in ANGLES}
    assert options(columns, **degrees) == {f"--channel {name}={name}_raw:rad" for name in ANGLES}


def test_swapped_axes_are_told_with_their_signs():
    """Two rates, all three in a ring, and accelerometers; with a sign where one is needed."""
    own = flight()
    assert options(own | {"p": own["q"], "q": -own["p"]}) == {
        "--channel q=p_raw:rad/s --channel p=q_raw:rad/s:sign=-1"
    }
    ring = own | {"p": own["q"], "q": own["r"], "r": own["p"]}
    assert options(ring) == {
        "--channel q=p_raw:rad/s --channel r=q_raw:rad/s --channel p=r_raw:rad/s"
    }
    forces = own | {"ax": own["az"], "az": own["ax"]}
    assert options(forces) == {"--channel 'az=ax_raw:m/s^2' --channel 'ax=az_raw:m/s^2'"}


def test_swapped_rates_are_told_by_one_angle():
    """A log without heading: r is the bank's derivative, p is not; a heading is not needed."""
    own = {name: flight()[name] for name in ("p", "r", "phi", "theta")}
    # a gentler flight, whose rates are nearly the angles' derivatives
    own["phi"] = np.cumsum(own["p"]) * 0.01
    assert options(own) == set()
    assert options(own | {"p": own["r"], "r": own["p"]}) == {
        "--channel p=r_raw:rad/s --channel r=p_raw:rad/s"
    }


@pytest.mark.parametrize("name", ["p", "q", "r", "u", "v", "w", "ay"])
def test_a_wrong_sign_is_told(name):
    """Of a rate by its angle, of a velocity by the position, of an acceleration by the velocity."""
    (finding,) = found(flight() | {name: -flight()[name]})
    assert finding.kind == "sign"
    assert f"{name}={name}_raw:{SI[name]}:sign=-1" in said(finding)


def test_a_right_sign_is_not_lost():
    """A column that is declared with sign -1 and needs none is offered without."""
    q = Column("q_raw", "deg/s", -1)
    assert options(flight() | {"q": -flight()["q"]}, q=q) == {"--channel q=q_raw:deg/s"}


@pytest.mark.parametrize(
    ("names", "factor", "unit"),
    [
        ("uvw", METRE_PER_FOOT, "ft/s"),
        ("uvw", 1852.0 / 3600.0, "kt"),
        ("w", 0.01, "cm/s"),
        (FORCES, STANDARD_GRAVITY, "g"),
        (FORCES, METRE_PER_FOOT, "ft/s^2"),
    ],
)
def test_velocities_and_accelerations_in_other_units_are_told(names, factor, unit):
    """In what the log's own positions and velocities say."""
    said = options(flight() | {name: flight()[name] / factor for name in names})
    assert {option.strip("'").rpartition(":")[2] for option in said} == {unit}
    assert len(said) == len(names)


def test_gravity_alone_tells_an_accelerometer():
    """At rest: its unit, its sign, and the axis that is up."""
    random = np.random.default_rng(0)
    rest = {name: 0.02 * random.standard_normal(6000) for name in FORCES}
    down = rest | {"az": rest["az"] - STANDARD_GRAVITY}
    assert found(down) == []
    assert options(down | {"az": -down["az"]}) == {"--channel 'az=az_raw:m/s^2:sign=-1'"}
    assert options({name: down[name] / STANDARD_GRAVITY for name in FORCES}) == {
        "--channel az=az_raw:g"
    }
    assert options({"az": -down["az"] / STANDARD_GRAVITY}) == {"--channel az=az_raw:g:sign=-1"}
    side = rest | {"ay": rest["ay"] - STANDARD_GRAVITY}
    assert options(side) == {"--channel 'az=ay_raw:m/s^2'"}


def test_a_clock_in_another_unit_is_told():
    """Milliseconds as seconds make every rate a thousand times its angle's derivative."""
    (finding,) = found(flight(), step=10.0)
    assert (finding.kind, said(finding)) == ("unit of time", "--time t:ms")


def test_controls_that_are_pulses_or_percent_are_told():
    """1100 to 1900 are a radio's pulses; -40 to 40 are no share of one."""
    t = 2.0 * np.pi * np.arange(6000) / 1000.0
    pulses = found({"lat": 1500.0 + 400.0 * np.sin(t)})
    assert said(pulses[0]) == "--channel lat=lat_raw:us:trim=1500:range=800"
    assert options({"LON": 40.0 * np.sin(t)}) == {"--channel LON=LON_raw:percent"}
    assert found({"lat": 0.5 * np.sin(t)}) == []


def test_example_flights_are_plausible():
    """The flights that come along: nothing is wrong with them."""
    for example in examples().values():
        map_ = None if example.map is None else Map.from_toml(example.map)
        kinds = {one.kind for one in read_log(example.path, channels=map_).report.findings}
        assert not kinds & {"unit", "sign", "axes", "scale", "unit of time"}


def test_a_log_that_is_read_is_told_so(tmp_path):
    """The note is in the report, with the option that can be pasted."""
    t = np.arange(6000) / 100.0
    columns = np.column_stack([t, flight()["p"] / RAD_PER_DEG, flight()["phi"]])
    path = tmp_path / "a.csv"
    np.savetxt(path, columns, delimiter=",", header="t [s],p [rad/s],phi [rad]", comments="")
    report = read_log(path).report
    assert [finding.kind for finding in report.findings] == ["unit"]
    assert any(said(one) == "--channel 'p=p [rad/s]:deg/s'" for one in report.findings)


@pytest.mark.slow
def test_simulated_flights_are_plausible():
    """A mission at 20 m/s and a pirouette, with the sensors' noise and lags: nothing is said.

    The simulator integrates positions, attitudes and forces by MuJoCo, and knows none of this.
    """
    vehicle = hs.load("jr700")
    for mission in (hs.missions.Forward(speed=20.0), hs.missions.Pirouette()):
        (record,) = hs.fly(vehicle, mission, seed=1)
        declared = {one.name: Column(one.name, one.unit) for one in record.channels}
        columns = {name: record[name] for name in record.names}
        assert implausible(Channels(record.sample_time, columns, declared, "time")) == []
        flipped = Channels(record.sample_time, columns | {"q": -record["q"]}, declared, "time")
        told = [one.kind for one in implausible(flipped)]
        assert told == (["sign"] if record.duration > 60.0 else [])  # a pirouette of 16 s is short
