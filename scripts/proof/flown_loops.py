"""Loops that an unmodified ArduCopter-heli closed about a helicopter: as measured, and exact.

`helisim margins LOG`, with nothing else, beside the exact loops: ArduCopter's law from the
parameters in the log (`helisim.handling.arducopter`, which repeats an ArduCopter's own terms tick
by tick), and the exact linearisation of the vehicle that flew, motor and all, sampled at the
autopilot's ticks. Its pulses act at once and are held for a tick; the tail's go out a tick later.
With --heli the log is of ArduPilot's own simulated helicopter, whose equations its public source
states (libraries/SITL/SIM_Helicopter.cpp): no model of ours flew there.

Crossover and DRB are frequencies: judged is by how many dB the exact curve misses 0 dB, or -3 dB,
where the measured one has them. The curves themselves are judged where 0.1 < |L| < 10. The exit
status is 1 if a bar is missed, or a figure was not measured.

    helisim sitl --script sysid,stop_hz=24 --axes roll,pitch,yaw --log jr700.bin
    python scripts/proof/flown_loops.py jr700.bin

    python scripts/proof/ardupilots_helicopter.py heli.bin
    python scripts/proof/flown_loops.py --heli heli.bin
"""

import argparse
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import Linear, LinearSystem
from helisim.base.units import STANDARD_GRAVITY
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import HALF_POWER, margins, rejection
from helisim.handling.loop import axis_of
from helisim.handling.measured.interval import Interval
from helisim.handling.measured.margins import MeasuredMargins
from helisim.logs.dataflash import DataFlash
from helisim.look.loops import flown_law, flown_loops
from helisim.records.record import ATTITUDES, IN1, RATES
from helisim.sitl import Aircraft
from helisim.sitl.mixing import Mixer, command_scale

DECIBEL, DEGREES = 0.5, 3.0  # The bars.
_JUDGED = 10.0  # Ratio of |L| to 1, or of 1 to it, up to which curves are judged.
_FINE = 2000

OUTPUTS = (*RATES, *ATTITUDES)
Array = NDArray[np.float64]


def exact_plant(parameters: Mapping[str, float], hover: float, period: float) -> LinearSystem:
    """Return the JR700 that flew at ticks of a period (s), by ArduPilot's commands.

    ArduPilot's parameters are by name; `hover` is the throttle of the hover, 0 to 1.
    """
    aircraft = Aircraft("jr700")
    vehicle = aircraft.vehicle
    system = vehicle.linearize().system
    scale = command_scale(Mixer(parameters), aircraft.outputs, vehicle.swashplate, hover)
    scale = scale[:, [IN1.index(name) for name in COMMANDS]]
    by = [system.input_labels.index(name) for name in IN1]
    rows = [system.output_labels.index(name) for name in OUTPUTS]
    a, b, c = (np.asarray(one) for one in (system.A, system.B, system.C))
    zeros = np.zeros((len(OUTPUTS), len(COMMANDS)))
    own = LinearSystem(a, b[:, by] @ scale, c[rows], zeros, None, COMMANDS, OUTPUTS)
    return replace(own.discretise(period), delays={"ped": period})


_FRAME = 833e-6  # s, of ArduPilot's own helicopter's frames: 1200 a second, in whole microseconds
_FRAMES, _DELAY = 3, 60  # frames of a tick, and of its servos' 50 ms of delay
_AGE = _FRAME / 6.0  # s: its gyro is sampled 1000 times a second, at five of six frames
_LEAN, _TAU, _G = 3.2, 0.068232, STANDARD_GRAVITY  # deg, with which it hovers; s, its rotor's
_STATES = ("p", "q", "r", "b", "a", "u", "v", "phi", "theta", "psi")
_ORDER = (("b", "a"), ("p", "q", "r"), ("u", "v", "phi", "theta", "psi"))


