"""Logs of ArduPilot's mode SystemID, of a helicopter whose derivatives are known exactly.

Its roll and pitch, yaw and heave are those of `TRUTH`, held by rate feedback; sweeps and messages
are as ArduPilot's documentation describes them.
"""

from functools import cache

import numpy as np
from scipy.linalg import expm

from autopilot_logs import Log
from helisim.ident import structures
from helisim.ident.evaluate import linear

TRUTH = {
    "rollpitch_speeds": {
        "tau_f": 0.07, "L_b": 900.0, "M_a": 500.0, "A_b": -0.3, "B_a": 0.3, "A_lat": 0.05,
        "A_lon": 0.25, "B_lat": 0.25, "B_lon": -0.05, "tau_lat": 0.0, "tau_lon": 0.0,
        "A_u": 0.0, "A_v": 0.0, "L_p": 0.0, "M_q": 0.0,
    },
    "yaw_base": {"N_r": -3.0, "N_ped": 50.0, "tau_r_base": 0.0},
    "heave_imu": {"Z_w": -2.0, "Z_col": -25.0, "tau_col": 0.0},
}  # fmt: skip
_FEEDBACK = np.array([0.04, 0.08, 0.05])
"""Command by p, q and r, s/rad."""
_MIXED = 0.15
"""Of each cyclic command that goes to the other one too, as from a rotor's phase."""


def _system():
    """Return A, B of p, q, a, b, r, w over lat, lon, ped, col."""
    a, b = np.zeros((6, 6)), np.zeros((6, 4))
    places = {
        "rollpitch_speeds": (slice(0, 4), slice(0, 2)),
        "yaw_base": (slice(4, 5), slice(2, 3)),
        "heave_imu": (slice(5, 6), slice(3, 4)),
    }
    for name, (states, inputs) in places.items():
        found = linear(structures.named(name.removesuffix("_speeds")), TRUTH[name])
        a[states, states], b[states, inputs] = found.a, found.b
    return a, b


def chirp(time, low, high, length):
    """Return the sweep and its frequency, Hz: dwells for two periods, then rises exponentially."""
    dwell = 2.0 / low
    ratio = np.log(high / low)
    share = np.clip((time - dwell) / (length - dwell), 0.0, 1.0)
    phase = 2.0 * np.pi * low * (length - dwell) / ratio * np.expm1(ratio * share)
    phase = np.where(time < dwell, 2.0 * np.pi * low * (time - dwell), phase)
    window = np.clip(time, 0.0, 1.0) * np.clip(length - time, 0.0, 1.0)  # fades for 1 s
    return window * np.sin(phase), low * np.exp(ratio * share)


@cache
def flown(
    axis, *, rate=100.0, low=0.5, high=8.0, length=24.0, noise=0.0, seed=0, magnitude=0.05,
    pulses=0.0,
):  # fmt: skip
    """Return time of a sweep by its start, what was injected, its frequency, commands and motion.

    `axis` is of SID_AXIS: 10 to 13, or 1 to 9, which inject the same elsewhere; frequencies and
    `rate` are in Hz; `noise` turns it, rad/s^2 rms; `pulses` are those of the tail's travel to one
    side, us, 0 for a servo that takes any number.
    """
    time = np.arange(round((length + 4.0) * rate)) / rate
    injected, frequency = chirp(time - 1.0, low, high, length)
    injected = magnitude * np.where(time < 1.0, 0.0, injected)
    a, b = _system()
    held = expm(np.block([[a, b], [np.zeros((4, 10))]]) / rate)
    held, driven = held[:6, :6], held[:6, 6:]
    back = np.zeros((4, 6))
    back[[0, 1, 2], [0, 1, 4]] = -_FEEDBACK
    back[0, 1] = _MIXED * _FEEDBACK[1]
    added = np.zeros((time.size, 4))
    # what is logged as injected acts one loop later
    added[1:, (axis - 1) % 3 if axis < 13 else 3] = injected[:-1]
    random = np.random.default_rng(seed).standard_normal((time.size, 3)) * noise / rate
    pushed = added @ driven.T
    pushed[:, [0, 1, 4]] += random
    closed, states = held + driven @ back, np.zeros((time.size, 6))
    for k in range(time.size - 1):
        states[k + 1] = closed @ states[k] + pushed[k]
        if pulses:
            pedal = back[2] @ states[k] + added[k, 2]
            states[k + 1] += driven[:, 2] * (np.trunc(pedal * pulses) / pulses - pedal)
    commands = states @ back.T + added
    climbing = states @ a[5] + commands @ b[5]
    return time, injected, frequency, commands, np.column_stack([states[:, [0, 1, 4]], climbing])


