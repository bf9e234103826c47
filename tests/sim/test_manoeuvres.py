"""The shipped manoeuvres as signals: against published figures, SciPy, and what they must add."""

import math

import numpy as np
import pytest
from scipy.signal import chirp

from helisim.base.errors import InputError
from helisim.physics.layout import DOUBLET, PARAM, SWEEP
from helisim.sim import (
    Chirp,
    Doublet,
    History,
    Manoeuvre,
    Multisine,
    Pulse,
    Sequence,
    Step,
    Sweep,
    ThreeTwoOneOne,
    Together,
)
from helisim.sim.excitation import step_times
from helisim.sim.multisine import design, schroeder_phases

TIME = step_times(20.0, 0.002)


def test_a_step_stays_and_a_pulse_goes_back():
    """From the end of the trimmed stretch on; the edges come at the step that they name."""
    step = Step(axis="lat", amplitude=-0.05, trim_time=3.0, duration=20.0).wave(TIME)
    pulse = Pulse(axis="lat", amplitude=0.05, width=0.4, trim_time=3.0).wave(TIME)
    after = np.arange(TIME.size) >= 1500
    assert np.array_equal(step, np.where(after, -0.05, 0.0))
    assert np.array_equal(pulse, np.where(after & (np.arange(TIME.size) < 1700), 0.05, 0.0))


@pytest.mark.parametrize("kind", [Doublet, ThreeTwoOneOne])
@pytest.mark.parametrize(("at", "axis", "column"), [("servos", "tail", 7), ("sensors", "q", 1)])
def test_multisteps_are_the_same_elsewhere(kind, at, axis, column):
    """What a doublet or a 3-2-1-1 adds at a servo or a sensor is what it adds at a stick."""
    stick = kind(axis="lon", amplitude=0.05)
    other = kind(axis=axis, amplitude=0.05, at=at)
    added = other.added(TIME)
    assert list(added) == [at]
    assert np.array_equal(added[at][:, column], stick.added(TIME)["sticks"][:, 1])
    assert np.count_nonzero(added[at].any(axis=0)) == 1


@pytest.mark.parametrize("spacing", ["linear", "logarithmic"])
def test_a_chirp_is_scipys(spacing):
    """The phase, and so the frequency, of scipy.signal.chirp, a quarter of a turn later."""
    made = Chirp(
        axis="ped", amplitude=0.1, band=(0.5, 30.0), duration=20.0, trim_time=2.0, fade=0.0,
        spacing=spacing,
    )  # fmt: skip
    inside = (TIME >= 2.0) & (TIME <= 18.0)
    since, cycles = TIME[inside] - 2.0, np.array([0.5, 30.0]) / (2.0 * np.pi)
    expected = 0.1 * chirp(since, cycles[0], 16.0, cycles[1], method=spacing, phi=-90.0)
    # SciPy's phase of 76 rad is rounded: 1e-13
    assert made.wave(TIME)[inside] == pytest.approx(expected, abs=1e-12)
    assert not made.wave(TIME)[~inside].any()


def test_a_chirp_can_be_the_sweep_without_a_hand():
    """Spacing "exponential" is a steady Sweep's law: its phase is that of the compiled one."""
    from helisim.physics.pilot import sweep_phase

    made = Chirp(
        axis="lat", amplitude=0.1, band=(0.8, 45.0), duration=20.0, trim_time=2.0,
        spacing="exponential",
    )  # fmt: skip
    for time in (4.0, 9.3, 16.9):
        expected = 0.1 * np.sin(sweep_phase(time - 2.0, 16.0, 0.8, 45.0))
        assert made.wave(np.array([time]))[0] == pytest.approx(expected, abs=1e-12)


def test_a_chirp_fades_in_and_out():
    """By half a cosine over the fade; at its ends it is zero."""
    settings = {"axis": "lat", "amplitude": 0.1, "band": (5.0, 6.0), "duration": 20.0}
    faded = Chirp(**settings, fade=2.0).wave(TIME)
    plain = Chirp(**settings, fade=0.0).wave(TIME)
    half = np.isclose(TIME, 4.0)
    assert faded[half] == pytest.approx(0.5 * plain[half], abs=1e-12)
    whole = (TIME > 5.0) & (TIME < 15.0)
    assert np.array_equal(faded[whole], plain[whole])
    assert abs(faded[np.isclose(TIME, 17.0)]) < 1e-9


