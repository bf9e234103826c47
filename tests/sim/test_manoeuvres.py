"""The shipped manoeuvres as signals: against published figures, SciPy, and what they must add."""

import numpy as np
import pytest
from scipy.signal import chirp

from helisim import Multisine, Pulse, Sequence, Step, Sweep, ThreeTwoOneOne, Together
from helisim.physics.layout import PARAM, SWEEP
from helisim.sim import Chirp, Doublet, History
from helisim.sim.excitation import step_times

TIME = step_times(20.0, 0.002)


def test_a_step_stays_a_pulse_goes_back_and_together_is_the_sum():
    """From the end of the trimmed stretch on; the edges come at the step that they name."""
    step = Step(axis="lat", amplitude=-0.05, trim_time=3.0, duration=20.0).wave(TIME)
    pulse = Pulse(axis="lat", amplitude=0.05, width=0.4, trim_time=3.0).wave(TIME)
    after = np.arange(TIME.size) >= 1500
    assert np.array_equal(step, np.where(after, -0.05, 0.0))
    assert np.array_equal(pulse, np.where(after & (np.arange(TIME.size) < 1700), 0.05, 0.0))
    parts = (
        Step(axis="lat", amplitude=0.05, duration=8.0),
        Pulse(axis="lat", amplitude=0.02, duration=6.0),
        Doublet(axis="col", at="actuators", amplitude=0.1),
    )
    made = Together(parts=parts)
    assert (made.duration, made.axis, made.places) == (8.0, "lat+col", ("sticks", "actuators"))
    time = step_times(8.0, 0.002)
    lat = parts[0].wave(time) + parts[1].wave(time)
    assert np.array_equal(made.added(time)["sticks"][:, 2], lat)
    assert made.added(time)["actuators"][:, 0].any()


@pytest.mark.parametrize("kind", [Doublet, ThreeTwoOneOne])
@pytest.mark.parametrize(("at", "axis", "column"), [("servos", "ped", 3), ("sensors", "q", 1)])
def test_multisteps_are_the_same_elsewhere(kind, at, axis, column):
    """What a doublet or a 3-2-1-1 adds at a servo or a sensor is what it adds at a stick."""
    stick = kind(axis="lon", amplitude=0.05)
    other = kind(axis=axis, amplitude=0.05, at=at)
    added = other.added(TIME)
    assert list(added) == [at]
    assert np.array_equal(added[at][:, column], stick.added(TIME)["sticks"][:, 1])
    assert np.count_nonzero(added[at].any(axis=0)) == 1


def test_a_chirp_is_scipys_and_fades_in_and_out():
    """The phase of scipy.signal.chirp, a quarter of a turn later; half a cosine over the fade."""
    settings = {"amplitude": 0.1, "band": (0.5, 30.0), "trim_time": 2.0, "fade": 0.0}
    made = Chirp(axis="ped", duration=20.0, **settings)
    inside = (TIME >= 2.0) & (TIME <= 18.0)
    since, cycles = TIME[inside] - 2.0, np.array([0.5, 30.0]) / (2.0 * np.pi)
    expected = 0.1 * chirp(since, cycles[0], 16.0, cycles[1], method="logarithmic", phi=-90.0)
    # SciPy's phase of 76 rad is rounded: 1e-13
    assert made.wave(TIME)[inside] == pytest.approx(expected, abs=1e-12)
    assert not made.wave(TIME)[~inside].any()
    settings = {"axis": "lat", "amplitude": 0.1, "band": (5.0, 6.0), "duration": 20.0}
    faded = Chirp(**settings, fade=2.0).wave(TIME)
    plain = Chirp(**settings, fade=0.0).wave(TIME)
    half = np.isclose(TIME, 4.0)
    assert faded[half] == pytest.approx(0.5 * plain[half], abs=1e-12)
    whole = (TIME > 5.0) & (TIME < 15.0)
    assert np.array_equal(faded[whole], plain[whole])
    assert abs(faded[np.isclose(TIME, 17.0)]) < 1e-9


def multisine(**settings):
    usual = {"axis": "col+lon+lat+ped", "amplitude": (0.03, 0.07, 0.07, 0.01), "period": 10.0}
    return Multisine(**usual, band=(0.6, 40.0), duration=26.0, **settings)


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_axes_of_a_multisine_are_orthogonal(slope):
    """By the DFT of one period: each harmonic is one axis's alone, with the power asked for."""
    made = multisine(slope=slope)
    time = 3.0 + 0.002 * np.arange(5000)
    columns = made.added(time)["sticks"]
    lines = np.abs(np.fft.rfft(columns, axis=0)) / 2500.0
    found = {axis: np.flatnonzero(one > 1e-9) for axis, one in zip(made.axes, lines.T)}
    for axis, numbers in made.harmonics.items():
        assert np.array_equal(found[axis], numbers)
    every = np.concatenate(list(found.values()))
    assert np.unique(every).size == every.size
    assert np.array_equal(np.sort(every), np.arange(1, 64))  # 0.6 to 40 rad/s of 0.628 rad/s
    inner = columns.T @ columns / 5000.0
    power = np.diag(inner)
    # sums of 5000 products of order 1e-3 that cancel
    assert inner - np.diag(power) == pytest.approx(np.zeros((4, 4)), abs=1e-15)
    for axis, one in zip(made.axes, lines.T):
        k = made.harmonics[axis]
        shape = one[k] / one[k[0]]
        assert shape == pytest.approx((k / k[0]) ** (-0.5 * slope), rel=1e-9)