class SidLog(Log):
    """A DataFlash log of a flight with sweeps; types of messages in `without` aren't logged."""

    def __init__(self, *, rate=100.0, parameters=None, without=(), **options):
        super().__init__(**options)
        self.rate, self._now, self._without = rate, 10.0, without
        self.define(1, "PARM", "QNff", "TimeUS,Name,Value,Default")
        self.define(2, "MSG", "QZ", "TimeUS,Message", units="s-", multipliers="F-")
        self.define(3, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn")
        self.define(
            4, "SIDS", "QBfffffff", "TimeUS,Ax,Mag,FSt,FSp,TFin,TC,TR,TFout",
            units="s--------", multipliers="F--------",
        )  # fmt: skip
        self.define(
            5, "SIDD", "Qfffffffff", "TimeUS,Time,Targ,F,Gx,Gy,Gz,Ax,Ay,Az",
            units="ss--kkk---", multipliers="F---------",
        )  # fmt: skip
        self.define(
            6, "RATE", "Q" + 12 * "f", "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut",
            units="skk-kk-kk----", multipliers="F------------",
        )  # fmt: skip
        self.say("ArduCopter V4.7.0 (test)")
        for name, value in {"FRAME_CLASS": 6.0, **(parameters or {})}.items():
            self.write(1, self.us, name.encode(), value, 0.0)
        self.mode(0)

    @property
    def us(self):
        """Now, us."""
        return round(1e6 * self._now)

    def say(self, text):
        """Write a message to people."""
        self.write(2, self.us, text.encode())

    def _rows(self, number, time, values):
        """Return messages as bytes, (n_time, n_byte)."""
        fields = [("head", "V3"), ("us", "<u8"), *((f"f{k}", "<f4") for k in range(len(values)))]
        rows = np.empty(time.size, fields)
        rows["head"] = np.void(bytes((0xA3, 0x95, number)))
        rows["us"] = np.rint(1e6 * time)
        for k, column in enumerate(values):
            rows[f"f{k}"] = column
        return rows.view((np.uint8, rows.itemsize))

    def mode(self, number):
        """Write that a mode was chosen."""
        self.write(3, self.us, number, number, 2)

    def sweep(
        self, axis, *, stop=None, why="SystemID Stopped: lean=31.0 max=30.0", keep=None, **options
    ):
        """Fly a sweep, stopped after `stop` s, and write rows `keep`, (n_time,), of it."""
        time, injected, frequency, commands, motion = flown(axis, rate=self.rate, **options)
        sweep = {"low": 0.5, "high": 8.0, "length": 24.0, "magnitude": 0.05} | options
        low, high = sweep["low"], sweep["high"]
        unit = 180.0 / np.pi if axis < 10 else 1.0
        self.say(f"SystemID Starting: axis={axis}")
        if "SIDS" not in self._without:
            self.write(
                4, self.us, axis, unit * sweep["magnitude"], low, high, 1.0, 2.0 / low,
                sweep["length"], 1.0,
            )  # fmt: skip
        self.mode(25)
        begun = self._now
        degrees = 180.0 / np.pi * motion[:, :3]
        kept = np.ones(time.size, bool) if keep is None else np.array(keep)
        kept &= time < (np.inf if stop is None else stop)
        zero, half = np.zeros(time.size), np.full(time.size, 0.5)
        felt = -9.80665 + motion[:, 3]
        rates = [x for r, c in zip(degrees.T, commands.T) for x in (zero, r, c)]
        rows = [
            self._rows(number, begun + time, values)[kept]
            for number, name, values in (
                (5, "SIDD", [time, unit * injected, frequency, *degrees.T, zero, zero, felt]),
                (6, "RATE", [*rates, zero, zero, half + commands[:, 3]]),
            )
            if name not in self._without
        ]
        self.messages.append(np.hstack(rows).tobytes())
        self._now = begun + float(time[kept][-1])
        if stop is not None:
            self.say(why)
        self._now += 1.0
        self.mode(2)
        self._now += 3.0
        return self


def four_axes(path, **options):
    """Write a log with a sweep of each axis of the mixer."""
    log = SidLog(**options)
    for axis in (10, 11, 12, 13):
        log.sweep(axis, noise=0.3, seed=axis)
    return log.save(path.parent, path.name)