def test_schroeders_phases_are_published():
    """For a flat spectrum -pi k (k - 1) / N, and a crest factor of about 1.7.

    Schroeder, IEEE Transactions on Information Theory 16 (1970): phi_n = phi_1 - pi n^2 / N, up
    to a linear phase. Pintelon and Schoukens, System Identification: A Frequency Domain Approach
    (2nd ed., 2012), chapter 5: a crest factor of about 1.7.
    """
    count = 60
    k = np.arange(count)
    expected = -np.pi * k * (k - 1.0) / count
    difference = schroeder_phases(np.ones(count)) - expected
    assert np.diff(difference) == pytest.approx(np.diff(difference)[0], abs=1e-9)
    found = design(tuple(range(1, count + 1)), 0.0, "schroeder").crest_factor
    assert found == pytest.approx(1.7, abs=0.05)  # the book's digits


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_clipping_lowers_the_peak(slope):
    """Below Schroeder's by a sixth and more, of flat spectra and of pink ones."""
    numbers = tuple(range(1, 32))
    schroeder, clipped = (design(numbers, slope, one) for one in ("schroeder", "low_peak"))
    assert clipped.crest_factor < schroeder.crest_factor / 1.2
    assert clipped.relative_peak_factor < schroeder.relative_peak_factor


def multisine(**settings):
    return Multisine(
        **{
            "axis": "col+lon+lat+ped",
            "amplitude": (0.03, 0.07, 0.07, 0.01),
            "band": (0.6, 40.0),
            "period": 10.0,
            "duration": 26.0,
            **settings,
        }
    )


@pytest.mark.parametrize("slope", [0.0, 1.0])
@pytest.mark.parametrize("phases", ["schroeder", "low_peak"])
def test_axes_of_a_multisine_are_orthogonal(slope, phases):
    """By the DFT of one period: each harmonic is one axis's alone, with the power asked for."""
    made = multisine(slope=slope, phases=phases)
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
    """The peak is the amplitude; two periods are equal; trimmed before and after; no jump."""
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
    """What is left open: each axis has its own band and amplitude; harmonics keep to it."""
    made = Multisine().on(jr700.parameters)
    assert made.amplitude == tuple(jr700.parameters[f"sweep.{a}_amplitude"] for a in made.axes)
    for axis, frequencies in made.frequencies.items():
        low, high = (jr700.parameters[f"sweep.{axis}_{end}"] for end in ("w_min", "w_max"))
        assert low <= frequencies[0] < frequencies[-1] <= high
        assert frequencies[-1] > high - 4.0 * 2.0 * np.pi / made.period


def test_a_sequence_is_its_parts_one_after_the_other():
    """Each as it is alone, from its own beginning; pauses between; nested too."""
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


def test_together_is_the_sum():
    """Parts on one input and on another, at one place and at another."""
    parts = (
        Step(axis="lat", amplitude=0.05, duration=8.0),
        Pulse(axis="lat", amplitude=0.02, duration=6.0),
        Doublet(axis="front", at="actuators", amplitude=0.1),
    )
    made = Together(parts=parts)
    assert (made.duration, made.axis, made.places) == (8.0, "lat+front", ("sticks", "actuators"))
    time = step_times(8.0, 0.002)
    lat = parts[0].wave(time) + parts[1].wave(time)
    assert np.array_equal(made.added(time)["sticks"][:, 2], lat)
    assert made.added(time)["actuators"][:, 4].any()


def test_a_history_is_resampled_as_it_is_told():
    """Linear between samples, held until the next, or a cubic spline through a cubic."""
    time = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    values = 1e-3 * (time**3 - 3.0 * time**2)
    wanted = np.array([0.0, 0.5, 1.0, 3.0, 3.999999])
    found = {
        method: History.of(time, values, axis="lat", method=method).sticks(wanted)[:, 2]
        for method in ("linear", "hold", "cubic")
    }
    assert found["linear"][:4] == pytest.approx(1e-3 * np.array([0.0, -1.0, -2.0, 6.0]), abs=1e-15)
    assert found["hold"].tolist() == values[[0, 0, 1, 2, 2]].tolist()
    assert found["cubic"] == pytest.approx(1e-3 * (wanted**3 - 3.0 * wanted**2), abs=1e-12)