def test_a_multisine_has_its_peak_and_its_whole_periods():
    made = multisine()
    columns = made.added(step_times(26.0, 0.002))["sticks"]
    peaks = np.abs(columns).max(axis=0)
    # sampled at 500 Hz, a peak between two samples is missed by (40 rad/s 1 ms)^2 / 2 at most
    assert peaks == pytest.approx([0.03, 0.07, 0.07, 0.01], rel=1e-3)
    assert columns[1500:6500] == pytest.approx(columns[6500:11500], abs=1e-9)
    assert not columns[:1500].any()
    assert not columns[11500:].any()
    assert np.abs(columns[1500]).max() < 1e-6
    steepest = np.abs(np.diff(columns[1500:11499], axis=0)).max(axis=0)
    assert (np.abs(columns[11499]) <= 1.01 * steepest).all()
    said = made.relative_peak_factor
    for axis, one in zip(made.axes, columns[1500:6500].T):
        factor = np.ptp(one) / (2.0 * np.sqrt(2.0) * np.std(one))
        assert said[axis] == pytest.approx(factor, rel=2e-3)


def test_bands_and_amplitudes_are_the_vehicles_own(jr700):
    made = Multisine().on(jr700.parameters)
    assert made.amplitude == tuple(jr700.parameters[f"sweep.{a}_amplitude"] for a in made.axes)
    for axis, numbers in made.harmonics.items():
        frequencies = 2.0 * np.pi / made.period * numbers
        low, high = (jr700.parameters[f"sweep.{axis}_{end}"] for end in ("w_min", "w_max"))
        assert low <= frequencies[0] < frequencies[-1] <= high
        assert frequencies[-1] > high - 4.0 * 2.0 * np.pi / made.period


def test_a_sequence_is_its_parts_one_after_the_other():
    first = Step(axis="lat", amplitude=0.05, trim_time=1.0, duration=3.0)
    second = Chirp(axis="r", at="sensors", amplitude=0.2, band=(1.0, 20.0), duration=6.0,
                   trim_time=1.0)  # fmt: skip
    made = Sequence(parts=(first, Sequence(parts=(second, first))), pause=0.7)
    assert (made.duration, made.axis) == (12.7, "lat+r")
    time = step_times(made.duration, 0.002)
    added = made.added(time)
    starts = {0.0: first, 3.7: second, 9.7: first}
    for start, part in starts.items():
        place = part.at
        inside = slice(round(start / 0.002), round((start + part.duration) / 0.002))
        alone = part.added(step_times(part.duration, 0.002)[:-1])[place]
        assert added[place][inside] == pytest.approx(alone, abs=1e-9)
    assert not added["sticks"][1500:4850].any()


def test_a_history_is_resampled_as_it_is_told():
    time = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    values = 1e-3 * (time**3 - 3.0 * time**2)
    wanted = np.array([0.0, 0.5, 1.0, 3.0, 3.999999])
    found = {
        method: History.of(time, values, axis="lat", method=method).sticks(wanted)[:, 2]
        for method in ("linear", "hold")
    }
    assert found["linear"][:4] == pytest.approx(1e-3 * np.array([0.0, -1.0, -2.0, 6.0]), abs=1e-15)
    assert found["hold"].tolist() == values[[0, 0, 1, 2, 2]].tolist()


def test_sweep_is_written_as_asked(par):
    Sweep(axis="lon", duration=60.0, amplitude=0.1, band=(1.0, 20.0), leakage=0.05).write(par)
    assert par[PARAM.excitation] == SWEEP
    sticks = par[PARAM.excitation_col : PARAM.excitation_ped + 1]
    assert sticks == pytest.approx([0.005, 0.1, 0.005, 0.005], rel=1e-12)
    assert par[PARAM.excitation_start] == 3.0
    assert par[PARAM.excitation_duration] == 54.0
    assert (par[PARAM.sweep_w_min], par[PARAM.sweep_w_max]) == (1.0, 20.0)


@pytest.mark.parametrize(
    ("period", "trim", "periods"), [(4.0, 5.0, 4), (8.0, 5.0, 2), (10.0, 2.0, 2), (11.0, 2.0, 2)]
)
def test_a_multisine_has_the_whole_periods_that_fit_between_its_trims(period, trim, periods):
    usual = {"axis": "lat", "amplitude": 0.03, "band": (0.1, 20.0), "duration": 26.0}
    wave = Multisine(**usual, period=period, trim_time=trim)
    assert wave.periods == periods
    time = np.arange(2600) / 100.0
    moved = np.flatnonzero(np.any(wave.sticks(time) != 0.0, axis=1)) / 100.0
    assert moved[[0, -1]] == pytest.approx([trim, trim + periods * period], abs=0.03)
    assert min(wave.harmonics["lat"]) == 1  # a mean is no oscillation
