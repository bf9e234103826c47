"""Figures against published ones: responses that are printed, with the figures printed of them.

A tolerance is half of the last printed digit, and what straight lines between the points of the
grid add where that is more.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq

from helisim.base.linear import LinearSystem
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import (
    bandwidth,
    changed,
    coupling,
    least_damped,
    margins,
    quickness,
    rejection,
)
from helisim.handling.loop import GRID, Curve
from helisim.handling.measured.interval import figures_of
from tabled import rows, tabled

FINE = np.geomspace(0.05, 300.0, 2000)


def curve(response, frequency=FINE):
    return Curve(frequency, response(1j * frequency))


Z = np.exp(0.1j * np.geomspace(0.5, 31.0, 2000))
TEXTBOOK = curve(lambda s: 20.0 * (s + 1.0) / (s * (s + 5.0) * (s**2 + 2.0 * s + 10.0)))
SAMPLED = Curve(np.geomspace(0.5, 31.0, 2000), (0.04798 * Z + 0.0464) / (Z**2 - 1.81 * Z + 0.9048))


@tabled("loop", "size", "within", "where", "angle", "digits", "crossover")
def test_margins_are_the_printed_ones(loop, size, within, where, angle, digits, crossover):
    found = margins(loop)
    ((turn, gain),), ((one, phase),) = found.gain, found.phase
    assert gain == pytest.approx(size, abs=within)
    assert turn == pytest.approx(where, abs=1e-4)
    assert np.degrees(phase) == pytest.approx(angle, abs=digits)
    assert found.crossover == one == pytest.approx(crossover, abs=1e-4)


def test_margins_to_both_sides_of_a_conditionally_stable_vehicle():
    """Ye, Quadrotor-Attitude-Control (github.com/Ye-Dehuo), README, yaw of a Quanser quadrotor.

    2185 (s^2 + 2.687 s + 2.985) / (s^5 + 34.8 s^4 + 452 s^3): gain margins 0.29 and 5.75, phase
    margin 36.22 deg, stable. Its root locus leaves stability at gains of 640 and 12564, that is
    at 0.2929 and 5.750; three digits of its polynomial are worth 2 % of the lower.
    """

    def loop(s):
        return 2185.0 * (s**2 + 2.687 * s + 2.985) / (s**5 + 34.8 * s**4 + 452.0 * s**3)

    found = margins(curve(loop))
    lower, upper = (10.0 ** (gain / 20.0) for _, gain in found.gain)
    assert lower == pytest.approx(0.29, abs=0.005)
    assert lower == pytest.approx(640.0 / 2185.0, rel=0.02)
    assert upper == pytest.approx(5.75, abs=0.006)
    assert np.degrees(found.least_phase) == pytest.approx(36.22, abs=0.005)
    assert found.least_gain == pytest.approx(-20.0 * np.log10(lower))  # the nearer of both
    twice = SimpleNamespace(broken=lambda *_: curve(lambda s: 2.0 * loop(s)))
    told = figures_of(twice, "broken", "ped")["gain_margin"]  # with twice the gain the upper
    assert told == pytest.approx(20.0 * np.log10(0.5 * upper))
    assert found.stable


def test_modes_of_a_helicopter():
    """The OH-58D in hover, of Ham, Gardner and Tischler, table 5.

    "Flight Testing and Frequency Domain Analysis for Rotorcraft Handling Qualities
    Characteristics", US Army Aviation Technical Test Center and Aeroflightdynamics Directorate.
    Roll with flapping -2.916 +- 6.550j: 7.17 rad/s, 0.407; pitch with flapping -2.554 +- 3.877j:
    4.64 rad/s, 0.550; yaw and sway -0.578 +- 0.349j: 0.675 rad/s, 0.856.
    """
    printed = {
        -2.916 + 6.550j: (7.17, 0.407),
        -2.554 + 3.877j: (4.64, 0.550),
        -0.578 + 0.349j: (0.675, 0.856),
    }
    others = np.array([0.242, -0.269, 0.433, -0.398], dtype=complex)
    for pole, (frequency, damping) in printed.items():
        band = {"low": 0.7 * frequency, "high": 1.3 * frequency}
        pair = np.array([pole, pole.conjugate()])
        found = least_damped(np.concatenate([pair, 0.1 * others]), **band)
        assert found.frequency == pytest.approx(frequency, abs=0.006)
        assert found.damping == pytest.approx(damping, abs=6e-4)
    every = np.concatenate([[one, np.conj(one)] for one in printed] + [others])
    assert least_damped(every, low=1.0).frequency == pytest.approx(7.17, abs=0.006)
    assert least_damped(np.zeros(2, dtype=complex)) == (1.0, 0.0)
    # outside of the band it counts less, an octave away not at all
    for share in (0.0, 0.5, 1.0, 2.0):
        pair, away = np.array([-1.0 + 3.0j, -1.0 - 3.0j]), 10.0**0.5 * 2.0**share
        zeta = 0.1**0.5 + min(share, 1.0) * (1.0 - 0.1**0.5)
        assert least_damped(pair, low=away).damping == pytest.approx(zeta)
        assert least_damped(pair, high=10.0 / away).damping == pytest.approx(zeta)


_TRANSPORT = LinearSystem(
    rows(globals(), "_TRANSPORT"),
    [[0.0]] * 5 + [[10.0]],
    57.296 * np.eye(6)[2:4],
    np.zeros((2, 1)),
    None,
    ("lon",),
    ("theta", "q"),
)
"""The transport aircraft of Stevens and Lewis, example 4.6-1, with its elevator's lag."""
_PITCH_HOLD = LinearSystem(
    np.zeros((0, 0)),
    np.zeros((0, 3)),
    np.zeros((1, 0)),
    [[-4.0, -2.5, 4.0]],
    None,
    ("theta", "q", "LON"),
    ("lon",),
)
"""u = 4 (theta_c - theta) - 2.5 q."""