def test_a_history_keeps_its_samples():
    """To the last bit, in text; its digest is of them, and a change is noticed."""
    rng = np.random.default_rng(1)
    time, values = np.arange(100) / 50.0, 0.05 * rng.standard_normal((100, 2))
    made = History.of(time, values, axis="lat+ped")
    assert np.array_equal(made.table[0], time)
    assert np.array_equal(made.table[1], values)
    other = History.of(time, values + 1e-6, axis="lat+ped")
    assert other.digest != made.digest
    with pytest.raises(InputError, match="not those of its digest"):
        History(axis="lat+ped", samples=other.samples, digest=made.digest)
    with pytest.raises(InputError, match="no packed numbers"):
        History(axis="lat", samples="what?")
    with pytest.raises(InputError, match="no rows of time and 3 numbers"):
        History(axis="lat+ped+col", samples=made.samples[: len(made.samples) // 8 * 4])


def test_a_function_is_sampled_at_the_gyros_ticks(jr700):
    """A plain function of a float, with if and math; held until the next tick."""
    made = Manoeuvre(lambda t: 0.05 if 2.0 <= t < 3.0 else 0.0, axis="lat", duration=5.0)
    history = made.on(jr700.parameters)
    time = step_times(5.0, 0.001)
    expected = np.where((time > 2.0 - 1e-9) & (time < 3.0 - 1e-9), 0.05, 0.0)
    assert np.array_equal(history.sticks(time)[:, 2], expected)
    assert "lambda" in history.source


NAN = float("nan")


def test_settings_of_numpy_become_plain():
    """Loops over arrays give such numbers; records and plans hold Python's."""
    plain = Chirp(axis="lat", amplitude=0.25, band=(1.0, 20.0), duration=60)
    given = Chirp(
        axis="lat", amplitude=np.float32(0.25), band=np.array([1.0, 20.0]), duration=np.int64(60)
    )
    assert given == plain
    assert repr(given) == repr(plain)
    made = multisine(axis="lat+ped", amplitude=np.array([0.1, 0.2]), band=[1.0, 10.0])
    assert made == multisine(axis="lat+ped", amplitude=(0.1, 0.2), band=(1.0, 10.0))
    assert Manoeuvre(abs, axis="lat", duration=np.float32(2.0)).duration == 2.0


def test_a_multisine_is_flat_below_its_corner():
    """Lines of one period: equal below, falling by half the slope in amplitude above."""
    made = Multisine(
        axis="lat", amplitude=0.1, band=(1.0, 80.0), period=20.0, duration=20.0, trim_time=0.0,
        slope=4.0, corner=10.0,
    )  # fmt: skip
    time = np.arange(8000) / 400.0
    lines = np.abs(np.fft.rfft(made.sticks(time)[:, 2]))
    frequency = 2.0 * np.pi * np.fft.rfftfreq(time.size, 1.0 / 400.0)
    wanted = 1.0 / (1.0 + (frequency / 10.0) ** 2)
    inside = lines > 1e-6 * lines.max()
    ratio = lines[inside] / wanted[inside]
    # the lines are exact: what is left is the rounding of the phases, 1e-6 rad
    assert ratio == pytest.approx(ratio[0], rel=1e-5)


# Sweeps and doublets as they are asked for: what is accepted, and what is refused


EXCITATION_NAN = math.nan


def test_sweep_is_written_as_asked(par):
    """The force laws get the axis's amplitude, and the leakage on the three others."""
    Sweep(axis="lon", duration=60.0, amplitude=0.1, band=(1.0, 20.0), leakage=0.05).write(par)
    assert par[PARAM.excitation] == SWEEP
    sticks = par[PARAM.excitation_col : PARAM.excitation_ped + 1]
    assert sticks == pytest.approx([0.005, 0.1, 0.005, 0.005], rel=1e-12)
    assert par[PARAM.excitation_start] == 3.0
    assert par[PARAM.excitation_duration] == 54.0
    assert (par[PARAM.sweep_w_min], par[PARAM.sweep_w_max]) == (1.0, 20.0)


def test_doublet_is_written_as_asked(par):
    """A doublet moves one stick only, for its width."""
    Doublet(axis="ped", amplitude=0.2, width=0.8).write(par)
    assert par[PARAM.excitation] == DOUBLET
    assert np.flatnonzero(par[PARAM.excitation_col : PARAM.excitation_ped + 1]).tolist() == [3]
    assert par[PARAM.excitation_duration] == 0.8


@pytest.mark.parametrize("kind", [Sweep, Doublet])
def test_what_is_left_open_is_the_vehicles(jr700, kind):
    """Amplitude and band that nobody gave are the vehicle's own; what is given stays."""
    complete = kind(axis="lat").on(jr700.parameters)
    assert complete.amplitude == jr700.parameters["sweep.lat_amplitude"]
    assert kind(axis="lat", amplitude=0.02).on(jr700.parameters).amplitude == 0.02
    if kind is Sweep:
        own = (jr700.parameters["sweep.lat_w_min"], jr700.parameters["sweep.lat_w_max"])
        assert complete.band == own
        assert Sweep(axis="lat", band=(1.0, 2.0)).on(jr700.parameters).band == (1.0, 2.0)


@pytest.mark.parametrize("kind", [Sweep, Doublet])
def test_what_is_left_open_never_reaches_the_sticks(par, kind):
    """Without a vehicle, an open amplitude is refused, not guessed."""
    with pytest.raises(InputError, match=r"on\(vehicle.parameters\)"):
        kind(axis="lat").write(par)
