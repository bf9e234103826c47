"""What Rotorflight's law does at its loops: gains in counts, filters, turning, limits."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bilinear, freqz, lfilter

import helisim as hs
from helisim.design import laws
from helisim.design.laws import rotorflight as filters
from helisim.design.laws import rotorflight_kernel as kernel
from helisim.physics.gyro import Seen
from tabled import tabled

PERIOD = 0.001
STILL = Seen(*np.zeros(len(Seen._fields)).tolist())
PLAIN = {"range": 0.4, "gyro_cutoff": 0.0, "relax_level": 0.0, "error_decay_time": 0.0, "o": 0.0}
ROLL = laws.CyclicRotorflight(**PLAIN)
YAW = laws.YawRotorflight(range=0.6, gyro_cutoff=0.0, relax_level=0.0)
COL = laws.CollectiveRotorflight(range=0.25)
LAW = hs.Rotorflight(
    roll=ROLL, pitch=ROLL, yaw=YAW, collective=COL, gyro_lowpass=0.0, cyclic_cross_coupling_gain=0.0
)


class Loops:
    """A law at its loops: terms P, I, D, F, B, O, x 1000, and the mixer, of a motion in deg/s."""

    def __init__(self, law):
        self.settings, self.state = law.numbers(PERIOD), np.zeros(kernel.COUNT)

    def __call__(self, roll=0.0, pitch=0.0, yaw=0.0, **sticks):
        p, q, r = np.radians([roll, -pitch, -yaw])
        seen = STILL._replace(p=p, q=q, r=r, **sticks)
        wanted, _, *terms = kernel.loop(seen, self.state, self.settings)
        self.mixer = 1e3 * np.array(kernel.mixed(self.state, self.settings, wanted, *terms))
        return 1e3 * np.array(terms)

    def at(self, block, name="error"):
        return int(self.settings[block + kernel.AXIS.state]) + getattr(kernel.STATE, name)

    def error(self, block):
        return self.state[self.at(block)]


def test_gains_are_the_firmware_s():
    """Counts for 10 deg/s, of gains and scales of its pid.h: 1000 scale gain 10, I after 0.1 s."""
    law = replace(LAW, roll=replace(ROLL, p=50.0, i=100.0), pitch=replace(ROLL, p=75.0, f=0.0))
    loops, tail = Loops(law), Loops(law)  # cyclic errors turn where it yaws
    for _ in range(100):
        terms = np.vstack([loops(roll=-10.0, pitch=-10.0)[:2], tail(yaw=-10.0)[2]])
    p, i, _, f, _, _ = terms.T
    # 6.66666e-6 of roll and pitch, 6.66666e-5 of yaw, whose error is positive: stop gain 120 %
    assert p == pytest.approx([3.33333, 5.0, 53.3333 * 1.2], rel=1e-5)
    # 2e-4 and 5e-4 times 1 deg
    assert i == pytest.approx([20.0, 20.0, 60.0], rel=1e-9)
    assert f == pytest.approx(0.0)
    full = Loops(law)(LAT=0.25)
    assert full[0, 3] == pytest.approx(2.5 * 0.5 * 240.0)  # F 100: 2.5 counts for 1 deg/s
    assert Loops(law)(yaw=20.0)[2, 0] == pytest.approx(-106.6666 * 0.8, rel=1e-5)


@pytest.mark.parametrize("cutoff", [2.5, 15.0, 50.0])
def test_filters_are_the_bilinear_ones(cutoff):
    """Warped so that the cutoff is kept, as scipy makes them of the continuous filters."""
    w = 2.0 / PERIOD * math.tan(math.pi * cutoff * PERIOD)
    analog = {filters.lowpass: [w], filters.highpass: [1.0, 0.0], filters.slope: [w, 0.0]}
    for made, above in analog.items():
        b0, b1, a1 = made(cutoff, PERIOD)
        b, a = bilinear(above, [1.0, w], 1.0 / PERIOD)
        np.testing.assert_allclose(freqz([b0, b1], [1.0, a1])[1], freqz(b, a)[1], atol=1e-9 * w)
    share, _, left = filters.pt1(cutoff, PERIOD)
    assert share == pytest.approx(cutoff / (cutoff + 1.0 / (2.0 * math.pi * PERIOD)))
    assert left == pytest.approx(share - 1.0)
    # filter.c limits a cutoff to 0.475 of the loops' rate, of a slope to half of that
    for made, most in ((filters.lowpass, 475.0), (filters.pt1, 475.0), (filters.slope, 237.5)):
        assert made(20.0 * cutoff + 500.0, PERIOD) == pytest.approx(made(most, PERIOD))


def test_d_is_of_the_rate_and_b_of_the_setpoint():
    """Noise through the filters of scipy; D 40 of pitch: 4e-5 of deg/s^2."""
    pitch = replace(ROLL, d=40.0, b=30.0)
    loops, rng = Loops(replace(LAW, pitch=pitch)), np.random.default_rng(1)
    rates, sticks = 20.0 * rng.standard_normal(200), rng.uniform(-0.5, 0.5, 200)
    terms = np.array([loops(pitch=q, LON=-s)[1] for q, s in zip(rates, sticks)])
    b0, b1, a1 = filters.slope(15.0, PERIOD)
    derived = [lfilter([b0, b1], [1.0, a1], one) for one in (-rates, 480.0 * sticks)]
    np.testing.assert_allclose(terms[:, 2], 4e-2 * derived[0], atol=1e-9)
    np.testing.assert_allclose(terms[:, 4], 3e-3 * derived[1], atol=1e-9)


def test_cyclic_errors_turn_with_the_yaw_rate():
    """A quarter of a turn to the left: what rolls right, about the nose, is then to pitch up."""
    loops = Loops(LAW)
    loops.state[loops.at(kernel.ROLL)] = 5.0
    for _ in range(250):
        loops(yaw=360.0)
    assert loops.error(kernel.ROLL) == pytest.approx(0.0, abs=1e-9)
    assert loops.error(kernel.PITCH) == pytest.approx(-5.0)


def test_limits_hold_the_mixer_and_stop_the_errors():
    """1250 of an axis; the swash ring of 100 keeps both within it; I waits for five loops."""
    loops = Loops(replace(LAW, roll=replace(ROLL, f=800.0), pitch=replace(ROLL, f=800.0)))
    loops(LAT=0.5, LON=-0.5)
    assert np.hypot(*loops.mixer[:2]) == pytest.approx(1250.0)
    before = loops.error(kernel.ROLL)
    for _ in range(5):
        loops(roll=-10.0, pitch=-10.0)
    assert loops.error(kernel.ROLL) == before > 0.0
    loops(roll=-10.0, pitch=-10.0)
    assert loops.error(kernel.ROLL) == pytest.approx(before + 10.0 * PERIOD)


@tabled("name", "roll", "pitch", "yaw", "whole")
def test_defaults_are_the_firmware_s(jr700, name, roll, pitch, yaw, whole):
    law = hs.Rotorflight.of(jr700)
    found = [getattr(one, name, None) for one in (law.roll, law.pitch, law.yaw, law)]
    assert found == [roll, pitch, yaw, whole]


def test_a_rotor_turns_as_its_helicopter_s():
    """Seen from above a Lynx's turns anticlockwise: Padfield, Helicopter Flight Dynamics."""
    turns = [hs.Rotorflight.of(hs.load(name)).rotor for name in ("jr700", "lynx", "blade360")]
    assert turns == ["cw", "ccw", "cw"]