def ardupilots_helicopter(parameters: Mapping[str, float]) -> LinearSystem:
    """Return ArduPilot's own simulated helicopter at the autopilot's ticks.

    It is integrated by Euler's method, each frame: the rotor's tilts by the rates before, the rates
    by the new tilts, speeds and attitudes by the new rates.
    """
    a, b = _continuous(parameters)
    n, m = b.shape
    frame, still = np.eye(n, n + m), np.hstack([np.zeros((n, n)), b])
    for names in _ORDER:
        rows = [_STATES.index(name) for name in names]
        frame[rows] += _FRAME * (a @ frame + still)[rows]
    once, driven = frame[:, :n], frame[:, n:]
    powers = [np.linalg.matrix_power(once, k) for k in range(_FRAMES + 1)]
    c = np.eye(n)[[_STATES.index(name) for name in OUTPUTS]]
    matrices = powers[-1], sum(powers[:-1]) @ driven, c, np.zeros((len(c), m))
    return LinearSystem(
        *(*matrices, _FRAME * _FRAMES, COMMANDS, OUTPUTS),
        delays={name: _FRAME * (_DELAY + _FRAMES * (name == "ped")) for name in COMMANDS},
        output_delays=dict.fromkeys(RATES, _AGE),
    )


def _continuous(parameters: Mapping[str, float]) -> tuple[Array, Array]:
    mixer = Mixer(parameters)
    still, moved = mixer.exact({"col": 0.5}), []
    for name in COMMANDS:
        one = mixer.exact({"col": 0.5, name: 0.1})
        moved.append([(one[servo] - still[servo]) / 100.0 for servo in (1, 2, 3, 4)])
    s1, s2, s3, s4 = np.array(moved).T  # of 1000 us, by each full command
    roll, pitch = 1.283 * (s1 - s2) / 7.2, 1.48 * ((s1 + s2) / 2.0 - s3) / 7.2
    tail = 21.6 * 2.96 * 2.0 * s4
    sine, cosine = np.sin(np.radians(_LEAN)), np.cos(np.radians(_LEAN))
    side = 0.2 / 0.85 / 4.54  # inertia in yaw over the tail's arm and the mass
    rates = {
        "b": {"p": -1.0, "b": -1.0 / _TAU, "a": 1.2963 / _TAU},
        "a": {"q": -1.0, "a": -1.0 / _TAU, "b": -1.3402 / _TAU},
        "p": {"b": 3588.6, "v": -0.006},
        "q": {"a": 617.5, "u": 0.003},
        "r": {"r": -2.96},
        "u": {"u": -0.125, "a": -_G, "theta": -_G},
        "v": {"v": -0.375, "b": _G, "phi": _G, "r": 2.96 * side},
        "phi": {"p": 1.0},
        "theta": {"q": cosine, "r": -sine},
        "psi": {"q": sine, "r": cosine},
    }
    driven = {
        "b": (1.7635 * roll - 0.61171 * pitch) / _TAU,
        "a": (0.52454 * roll + 1.9432 * pitch) / _TAU,
        "r": tail,
        "v": -tail * side,
    }
    a = np.array([[rates[to].get(by, 0.0) for by in _STATES] for to in _STATES])
    return a, np.array([driven.get(to, np.zeros(3)) for to in _STATES])


class Row(NamedTuple):
    """A figure: measured, its 95 % interval, exact, by how much it is off, and the bar."""

    axis: str
    figure: str
    unit: str
    value: float
    low: float
    high: float
    exact: float
    off: float
    bar: float

    @property
    def met(self) -> bool:
        return bool(abs(self.off) <= self.bar)

    def __str__(self) -> str:
        unit = "deg" if self.bar == DEGREES else "dB"
        return (
            f"{self.axis:<6}{self.figure:<14}{self.value:>9.3f}{self.low:>9.3f}{self.high:>9.3f}"
            f"{self.exact:>9.3f} {self.unit:<6}{self.off:>+8.3f} {unit}"
            + ("" if self.met else "  missed")
        )


