"""What looks at logs of every kind tell, whole, as it was reviewed: test_look_kept.json."""

import numpy as np
import pytest
from test_look import anyones, ardupilot, flown, named  # noqa: F401  (rows name them)
from test_sticks import told
from test_vibration import IN_FLIGHT, MAIN, a_log, shaken

from flown_copter import Flown
from helisim.base.settings import to_plain
from helisim.logs.examples import examples  # noqa: F401  (rows name them)
from helisim.look import look
from helisim.look.loops import flown_loops
from helisim.look.systemid import infer
from helisim.look.vibration import vibration
from sid_logs import SidLog
from tabled import rows


def doublet(path):
    time = np.arange(3000) / 50.0
    lat = 0.1 * ((time >= 20.0) & (time < 21.0)) - 0.1 * ((time >= 21.0) & (time < 22.0))
    p = 57.3 * np.convolve(lat, 1.8 * np.exp(-0.12 * np.arange(200)))[: time.size]
    noise = np.random.default_rng(4).standard_normal((2, time.size))
    table = np.column_stack([time, lat + 1e-4 * noise[0], p + 0.02 * noise[1]])
    np.savetxt(path, table, delimiter=",", header="t,aileron,p", comments="")
    return path


def rested(path):
    """An elevator's 1-2-1, whose answer is slow, beside a rudder that rests; then the ailerons'."""
    t, noise = np.arange(3000) / 50.0, np.random.default_rng(4).standard_normal((3, 3000))
    wave = (np.abs(t - 11.0) < 1.0) * np.where(np.abs(t - 11.0) < 0.5, 1.0, -1.0)
    q = np.convolve(wave, 0.2 * np.exp(-0.04 * np.arange(200)))[:3000] + 0.002 * noise[0]
    table = np.stack([t, wave, np.roll(wave, 300), 0.01 * noise[1], q, 0.02 * noise[1]], axis=1)
    np.savetxt(path, table, delimiter=",", header="t,elevator,aileron,rudder,q,r", comments="")
    return path


LOGS = dict(rows(globals(), "LOGS"))


@pytest.mark.parametrize("name", LOGS)
def test_a_look(name, tmp_path, kept):
    found = look(LOGS[name](tmp_path))
    kept([found.to_dict(), str(found)])


def test_sweeps_of_systemid(tmp_path, kept):
    log, short = SidLog(), {"length": 12.0, "low": 1.0}
    log.sweep(10, slip=True, **short).sweep(11, **short).sweep(12, stop=9.0, why="-", **short)
    found = infer(log.sweep(13, lands=6.0, **short).save(tmp_path))
    sweeps = [one.to_dict() for log in found.logs for one in log.sweeps]
    fits = [to_plain(one) for one in found.fits]
    kept([sweeps, fits, found.diagnostics, str(found)])


def test_loops_of_an_arducopter(tmp_path, kept):
    found = flown_loops(Flown(without=("PIDR",)).fly(10).fly(12).save(tmp_path))
    figures = [to_plain(one) for one in found.margins(draws=20).figures]
    kept([figures, found.remarks])


def test_sticks_of_a_flight(tmp_path, kept):
    found = told(Flown().steps(count=8), tmp_path)
    at = np.array([2.0, 8.0, 30.0])
    response = found.response(at)
    kept([found.start, np.abs(response).tolist(), found.errors[:, :, ::20].tolist()])


@pytest.mark.parametrize("rpm", [None, 600.0 * MAIN])
def test_vibration(tmp_path, kept, rpm):
    found = vibration(a_log(tmp_path, batches=shaken(IN_FLIGHT, drift=0.003), rpm=rpm))
    kept([found.to_dict(), [*map(to_plain, found.notches)], found.lag(20.0)])
