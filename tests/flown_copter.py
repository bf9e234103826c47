"""Logs of a helicopter that is known exactly, flown by an ArduCopter-heli's law."""

from pathlib import Path

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, lfilter

from command import parm_file
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.look.sweeps import SID_AXES
from sid_logs import SidLog, _system, chirp

PARAMETERS = parm_file(Path(__file__).with_suffix(".parm"))
RATE = PARAMETERS["SCHED_LOOP_RATE"]
LAW = ArduCopterLaw.of(PARAMETERS)
SWEEP = {"low": 0.5, "high": 8.0, "length": 24.0}
OUTPUTS = ("p", "q", "r", "phi", "theta", "psi")


def plant():
    """Return A, B and C of the helicopter of `sid_logs` with its angles, at ticks."""
    a, b = _system(slip=False)
    whole = np.zeros((12, 12))
    whole[:6, :6], whole[:6, 9:] = a[:6, :6], b[:6, :3]
    whole[[6, 7, 8], [0, 1, 4]] = 1.0
    held = expm(whole / RATE)
    return held[:9, :9], held[:9, 9:], np.eye(9)[[0, 1, 4, 6, 7, 8]]


class Plant:
    """Responses of the helicopter from commands to motion."""

    inputs, outputs = COMMANDS, OUTPUTS

    def response(self, frequency):
        a, b, c = plant()
        z = np.exp(1j * frequency / RATE)
        moved = np.linalg.solve(z[:, None, None] * np.eye(9) - a, b[None])
        return np.moveaxis(c @ moved, 0, -1)


class Flown(SidLog):
    """A log of flights by `LAW`; the pilot brings back what drifts off, by his stick."""

    def __init__(self, parameters=PARAMETERS, pilot=0.0, **options):
        super().__init__(rate=RATE, parameters=parameters, **options)
        self._pilot, self._law = pilot, ArduCopterLaw.of(parameters).ticked
        self.define(7, "ANG", "Qffffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw",
                    units="sdddddd", multipliers="F------")  # fmt: skip
        for number, name in ((8, "PIDR"), (9, "PIDP"), (10, "PIDY")):
            self.define(number, name, "Qfffff", "TimeUS,P,I,D,FF,DFF")

    def fly(self, axis):
        row = COMMANDS.index(SID_AXES[axis].control)
        time = np.arange(2800) / RATE
        swept, frequency = chirp(time - 1.0, **SWEEP)
        targ = np.where(time < 1.0, 0.0, 0.05 * swept)
        rows = self._rolled(np.outer(targ, np.eye(3)[row]), np.zeros((time.size, 3)))
        self._write(axis, time, targ, frequency, rows)
        return self

    def steps(self, size=0.15, gusts=0.0, axes=(0, 1, 2), twice=False, count=24):
        random = np.random.default_rng(3)
        asked = [np.zeros((500, 3))]
        for k in (k for row in axes for k in [row] * count):
            step = size * random.uniform(0.7, 1.3) * (-1.0) ** len(asked)
            asked += [np.tile(step * np.eye(3)[k], (random.integers(60, 160), 1))]
            asked += [np.zeros((random.integers(60, 120), 3))]
        asked = np.vstack([*asked, np.zeros((500, 3))])
        b, a = butter(1, 0.5, fs=RATE)
        pushed = gusts * lfilter(b, a, random.standard_normal(asked.shape), axis=0)
        rows = self._rolled(pushed, asked, logged=False)
        self._write(None, np.arange(len(asked)) / RATE, None, None, rows, twice)
        return self

    def _rolled(self, adds, asks, logged=True):
        """Return commands, those of the law, motion and aims, of added commands and sticks."""
        (a, b, c), law = plant(), self._law
        state, inner, drift = np.zeros(9), np.zeros(len(law.a)), np.zeros(2)
        rows, added = [], np.zeros(3)
        for add, stick in zip(adds, asks):
            asked = stick + np.array([*(-self._pilot * drift), 0.0])
            seen = np.concatenate([c @ state, asked, np.zeros(len(law.b[0]) - 9)])
            back = law.c @ inner + law.d @ seen
            inner = law.a @ inner + law.b @ seen
            rows.append([*(back + logged * added), *back, *(c @ state), *inner[15:18]])
            state = a @ state + b @ (back + added)
            added = add
            drift += (c @ state)[3:5] / RATE
        return np.array(rows).T

    def _write(self, axis, time, targ, frequency, rows, twice=False):
        total, back, rates, angles, aims = np.split(rows, [3, 6, 9, 12])
        begun, zero = self._now, np.zeros(time.size)
        length, low = SWEEP["length"], SWEEP["low"]
        if axis is None:
            self.mode(0)
        else:
            self.write(
                4, self.us, axis, np.abs(targ).max(), low, SWEEP["high"], 1.0, 2.0 / low,
                length, 1.0,
            )  # fmt: skip
            self.mode(25)
        degrees = np.degrees(rates)
        turned = np.degrees([x for pair in zip(aims, angles) for x in pair])
        sent = [x for r, u in zip(degrees, total) for x in (zero, r, u)]
        written = [
            *(
                [(5, [time, targ, frequency, *degrees, zero, zero, zero - 9.8])]
                * (axis is not None)
            ),
            *([(6, [one + 1.0 for one in sent] + [zero] * 3)] * twice),
            (6, [*sent, zero, zero, zero + 0.5]),
            (7, [*turned]),
            *(
                (8 + k, [one, zero, zero, zero, zero])
                for k, one in enumerate(back)
                if f"PID{'RPY'[k]}" not in self._without
            ),
        ]
        each = [self._rows(number, begun + time, values) for number, values in written]
        self.messages.append(np.hstack(each).tobytes())
        self._now = begun + float(time[-1]) + 4.0