def rows(found: MeasuredMargins, plant: Linear, law: ArduCopterLaw) -> list[Row]:
    table = []
    measured = {(one.axis, one.name): one.interval for one in found.figures}
    for axis in found.loop.axes:
        curve = found.loop.broken(axis)
        fine = ClosedLoop(plant, law, np.geomspace(*curve.frequency[[0, -1]], _FINE))
        loop, rejects = fine.broken(axis), fine.disturbance(axis)
        exact, turned = margins(loop), rejection(rejects)
        phase = np.degrees(min((abs(one) for _, one in exact.phase), default=np.nan))
        gain = min((abs(one) for _, one in exact.gain), default=np.nan)
        for name, unit, true, above in (
            ("crossover", "rad/s", exact.crossover, loop.decibel),
            ("phase_margin", "deg", phase, None),
            ("gain_margin", "dB", gain, None),
            ("DRB", "rad/s", turned.bandwidth, rejects.decibel - HALF_POWER),
            ("DRP", "dB", turned.peak, None),
        ):
            own = measured.get((axis, name), Interval(np.nan, np.nan, np.nan))
            off = own.value - true
            if above is not None:
                off = np.interp(np.log(own.value), np.log(loop.frequency), above)
            bar = DEGREES if unit == "deg" else DECIBEL
            sides = own.value, own.low, own.high
            table.append(Row(axis, name, unit, *sides, float(true), float(off), bar))
        true = ClosedLoop(plant, law, curve.frequency).broken(axis).response
        near = np.abs(np.log(np.abs(true))) < np.log(_JUDGED)
        ratio, at = curve.response[near] / true[near], curve.frequency[near]
        decibel, degrees = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
        for name, off, bar in ("|L|, worst at", decibel, DECIBEL), ("its phase", degrees, DEGREES):
            worst = int(np.argmax(np.abs(off)))
            where = float(at[worst]), float(at[0]), float(at[-1])
            table.append(Row(axis, name, "rad/s", *where, np.nan, float(off[worst]), bar))
    return table


def throttle(log: DataFlash, start: float, stop: float) -> float:
    """Return the median throttle, 0 to 1, between two times of a log, s."""
    rate = log.table("RATE")
    between = (rate.time >= start) & (rate.time <= stop)
    return float(np.median(np.asarray(rate["AOut"], float)[between]))


def judged(log: Path, *, own: bool) -> list[str]:
    flown, opened = flown_loops(log), DataFlash(log)
    swept = [sweep for one in flown.logs.values() for sweep in one]
    start, stop = (opened.begins + one for one in (swept[0].start, swept[-1].stop))
    hover, parameters = throttle(opened, start, stop), opened.parameters()
    law = flown_law(opened, start)
    plant = ardupilots_helicopter(parameters) if own else exact_plant(parameters, hover, law.period)
    table = rows(flown.margins(), plant, law)
    print(f"\nloops as flown: {log}")
    headings = f"{'measured':>9}{'95 % from':>9}{'to':>9}{'exact':>9}"
    print(f"{'':<20}{headings} {'':<6}{'off':>8}")
    print(*table, sep="\n")
    figures = [one for one in table if np.isfinite(one.exact)]
    inside = sum(one.low <= one.exact <= one.high for one in figures)
    print(f"{inside} of {len(figures)} exact figures are inside their 95 % intervals")
    words = {axis: axis_of(axis).word for axis in COMMANDS}
    return [
        f"loop of {words[one.axis]}: {one.figure} off by {one.off:+.2f}, bar {one.bar:g}"
        for one in table
        if not one.met
    ]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("logs", type=Path, nargs="+", metavar="LOG")
    parser.add_argument("--heli", action="store_true", help="ArduPilot's own helicopter flew")
    options = parser.parse_args(arguments)
    missed = [bar for log in options.logs for bar in judged(log, own=options.heli)]
    print(*(f"missed: {one}" for one in missed), sep="\n")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
