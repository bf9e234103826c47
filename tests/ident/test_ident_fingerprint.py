"""Fingerprints: a part of a record is known wherever it was cut, another flight is not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from helisim.ident.fingerprint import RUN, STRETCH, fingerprint, marks, share_known
from helisim.records.channels import channel
from helisim.records.record import FlightRecord

CERTAIN = RUN + STRETCH - 1
"""Samples from which a part has a mark for certain (winnowing's guarantee)."""


def record(seed, n=3000, step=1e-3):
    """A coloured rate as a recorder writes it: noisy, and in steps of its resolution."""
    noise = np.random.default_rng(seed).standard_normal(n + 8)
    rate = np.round(np.convolve(noise, np.ones(9) / 9.0, "valid") / step) * step
    return FlightRecord(0.01 * np.arange(n), np.column_stack([rate]), (channel("p"),))


SEEN = record(1)
KNOWN = marks([SEEN], ("p",))


@given(start=st.integers(0, 2500), length=st.integers(CERTAIN, 3000))
def test_any_part_of_a_record_is_known(start, length):
    """Wherever a part begins and ends, all its marks are the whole's: so are its stretches."""
    part = SEEN.slice(0.01 * start - 1e-6, 0.01 * (start + length) - 1e-6)
    assert len(part) < CERTAIN or share_known(part, ("p",), KNOWN) == 1.0


@pytest.mark.parametrize("seed", range(2, 12))
def test_another_flight_is_not_known(seed):
    """Of the same kind and resolution, and yet no run of sixteen samples is the same."""
    assert share_known(record(seed), ("p",), KNOWN) == 0.0


def test_a_part_with_another_start_of_time_is_known():
    """A log that was cut and numbered anew holds the same samples."""
    part = FlightRecord(0.01 * np.arange(1000), SEEN.values[700:1700], SEEN.channels)
    assert fingerprint(part) != fingerprint(SEEN)
    assert share_known(part, ("p",), KNOWN) == 1.0


@pytest.mark.parametrize("levels", [(0.0,), (0.1,), (0.0, -0.0), (0.0, 0.1, 0.2)])
def test_a_channel_at_rest_has_no_marks(levels):
    """A constant, or one that steps now and then, is the same in any two flights."""
    values = np.repeat(levels, 500)[:, None]
    rest = FlightRecord(0.01 * np.arange(len(values)), values, (channel("p"),))
    assert marks([rest], ("p",)) == ()


@pytest.mark.parametrize("n", [2, RUN - 1, RUN, RUN + 1, CERTAIN])
def test_a_record_of_any_length_is_known_or_has_no_marks(n):
    """Records shorter than a run have none; longer ones know themselves."""
    short = record(3, n=n)
    own = marks([short], ("p",))
    assert len(own) >= (n >= RUN)
    assert share_known(short, ("p",), own) == (1.0 if own else 0.0)


def test_the_marks_of_many_records_are_few():
    """About two of a stretch's runs: a fit's file stays small."""
    density = len(KNOWN) / len(SEEN)
    # Schleimer et al., section 4.2: 2 / (w + 1); the scatter of 23 marks is their square root
    assert density == pytest.approx(2.0 / (STRETCH + 1), rel=3.0 / np.sqrt(23.0))