@tabled("degrees", "charged", "faded", "lost", "most")
def test_errors_and_offsets_follow_collective(degrees, charged, faded, lost, most):
    roll = replace(ROLL, o=50.0, error_decay_time=250.0)
    loops = Loops(replace(LAW, roll=roll, collective=replace(COL, centre=math.radians(degrees))))
    at = [loops.at(kernel.ROLL, name) for name in ("error", "offset", "saturated")]
    share, to_it = degrees / 12.0, math.copysign(1.0, degrees)
    loops()  # collective is that of the loop before
    for error, offset in ((0.1, 0.2), (40.0, -80.0)):
        loops.state[at] = error, offset, 0.0
        loops()
        left = error - PERIOD * min(0.04 * 0.08 * faded * error, 0.96 * 12.0)
        kept = offset - PERIOD * np.clip(0.04 * lost * offset, -most, most)
        assert loops.state[at[:2]] == pytest.approx([left, kept], rel=1e-12)
    # of 10 deg/s: I 2e-4 of gain 100, up to 45 deg; O of gain 50, up to 90 deg
    for error, offset, saturated, i, o in (
        (0.0, 0.0, 0.0, 0.01, to_it * 0.01 * charged / 100.0),
        (45.0, to_it * 90.0, 0.0, 45.0, to_it * 90.0),
        (1.0, to_it * 2.0, 5.0, 1.0, to_it * 2.0),  # the mixer's limit holds both,
        (-1.0, to_it * -2.0, 5.0, -0.99, to_it * (-2.0 + 0.01 * charged / 100.0)),  # to one side
    ):
        loops.state[at] = error, offset, saturated
        terms = loops(roll=-10.0)[0]
        assert terms[[1, 5]] == pytest.approx([20.0 * i, 10.0 * o * share], rel=1e-9)


