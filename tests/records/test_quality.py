"""Spikes and frozen runs: found where they are, and nowhere else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.records.quality import Run, frozen_runs, spikes

COUNT = 2000
TIME = np.arange(COUNT) / 100.0
SWEEP = np.sin(2.0 * TIME**2) * (0.2 + 0.02 * TIME)
"""Up to 80 rad/s at 100 Hz: eight samples a period."""


def noise(seed, level=0.01):
    return level * np.random.default_rng(seed).standard_normal(COUNT)


@given(
    at=st.integers(1, COUNT - 3),
    width=st.integers(1, 2),
    size=st.floats(1.0, 1e6),
    up=st.booleans(),
    seed=st.integers(0, 99),
)
def test_a_spike_is_found_where_it_is(at, width, size, up, seed):
    """One or two samples wide, up or down, anywhere but at the very ends; and nothing else."""
    values = SWEEP + noise(seed)
    # 8 usual steps: at the sweep's fastest, 0.6 x 80 rad/s x 10 ms x 0.64 each
    values[at : at + width] += (3.0 if up else -3.0) * size
    found = np.flatnonzero(spikes(values))
    assert found.tolist() == list(range(at, at + width))


SIGNALS = {
    "sweep": SWEEP,
    "noisy sweep": SWEEP + noise(0),
    "noise": noise(1),
    "resolution": np.round(noise(2) / 0.005) * 0.005,
    "every sample twice": np.repeat(noise(3)[: COUNT // 2], 2),
    "step": np.where(TIME < 7.0, 0.0, 1.0) + noise(4, 1e-4),
    "pulse of five samples": np.where((TIME > 5.0) & (TIME < 5.05), 1.0, 0.0) + noise(5, 1e-4),
    "jump and decay": np.where(TIME < 5.0, 0.0, np.exp(-(TIME - 5.0) / 0.02)),
    "zero": np.zeros(COUNT),
    "constant": np.full(COUNT, 3.0),
    "nothing": np.zeros(0),
    "too short to tell": np.array([0.0, 9.0, 0.0]),
}


@pytest.mark.parametrize("signal", SIGNALS)
def test_a_signal_is_no_spike(signal):
    """Fast, coarse, held or stepped: what a sensor may see is left alone."""
    assert not spikes(SIGNALS[signal]).any()


@given(first=st.integers(5, COUNT - 60), length=st.integers(10, 55), seed=st.integers(0, 99))
def test_a_dead_sensor_is_found_where_it_is(first, length, seed):
    values = SWEEP + noise(seed)
    values[first : first + length] = values[first]
    assert frozen_runs(values) == (Run(first, first + length - 1),)


def test_rest_is_not_death():
    """At its start a channel may rest; one that is coarse or slow always repeats; nor may less.

    One that repeats each number twenty times is dead after two hundred, not before.
    """
    slow, brief = np.repeat(noise(1)[: COUNT // 20], 20), SWEEP + noise(2)
    brief[500:509] = brief[500]
    barely = np.where(TIME < 3.0, 1e-12 * np.sin(TIME * (TIME > 0.05)), SWEEP)
    resting = np.where(TIME < 3.0, 0.0, SWEEP + noise(0))
    for alive in (resting, barely, slow, brief, np.zeros(COUNT)):
        assert frozen_runs(alive) == ()
    slow[600:780] = slow[600]
    assert frozen_runs(slow) == ()
    slow[600:900] = slow[600]
    assert frozen_runs(slow) == (Run(600, 899),)


@pytest.mark.filterwarnings("error")
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=150, max_size=300))
def test_any_numbers_are_looked_at(values):
    array = np.array(values)
    assert spikes(array).shape == array.shape
    assert all(0 <= one.first <= one.last < array.size for one in frozen_runs(array))
