"""Rotorflight's law on a real log: its terms from the logged setpoint and gyro, beside the logged.

LOG246.TXT of Iteratrix/propwash, an XK K110 on the bench, Rotorflight 4.3.0, as blackbox_decode of
betaflight/blackbox-tools makes a CSV of it. F isn't in its header: axisF over setpoint says 60 and
55. Its D acts on the error, as 4.3 could; its cyclic I has half today's scale (pid.h until July
2023), fades at 0.4/s on the ground, its relax is unknown. Yaw's F has precompensation: left out.

    python scripts/proof/rotorflight_log.py LOG.csv
"""

import common
import numpy as np

from helisim.design import laws
from helisim.design.laws import rotorflight_kernel as kernel

PERIOD, GAP, SETTLES, WINDOW = 500e-6, 3e-3, 0.06, 10  # s of PID, lost, filters; frames of I
OLD = {"error_decay_time": 24.0, "error_limit": 180.0, "relax_level": 0.0, "range": 1.0}
LAW = laws.Rotorflight(
    roll=laws.CyclicRotorflight(p=60.0, i=60.0, f=60.0, **OLD),
    pitch=laws.CyclicRotorflight(p=50.0, i=55.0, f=55.0, **OLD),
    yaw=laws.YawRotorflight(
        **{**OLD, "error_decay_time": 25.0},
        **{"p": 40.0, "i": 50.0, "d": 50.0, "gyro_cutoff": 50.0},
        **{"cw_stop_gain": 100.0, "ccw_stop_gain": 100.0},
    ),
    collective=laws.CollectiveRotorflight(range=1.0),
)
BLOCKS = (kernel.ROLL, kernel.PITCH, kernel.YAW)


def computed(log: dict[str, np.ndarray], axis: int) -> dict[str, np.ndarray]:
    """Return the law's P, I, F and D, x 1000, at the frames, (n_frame,) each."""
    settings, state, block = LAW.numbers(PERIOD), np.zeros(kernel.COUNT), BLOCKS[axis]
    time = 1e-6 * log["time"]
    loops = time[0] + PERIOD * np.arange(round((time[-1] - time[0]) / PERIOD) + 1)
    wanted, rate = (
        np.interp(loops, time, log[f"{one}[{axis}]"]) for one in ("setpoint", "gyroADC")
    )
    at, frames = int(settings[block + kernel.AXIS.state]), np.rint((time - time[0]) / PERIOD)
    p_gain, i_gain, d_gain = settings[block + kernel.AXIS.p : block + kernel.AXIS.p + 3]
    summed, slope, found = dict(zip(frames[::WINDOW], log[f"axisI[{axis}]"][::WINDOW])), [0.0], []
    for k, (r, q) in enumerate(zip(wanted, rate)):
        p, i, _, f, _, _ = kernel.terms(state, settings, block, r, q, 0.0)
        d = kernel.filtered(slope, settings, 0, block + kernel.AXIS.derivative, p / p_gain)
        found.append((p, i, f, d_gain * d))
        if k in summed:  # I begins anew each 20 ms where the log's is
            state[at + kernel.STATE.error] = 1e-3 * summed[k] / i_gain
    return dict(zip("PIFD", 1e3 * np.array(found)[frames.astype(int)].T))


def main(path: str) -> None:
    """Print how far the terms are from the logged ones, in counts, and shares within 1."""
    log, rows = common.decoded(path), []
    time = 1e-6 * (log["time"] - log["time"][0])
    lost = time[1:][np.diff(time) > GAP]
    fine = np.all((time[:, None] < lost) | (time[:, None] > lost + SETTLES), axis=1)
    for axis, (name, kept) in enumerate((("roll", "PIF"), ("pitch", "PIF"), ("yaw", "PID"))):
        terms = computed(log, axis)
        for term, calm in ((one, calm) for one in kept for calm in (True, False)):
            logged, used = log[f"axis{term}[{axis}]"], fine & ((time < 12.0) == calm)
            off, when = np.abs(terms[term] - logged)[used], "to 12 s" if calm else "after"
            shares = (100.0 * np.mean(off <= 1.0), np.sqrt(np.mean(off**2)), off.max())
            rows.append((name, term, when, logged[used].std(), *shares))
    common.table("axis:<6|term:<5|when:<8|std:7.1f|within 1, %:10.1f|rms:7.2f|most:7.1f", rows)


if __name__ == "__main__":
    common.run(main)