def test_a_closed_loop_is_the_one_that_is_printed():
    """Stevens and Lewis, Aircraft Control and Simulation, 2nd edition, example 4.6-1.

    The plant is printed, and in equation (3) theta over its command:
    45.33 (s + 0.5567)(s + 0.01897)(s + 1.666e-4) / ((s + 1.999 +- 2.389j)(s + 6.646)(s + 0.3815)
    (s + 0.02522)(s + 1.718e-4)). Four digits of each are worth 0.2 % and 0.1 deg.
    """
    omega = np.geomspace(0.01, 50.0, 200)
    loop = ClosedLoop(_TRANSPORT, _PITCH_HOLD, omega)
    s = 1j * omega
    printed = 45.33 * (s + 0.5567) * (s + 0.01897) * (s + 1.666e-4)
    printed /= ((s + 1.999) ** 2 + 2.389**2) * (s + 6.646) * (s + 0.3815)
    printed /= (s + 0.02522) * (s + 1.718e-4)
    np.testing.assert_allclose(loop.command("lon").response / printed, 1.0, atol=2e-3)
    # and what is not printed but follows: S at the sensors is 1 - L / (1 + L)
    broken = loop.broken("lon", "sensors").response
    np.testing.assert_allclose(loop.disturbance("lon").response * (1.0 + broken), 1.0, atol=1e-9)
    np.testing.assert_allclose(loop.broken("lon").response, broken, rtol=1e-9)  # one loop, one L


def test_a_quickness():
    """Ye, as above: a change of heading of 30 deg by 35.2 deg/s to a peak of 30.31 deg: 1.16."""
    angle = np.radians([0.0, 12.0, 28.0, 30.31, 30.0, 30.1])
    rate = np.radians([0.0, 35.2, 20.0, 0.0, -1.0, 0.5])
    for sign in (1.0, -1.0):
        found = quickness(sign * angle + 0.3, sign * rate)
        assert found.ratio == pytest.approx(1.16, abs=0.005)
        assert np.degrees(found.least) == pytest.approx(30.0, abs=1e-9)


def test_a_change_by_rate_command_is_a_pulse_as_wide_as_it_needs():
    """A lagged rate, r = R (1 - exp(-t / T)): a pulse w turns R w, its peak rate at its end."""
    time = np.linspace(0.0, 6.0, 6001)
    full, lag, change = 2.0, 0.2, 0.5
    rate = full * (1.0 - np.exp(-time / lag))
    angle = full * time - lag * rate
    found = changed(time, angle, rate, change=change)
    peak_rate = full * (1.0 - np.exp(-change / full / lag))
    assert found.peak == pytest.approx(change, rel=1e-3)
    assert found.ratio == pytest.approx(peak_rate / change, rel=5e-3)  # steps of 1 ms
    slow = changed(time, 0.1 * angle, 0.1 * rate, change=0.1 * change)
    assert slow.ratio == pytest.approx(found.ratio, rel=1e-6)
    assert changed(time, 0.0 * angle, 0.0 * rate, change=change) == (0.0, 0.0, 0.0)
    small = changed(time, 0.01 * angle, 0.01 * rate, change=change)  # all of it is not enough
    assert small.peak == pytest.approx(0.01 * angle[-1], rel=1e-6)


@pytest.mark.parametrize("drift", [0.0995, 0.1005])
def test_an_attitude_runs_on_from_a_tenth_of_its_peak_rate(drift):
    """It rises by 1 rad in a second, and then drifts: answered by a step, or by a pulse."""
    time = np.linspace(0.0, 4.0, 101)
    angle = np.minimum(time, 1.0) + drift * np.maximum(time - 1.0, 0.0)
    rate = np.where(time < 0.99, 1.0, drift)
    found = changed(time, angle, rate, change=0.5)
    steps = 1.0 / (1.0 + 3.0 * drift)
    assert found.ratio == pytest.approx(steps if drift < 0.1 else 1.0 / 0.5, rel=1e-5)


