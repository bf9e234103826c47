"""What was flown on a control, told from its time history."""

import numpy as np
import pytest
from scipy.signal import lfilter

from helisim.look.channels import named
from helisim.look.excitation import excitation

T = np.arange(6000) / 100.0


def noise(level, seed=0):
    return level * np.random.default_rng(seed).standard_normal(T.size)


def found(values, level=0.02):
    return excitation("lat", T, values + noise(level))


def chirp(low, high, start=10.0, stop=50.0):
    share = np.clip((T - start) / (stop - start), 0.0, 1.0)
    ratio = high / low
    phase = low * (stop - start) / np.log(ratio) * (ratio**share - 1.0)
    return np.where((start <= T) & (stop >= T), np.sin(phase), 0.0)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_sweep_is_told_with_its_range_and_times(backwards):
    wave = chirp(1.0, 30.0)
    one = found(wave[::-1] if backwards else wave)
    assert one.kind == "sweep"
    assert one.start == pytest.approx(10.0, abs=1.5)
    assert one.stop == pytest.approx(50.0, abs=1.5)
    # a first wave that half is seen; an end that is an average of the last tenth of waves
    assert 0.7 < one.low < 1.5
    assert 0.85 * 30.0 < one.high < 1.1 * 30.0


def test_half_waves_are_told():
    shapes = {"pulse": [3.0], "doublet": [1.0, 1.0], "3-2-1-1": [3.0, 2.0, 1.0, 1.0]}
    for kind, lengths in shapes.items():
        values, at, side = np.zeros(T.size), 10.0, 0.5
        for length in lengths:
            values[(at <= T) & (at + length > T)] = side
            at, side = at + length, -side
        one = found(values)
        assert one.kind == kind
        assert (one.start, one.stop) == pytest.approx((10.0, at), abs=0.05)
        assert one.amplitude == pytest.approx(0.5, rel=0.1)


def test_noise_is_no_excitation():
    """Of any bandwidth, a hundred times: a pilot's or a controller's motion; a rest is nothing."""
    kinds = set()
    for seed in range(100):
        pole = 0.99 * np.random.default_rng(seed).random()
        kinds.add(excitation("lat", T, lfilter([1.0], [1.0, -pole], noise(1.0, seed))).kind)
    assert kinds == {"motion"}
    assert excitation("lat", T, np.full(T.size, 0.3)) is None
    assert excitation("lat", T[:20], noise(1.0)[:20]) is None


@pytest.mark.parametrize(
    ("heading", "channel", "unit", "sign"),
    [
        ("p", "p", None, 1),
        ("q [deg/s]", "q", "deg/s", 1),
        ("LAT", "LAT", None, 1),
        ("aileron_stick_pct", "LAT", "percent", 1),
        ("swash_roll_pct", "lat", "percent", 1),
        ("gyro_x_dps", "p", "deg/s", 1),
        ("rollRate", "p", None, 1),
        ("imu.angular_velocity.y", "q", None, 1),
        ("acc_z [g]", "az", "g", 1),
        ("climb_m_s", "w", "m/s", -1),
        ("altitude_ft", "down", "ft", -1),
        ("pitch_cmd", "lon", None, 1),
        ("yaw", "psi", None, 1),
    ],
)
def test_names_are_understood(heading, channel, unit, sign):
    meant = named(heading, "CSV")
    assert (meant.channel, meant.unit, meant.sign) == (channel, unit, sign)


def test_what_means_nothing_is_left_alone():
    for heading in ("roll_setpoint", "battery", "time_ms", "des_pitch", "gps"):
        assert named(heading, "CSV") is None
