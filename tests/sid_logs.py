"""Logs of ArduPilot's mode SystemID, of a helicopter whose derivatives are known exactly.

Its roll and pitch, yaw and heave are those of `TRUTH`, held by rate feedback; sweeps and messages
are as ArduPilot's documentation describes them.
"""

from functools import cache

import numpy as np
from scipy.linalg import expm

from autopilot_logs import Log
from helisim.base.units import STANDARD_GRAVITY as G
from helisim.ident import structures
from helisim.ident.evaluate import linear
from tabled import rows

TRUTH = dict(rows(globals(), "TRUTH"))
_FEEDBACK = np.array([0.04, 0.08, 0.05])
"""Command by p, q and r, s/rad."""
_LEAN = 0.3
"""Lateral command by bank angle, where there is sideslip; without it nothing holds the bank."""
SLIP = {"N_v": 6.0, "Y_v": -1.0, "Y_ped": -6.0}
"""Yaw and side acceleration by side velocity and pedal: N_r seems N_v Y_ped / N_ped larger."""
_MIXED = 0.15
"""Of each cyclic command that goes to the other one too, as from a rotor's phase."""


def _system(slip):
    a, b = np.zeros((8, 8)), np.zeros((8, 4))
    if slip:
        a[6, 0], a[7, [3, 6]] = 1.0, G
        a[4, 7], a[7, 7], b[7, 2] = SLIP["N_v"], SLIP["Y_v"], SLIP["Y_ped"]
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
    pulses=0.0, slip=False,
):  # fmt: skip
    """Return time of a sweep by its start, what was injected, its frequency, commands and motion.

    `axis` is of SID_AXIS: 10 to 13, or 1 to 9, which inject the same elsewhere; frequencies and
    `rate` are in Hz; `noise` turns it, rad/s^2 rms; `pulses` are those of the tail's travel to one
    side, us, 0 for a servo that takes any number. Motion is p, q, r, dw/dt, dp/dt, dr/dt, phi and
    dv/dt - g phi; `slip` lets it move sideways, and yaw by that.
    """
    time = np.arange(round((length + 4.0) * rate)) / rate
    injected, frequency = chirp(time - 1.0, low, high, length)
    injected = magnitude * np.where(time < 1.0, 0.0, injected)
    a, b = _system(slip)
    held = expm(np.block([[a, b], [np.zeros((4, 12))]]) / rate)
    held, driven = held[:8, :8], held[:8, 8:]
    back = np.zeros((4, 8))
    back[0, 6] = -_LEAN * slip
    back[[0, 1, 2], [0, 1, 4]] = -_FEEDBACK
    back[0, 1] = _MIXED * _FEEDBACK[1]
    added = np.zeros((time.size, 4))
    # what is logged as injected acts one loop later
    added[1:, (axis - 1) % 3 if axis < 13 else 3] = injected[:-1]
    random = np.random.default_rng(seed).standard_normal((time.size, 3)) * noise / rate
    pushed = added @ driven.T
    pushed[:, [0, 1, 4]] += random
    closed, states = held + driven @ back, np.zeros((time.size, 8))
    for k in range(time.size - 1):
        states[k + 1] = closed @ states[k] + pushed[k]
        if pulses:
            pedal = back[2] @ states[k] + added[k, 2]
            states[k + 1] += driven[:, 2] * (np.trunc(pedal * pulses) / pulses - pedal)
    commands = states @ back.T + added
    rates = states @ a.T + commands @ b.T
    rates[:, 7] -= G * states[:, 6]
    motion = [states[:, [0, 1, 4]], rates[:, [5, 0, 4]], states[:, 6], rates[:, 7]]
    return time, injected, frequency, commands, np.column_stack(motion)


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
        self.define(11, "ANG", "Qff", "TimeUS,DesRoll,Roll", units="sdd", multipliers="F--")
        self.define(12, "EV", "QB", "TimeUS,Id", units="s-", multipliers="F-")
        self.define(13, "ERR", "QBB", "TimeUS,Subsys,ECode", units="s--", multipliers="F--")
        self.define(14, "CTUN", "Qf", "TimeUS,Alt", units="sm", multipliers="F-")
        self.place = [(parameters or {}).get(f"INS_POS1_{axis}", 0.0) for axis in "XYZ"]
        self.say("ArduCopter V4.7.0 (test)")
        for name, value in {"FRAME_CLASS": 6.0, **(parameters or {})}.items():
            self.write(1, self.us, name.encode(), value, 0.0)
        self.mode(0)

    @property
    def us(self):
        return round(1e6 * self._now)

    def say(self, text):
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
        self.write(3, self.us, number, number, 2)

    def sweep(
        self, axis, *, stop=None, why="SystemID Stopped: lean=31.0 max=30.0", keep=None,
        lands=np.inf, told="motion", **options,
    ):  # fmt: skip
        """Fly a sweep, stopped after `stop` s, and write rows `keep`, (n_time,), of it.

        It `lands` after so many s, as is `told` by motion or height alone, or a message (number and
        fields), or doesn't and hovers.
        """
        time, injected, frequency, commands, motion = flown(axis, rate=self.rate, **options)
        if told in ("motion", "hover"):
            motion = motion * (time < lands)[:, None]
        elif told != "height" and lands < np.inf:
            self.write(told[0], self.us + round(1e6 * lands), *told[1:])
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
        felt = -G + motion[:, 3]
        aside = motion[:, 7] + self.place[0] * motion[:, 5] - self.place[2] * motion[:, 4]
        rates = [x for r, c in zip(degrees.T, commands.T) for x in (zero, r, c)]
        rows = [
            self._rows(number, begun + time, values)[kept]
            for number, name, values in (
                (5, "SIDD", [time, unit * injected, frequency, *degrees.T, zero, aside, felt]),
                (6, "RATE", [*rates, zero, zero, half + commands[:, 3]]),
            )
            if name not in self._without
        ]
        if told in ("height", "hover"):
            sunk = np.clip(time / lands, 0.0, 1.0) * (told == "height")
            left = self._rows(14, begun + time, [12.0 - 12.0 * sunk])
            self.messages.append(left[::10].tobytes())
        if options.get("slip"):
            rows.append(self._rows(11, begun + time, [zero, 180.0 / np.pi * motion[:, 6]])[kept])
        self.messages.append(np.hstack(rows).tobytes())
        self._now = begun + float(time[kept][-1])
        if stop is not None:
            self.say(why)
        self._now += 1.0
        self.mode(2)
        self._now += 3.0
        return self


def four_axes(path, **options):
    """Write a log with a sweep of each axis of the mixer, of a helicopter that slips."""
    log = SidLog(**options)
    for axis in (10, 11, 12, 13):
        log.sweep(axis, noise=0.3, seed=axis, slip=True)
    return log.save(path.parent, path.name)