@pytest.mark.parametrize(("omega", "zeta", "delay"), [(4.0, 0.7, 0.05), (8.0, 1.0, 0.1)])
@pytest.mark.parametrize("integral", [False, True])
def test_bandwidth_is_where_the_phase_is_in_closed_form(omega, zeta, delay, integral):
    """Second order with a delay, as attitude and as rate command, by root finding on its phase."""

    def response(s):
        answer = omega**2 / (s**2 + 2.0 * zeta * omega * s + omega**2) * np.exp(-s * delay)
        return answer / s if integral else answer

    def phase(w):
        lag = np.arctan2(2.0 * zeta * omega * w, omega**2 - w**2)
        return -lag - w * delay - (0.5 * np.pi if integral else 0.0)

    neutral = brentq(lambda w: phase(w) + np.pi, 0.1, 200.0)
    lag = brentq(lambda w: phase(w) + 0.75 * np.pi, 0.1, 200.0)
    size = abs(response(1j * neutral))
    double = brentq(lambda w: abs(response(1j * w)) - 2.0 * size, 0.05, neutral)
    found = bandwidth(curve(response, GRID))
    assert found.complete
    # straight lines over log frequency between points 1.7 % apart
    assert found.neutral == pytest.approx(neutral, rel=1e-4)
    assert found.phase == pytest.approx(lag, rel=1e-4)
    assert found.gain == pytest.approx(double, rel=1e-3)
    assert found.delay == pytest.approx(-(phase(2.0 * neutral) + np.pi) / (2.0 * neutral), rel=1e-3)
    assert found.rate == min(found.phase, found.gain)


@tabled("low", "high", "complete")
def test_bandwidth_is_continued_by_a_radian_and_20_db(low, high, complete):
    """A phase that falls by 1 rad, a gain by 20 dB a decade, are the same beyond any band.

    -180 deg at 10 rad/s, -135 deg at exp(-pi / 4) of it, twice the gain there, or at the band's
    end, at half. Of -180 deg to its double, or of the band's last third, the lag is a logarithm.
    """
    own = np.geomspace(low, high, 400)
    found = bandwidth(Curve(own, np.exp(-1j * (np.pi + np.log(own / 10.0))) / own))
    assert (found.neutral, found.gain) == pytest.approx((10.0, 0.5 * min(high, 10.0)), rel=1e-6)
    assert found.phase == pytest.approx(10.0 * np.exp(-0.25 * np.pi), rel=1e-6)
    ends = min(10.0, min(high, 20.0) / 1.5), min(high, 20.0)
    lag = 0.5 * np.log(ends[1] / ends[0]) / (ends[1] - ends[0])
    assert found.delay == pytest.approx(lag, rel=1e-6)
    assert found.complete == complete


@pytest.mark.parametrize("zeta", [0.3, 0.7])
def test_rejection_of_a_second_order_loop_is_its_closed_form(zeta):
    """S = s (s + 2 z w) / (s^2 + 2 z w s + w^2): DRB and DRP by the roots of its magnitude."""
    omega = 5.0

    def power(x):  # |S|^2 over (frequency / omega)^2
        return x * (x + 4.0 * zeta**2) / ((1.0 - x) ** 2 + 4.0 * zeta**2 * x)

    found = rejection(
        curve(lambda s: s * (s + 2 * zeta * omega) / (s**2 + 2 * zeta * omega * s + omega**2), GRID)
    )
    half = brentq(lambda x: power(x) - 0.5, 1e-6, 1.0)
    dense = np.geomspace(0.1, 100.0, 2_000_001)
    assert found.bandwidth == pytest.approx(omega * np.sqrt(half), rel=1e-4)
    assert found.peak == pytest.approx(10.0 * np.log10(power(dense).max()), abs=1e-4)


def test_rejection_ends_at_the_lowest_rise():
    """|S| that dips again beyond its first rise through -3 dB."""

    def sensitivity(s):
        return s / (s + 2.0) * (s**2 + 4.0 * s + 400.0) / (s + 20.0) ** 2

    found = rejection(curve(sensitivity))
    lowest = brentq(lambda w: abs(sensitivity(1j * w)) ** 2 - 0.5, 0.1, 4.0)
    highest = brentq(lambda w: abs(sensitivity(1j * w)) ** 2 - 0.5, 20.0, 200.0)
    assert found.bandwidth == pytest.approx(lowest, rel=1e-4)
    assert highest > 10.0 * lowest
    assert found.seen


def test_coupling_is_what_happens_within_its_time():
    """On-axis 2 t, off-axis 0.3 t until 4 s and more later: 1.2 over 8."""
    time = np.linspace(0.0, 10.0, 1001)
    other = -0.3 * time - np.maximum(time - 4.0, 0.0)
    assert coupling(time, 1.0 + 2.0 * time, 0.5 + other, after=4.0) == pytest.approx(0.15)
    assert 1e9 < coupling(time, 0.0 * time, other, after=4.0) < np.inf  # of no answer at all
