"""What a flight without sweeps tells: the helicopter's own responses, of what flew alone."""

import numpy as np
import pytest

from flown_copter import Flown, Plant
from helisim.base.errors import IdentificationError, LogError
from helisim.logs.dataflash import open_dataflash
from helisim.logs.source import file_digest
from helisim.look.sticks import stick_response


def told(log, folder):
    path = log.save(folder)
    return stick_response([open_dataflash(path, file_digest(path))])


def test_steps_of_sticks_tell_rates_and_attitudes_over_commands(tmp_path):
    """Without noise within 1 %, the least error stated, of what moves an axis itself."""
    found = told(Flown().steps(count=16), tmp_path)
    frequency = np.geomspace(1.5, 39.0, 40)
    exact = Plant().response(frequency)
    off = np.abs(found.response(frequency) - exact)
    own = np.index_exp[[0, 1, 2, 3, 4, 5], [0, 1, 2, 0, 1, 2]]
    # angles at ticks of 10 ms are no integrals of rates by (w T)^2 / 12
    assert np.all(off[own] < (0.01 + (0.01 * frequency) ** 2 / 12.0) * np.abs(exact[own]))
    # steps begin at 15 s; 3 s before and after what moves a target count
    assert found.start == pytest.approx(12.0, abs=0.05)
    assert found.seen("ped")[[0, -1]].tolist() == pytest.approx([1.5, 40.0])
    drawn = np.array([one.rates - found.rates for one in found.draws(400)])
    # 400 draws, real and imaginary: a variance is known to 5 %, one standard deviation
    for part in (drawn.real, drawn.imag):
        np.testing.assert_allclose(np.mean(part**2, axis=0), found.errors**2, rtol=0.25)


def test_what_lies_or_moves_for_less_than_10_s_does_not_count(tmp_path):
    """Steps from 15 s, of roll alone; 3 s beside lift-off (28) and landing (18) are none."""
    log = Flown().steps(axes=(0,), count=16)
    flown, end = log.messages, 1e-6 * log.us - 9.0  # the last is held and left for 3 s at most
    short = (LogError, "no target of attitude .* moves in flight for 10 s")
    for event, at, (error, said) in (
        (18, 24.5, short),
        (18, 25.5, (IdentificationError, "'ped' is constant")),
        (28, end - 9.0, short),
        (28, end - 14.0, (IdentificationError, "'ped' is constant")),
    ):
        log.messages = list(flown)
        log.write(12, round(1e6 * at), event)
        with pytest.raises(error, match=said):
            told(log, tmp_path)
