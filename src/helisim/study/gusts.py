"""What moves a helicopter in gusts, from the log of a hover, and how far a law then errs."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter1d

from helisim.base.arrays import Real
from helisim.base.linear import Linear
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.loop import axis_of
from helisim.logs.dataflash import DataFlash
from helisim.look.loops import LOGGED, flown_law, line
from helisim.look.sticks import flies
from helisim.records.quality import stretches
from helisim.sitl.gains import BAND, strays

# m from a hover's usual height, s before and after: what is further away is a climb or a landing
_LEVEL, _SETTLES = 1.0, 3.0
# rad/s, between `BAND` from 0.1 Hz on: slower errors are of trim, where no sweep tells a model
_EDGES = np.sqrt([*BAND[:1], *BAND] * np.array([*BAND, *BAND[-1:]])).clip(0.2 * math.pi)
_STILL = math.radians(0.02)  # of attitude's error, which ArduPilot's law takes for none
_HISTORIES = (
    ("height, m", "CTUN", ("Alt",)),
    ("height, m", "POS", ("RelHomeAlt",)),
    ("wind by the EKF, m/s", "XKF2", ("VWN", "VWE")),
    ("rotor speed, rpm", "RPM", ("RPM",)),
    ("rotor speed, rpm", "RPM", ("rpm1",)),
    ("motor's speed, rpm", "ESC", ("RPM",)),
)


def histories(log: DataFlash) -> dict[str, tuple[Real, Real]]:
    """Return what a log has over time: height, and sizes of wind and rotor speed."""
    found = dict[str, tuple[Real, Real]]()
    for label, message, names in _HISTORIES:
        if log.has(message, *names):
            table = log.table(message, log.instances(message)[0])
            size = np.linalg.norm([np.asarray(table[name], np.float64) for name in names], axis=0)
            if np.any(size):  # an EKF that estimates no wind says 0
                found.setdefault(label, (table.time - log.begins, size))
    return found


def errs(plant: Linear, law: Linear, axis: str, moves: Real) -> Real:
    """Return squares of the rms of target less attitude, (4,), by each of `Required.moves`."""
    # Rotorflight's sticks ask for rates alone
    missed = strays(ClosedLoop(plant, law, BAND), axis, getattr(law, "angle", {}))
    return np.sum(moves * np.abs(missed) ** 2, axis=1)


def whites(plant: Linear, law: Linear, axis: str) -> Real:
    """Return `Required.moves` by which a law errs by 1, where no flight in gusts tells others.

    They are white noise of the command, and of the own target's rate as much if one is asked for.
    """
    rows = np.array([np.ones(BAND.size), *((one == axis) * BAND**-2.0 for one in COMMANDS)])
    sizes = errs(plant, law, axis, np.gradient(BAND) * rows)[:, None]
    return np.gradient(BAND) * rows / np.where(sizes, sizes * np.count_nonzero(sizes), np.inf)


def flown_moves(
    logs: Sequence[DataFlash], plant: Linear, law: ArduCopterLaw, axis: str, remarks: list[str]
) -> Real:
    """Return `Required.moves` of hovers, by which a law errs by 1, and extend the remarks."""
    found = np.mean([_moved(log, plant, axis) for log in logs], axis=0)
    parts = errs(plant, law, axis, found)
    whole = float(parts.sum())
    tells = whole > _STILL**2
    remarks.append(
        f"{axis_of(axis).word} in gusts errs by {math.degrees(math.sqrt(whole)):.2g} deg with "
        f"today's gains, {parts[1:].sum() / whole:.0%} of its square because targets move"
        if tells
        else f"{axis_of(axis).word} errs by less than {math.degrees(_STILL):.2g} deg in the flight "
        "that should be in gusts: it stood, or the air was calm, and gusts are taken as usual"
    )
    return found / whole if tells else whites(plant, law, axis)


def _moved(log: DataFlash, plant: Linear, axis: str) -> Real:
    """Return `Required.moves`, rad^2, of the longest time of a log near its usual height.

    What the log's own law makes of the targets is taken out of the error; the rest is what turned
    the helicopter.
    """
    angles = log.table("ANG" if "ANG" in log else "ATT")
    law = flown_law(log, float(np.median(angles.time)))
    ticks = np.arange(angles.time[0], angles.time[-1], law.period)
    since, height = histories(log).get("height, m", (np.zeros(1), np.zeros(1)))
    off = np.interp(ticks - log.begins, since, np.abs(height - np.median(height)))
    level = maximum_filter1d(off, 2 * round(_SETTLES / law.period) + 1) < _LEVEL
    time = ticks[
        slice(*max(stretches(flies(log, ticks) & level), key=np.ptp, default=(0, ticks.size)))
    ]
    lines = (
        line(angles.time, np.radians(angles[name]))
        for name in (LOGGED[axis][2].removeprefix("Des"), *(one for *_, one in LOGGED.values()))
    )
    moved = np.array([np.interp(time, at, np.unwrap(one)) for at, one in lines])
    # a step from the end to the beginning would be in all frequencies
    angle, *aims = np.fft.rfft(moved - np.linspace(moved[:, 0], moved[:, -1], time.size, axis=1))
    turned, *missed = strays(ClosedLoop(plant, law, BAND), axis, law.angle)
    rows = np.fft.rfftfreq(time.size, law.period / (2.0 * np.pi))
    angle += sum(np.interp(rows, BAND, by) * one for by, one in zip(missed, aims))
    powers = np.abs([aims[COMMANDS.index(axis)] - angle, *aims]) ** 2 / time.size**2
    return np.diff([np.interp(_EDGES, rows, np.cumsum(2.0 * one)) for one in powers]) / np.vstack(
        [np.abs(turned) ** 2, np.ones((3, BAND.size))]
    )