def test_it_starts_where_its_filters_have_long_had_the_motion():
    """Of a steady rate and stick nothing has a slope, and relax lets I have all of the error."""
    shaped = {"d": 40.0, "b": 30.0, "expo": 0.4, "relax_level": 40.0, "response_time": 20.0}
    cyclic, notches = replace(ROLL, **shaped), (laws.Notch(frequency=50.0),)
    law = replace(LAW, roll=cyclic, pitch=cyclic, yaw=replace(YAW, **shaped, gyro_cutoff=100.0))
    loops = Loops(replace(law, smoothing=20.0, gyro_lowpass=100.0, notches=notches))
    seen = STILL._replace(p=0.3, q=0.2, r=-0.1, LAT=0.2, LON=-0.1, PED=0.3)
    kernel.COMPILED.reset(seen, loops.state, loops.settings)
    for k in range(20):
        p, i, d, f, b, _ = loops(*np.degrees([0.3, -0.2, 0.1]), LAT=0.2, LON=-0.1, PED=0.3).T
        assert [*d, *b] == pytest.approx([0.0] * 6, abs=1e-9)
        wanted = np.array([240.0 * (0.6 * one + 0.4 * one**3) for one in (0.4, 0.2, -0.6)])
        assert f == pytest.approx(2.5e-2 * np.array([100.0, 100.0, 0.0]) * wanted, rel=1e-9)
        off = wanted - np.degrees([0.3, -0.2, 0.1])
        assert p == pytest.approx([*(0.333333 * off[:2]), 5.333333 * 0.8 * off[2]], rel=1e-5)
        # I of 20 counts a degree; turning with 0.1 rad/s mixes 2e-3 of roll and pitch
        assert i[:2] == pytest.approx(20.0 * PERIOD * (k + 1.0) * off[:2], rel=5e-3)


def test_relax_a_notch_and_precompensation():
    """A fast setpoint stops I; a notch has no gain at its frequency; (|col| Gc)^2 goes to yaw."""
    roll = replace(ROLL, relax_level=40.0)
    loops = Loops(replace(LAW, roll=roll, notches=(laws.Notch(frequency=50.0),)))
    loops(LAT=0.5)  # 240 deg/s more than its low-pass, above the level of 40
    assert loops.error(kernel.ROLL) == 0.0
    wave = [loops(roll=math.sin(2.0 * math.pi * 50.0 * PERIOD * k))[0, 0] for k in range(1000)]
    assert np.ptp(wave[-100:]) < 1e-6 * 2.0 * 0.333  # of P's counts for 1 deg/s
    high = replace(LAW, collective=replace(COL, centre=math.radians(6.0)), rotor="ccw")
    loops = Loops(high)
    for _ in range(2000):
        loops()
    assert loops.mixer[4] == pytest.approx(1e3 * (0.5 * 0.6) ** 2)  # 6 of 12 degrees, gain 60
