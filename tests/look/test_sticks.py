"""What a flight without sweeps tells: the helicopter's own responses, of what flew alone."""

import numpy as np
import pytest

from flown_copter import Flown, Plant
from helisim.base.errors import LogError
from helisim.logs.dataflash import open_dataflash
from helisim.logs.source import file_digest
from helisim.look.sticks import _records, stick_response
from told_log import Rows, Told


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
    for event, at, moves in (
        (18, 24.5, "0"),
        (18, 25.5, r"10\.\d"),
        (28, end - 9.0, "0"),
        (28, end - 14.0, r"1\d\.?\d?"),
    ):
        log.messages = list(flown)
        log.write(12, round(1e6 * at), event)
        with pytest.raises(LogError, match=f"flight for {moves} s, .*; expected 20.9 s or more"):
            told(log, tmp_path)


def noises(step, lasts=60.0, turns=0.0):
    """Return a log of rates that answer noise on the commands; targets of attitude go round."""
    time = 5.0 + np.arange(0.0, lasts, step)
    random = np.random.default_rng(1).standard_normal((7, time.size))
    aims = np.cumsum(random[:3], axis=0) + turns * np.arange(time.size)
    sent = {f"{axis}Out": one for axis, one in zip("RPY", random[:3])}
    rates = {axis: 2.0 * one + 0.1 * more for axis, one, more in zip("RPY", random, random[3:])}
    wrapped = (aims + 180.0) % 360.0 - 180.0
    aimed = dict(zip(("DesRoll", "DesPitch", "DesYaw"), wrapped))
    return Told(RATE=Rows(time, **sent, **rates), ANG=Rows(time, **aimed))


def test_a_slow_log_shows_what_five_samples_a_period_do():
    """Samples of 50 ms show 25 rad/s, of 100 ms half of that; targets are the same across 180."""
    for step, highest in ((0.05, 8.0 * np.pi), (0.1, 4.0 * np.pi)):
        found = stick_response([noises(step)])
        assert found.start == pytest.approx(5.0 + 0.5 * step)
        # a line of the windows' 12 s is half a rad/s
        assert highest - 0.6 < found.frequency[-1] <= highest
    ((start, one),) = _records(noises(0.1))
    assert (start, one.sample_time) == pytest.approx((5.05, 0.1))
    ((_, round_),) = _records(noises(0.1, turns=7.0))
    assert round_["PED"] == pytest.approx(one["PED"] + np.radians(70.0))  # 7 deg a step of 0.1 s
    with pytest.raises(LogError, match=r"logged each 0\.151 s; expected 0\.15 s or less"):
        stick_response([noises(0.151)])
    assert _records(noises(0.1, lasts=10.3))
    assert not _records(noises(0.1, lasts=9.9))
