"""Proof of the new gains of `helisim tune LOG`: flown, beside their prediction and the old ones.

An unmodified ArduCopter-heli flies the vehicle with parameters to begin with (the vehicle's own, or
`--start`, such as those AutoTune leaves), sweeps roll, pitch and yaw to 24 Hz, and hovers in gusts
of 5 m/s, moderate turbulence, seed by seed. Its logs give new gains, with which it flies the same.
Bars: margins within 0.5 dB and 3 degrees of those predicted, DRB within 5 %, the error in gusts by
a tenth; DRB and that of attitude alone 1.25 times those before, or as much where margins were too
small ("too hot before"); roll's and pitch's error a quarter less, noise at most half more. Exit 1.

`--vehicle heli` and `heli-blade360` are ArduPilot's own simulated helicopters: parameters are added
to its copter-heli.parm, and the seed turns the wind, 5 m/s with SIM_WIND_TURB 2, by 72 degrees.

    HELISIM_ARDUPILOT=.../arducopter-heli python scripts/proof/tune_study.py FOLDER

Flights whose logs are in FOLDER already are not flown again.
"""

import sys
from pathlib import Path

import ardupilots_helicopter as own
import common
import numpy as np

import helisim as hs
from helisim.cli import main as command
from helisim.handling.predicted import ATTITUDE_DRB
from helisim.look.loops import flown_loops
from helisim.sitl.gains import STANDARD
from helisim.sitl.pilot import Pilot, Steps
from helisim.study.log_tune import AxisTuning, LogTuning, tune_log

AXES = {"lat": "Roll", "lon": "Pitch", "ped": "Yaw"}
BARS = {"gain_margin": 0.5, "phase_margin": 3.0, "DRP": 0.5}  # dB, degrees, dB
RATIO, BETTER, LESS, FORETOLD, LOUDER = 0.05, 1.25, 0.75, 0.1, 1.5
_SWEEPS = ("--script", "sysid,stop_hz=24", "--axes", "roll,pitch,yaw")
_SETTLES, _LASTS, _SLOWEST = 3.0, 57.0, 0.1  # s of the hover that are judged; Hz


def fly(pilot: Pilot) -> Steps:
    """Hover; `helisim sitl --script` calls it."""
    yield from pilot.take_off(10.0)
    yield from pilot.wait(60.0)
    yield from pilot.land()


def flown(folder: Path, name: str, vehicle: str, parameters: str, seed: int = 0) -> Path:
    """Return the log of sweeps, or of a hover in gusts of a seed, flown if it is not there."""
    log, parm = folder / f"{name}.bin", folder / f"{name}.parm"
    if log.is_file():
        return log
    parm.write_text(parameters, encoding="utf-8")
    print(f"{name} is flown", flush=True)
    if vehicle in own.SWEPT:
        if seed:
            wind = f"\nSIM_WIND_SPD 5\nSIM_WIND_TURB 2\nSIM_WIND_DIR {72 * seed}"
            own.fly(log, vehicle, fly, parameters + wind)
        else:
            band = own.SWEPT[vehicle][0], 24.0
            own.fly(log, vehicle, lambda one: own.swept(one, *band, own.AXES[:3]), parameters)
        return log
    gusts = "--script", __file__, "--wind", "5", "--turbulence", "moderate", "--seed", str(seed)
    words = ["sitl", "--vehicle", vehicle, "--parm", str(parm), "--log", str(log), "--quiet"]
    failed = command([*words, *(gusts if seed else _SWEEPS)])
    if failed and not (seed and log.is_file()):  # gusts and poor gains end a landing, not a hover
        sys.exit(f"{name} was not flown to its end")
    return log


def too_hot(axis: AxisTuning) -> bool:
    """Return whether today's margins of an axis are below those that are required of new gains."""
    gain, phase, peak = (axis.today[name].value for name in BARS)
    required = STANDARD
    return gain < required.gain or phase < np.degrees(required.phase) or peak > required.peak


def error_in_gusts(log: Path) -> dict[str, float]:
    """Return the rms of attitude less its target, deg, of a hover, faster than 0.1 Hz, by axis."""
    data = hs.DataFlash(log)
    angles, places = data.table("ANG"), data.table("POS")
    high = np.asarray(places["RelHomeAlt"], float) > 9.0
    begins = places.time[np.argmax(high)] + _SETTLES
    if angles.time[-1] < begins + _LASTS:
        sys.exit(f"{log} ends in the hover")
    here = (angles.time > begins) & (angles.time < begins + _LASTS)
    off = {
        axis: np.asarray(angles[f"Des{word}"], float)[here] - np.asarray(angles[word], float)[here]
        for axis, word in AXES.items()
    }
    slow, count = round(_SLOWEST * _LASTS), np.count_nonzero(here)
    lines = {axis: np.fft.rfft((one + 180.0) % 360.0 - 180.0) for axis, one in off.items()}
    sizes = {axis: np.linalg.norm(one[slow:]) for axis, one in lines.items()}
    return {axis: float(one * np.sqrt(2.0) / count) for axis, one in sizes.items()}


def predicted(found: LogTuning, log: Path) -> list[str]:
    """Print figures of new gains as predicted and as flown; return the bars that are missed."""
    shown, missed, rows = flown_loops(log).margins(), [], []
    for one in found.axes:
        for name, value in one.tuned.items():
            there = [f.interval for f in shown.figures if (f.axis, f.name) == (one.axis, name)]
            if not there or not np.isfinite(there[0].high - there[0].low):
                continue
            off, bar = value.value - there[0].value, BARS.get(name)
            if name == "DRB":
                off, bar = off / there[0].value, RATIO
            mark = "  missed" if bar and abs(off) > bar else ""
            missed += [f"{one.axis} {name} off by {off:+.3g}"] if mark else []
            rows.append((one.axis, name, value.value, there[0].value, off, mark))
    common.table("axis:<6|figure:<14|predicted:12.2f|flown:10.2f|off:+10.3f|:<8", rows)
    return missed


def main(folder: Path, *, vehicle: str = "jr700", start: str = "", seeds: int = 5) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    if not start and vehicle not in own.SWEPT:
        start = str(hs.model_folder(vehicle) / f"{vehicle}.parm")
    before = Path(start).read_text(encoding="utf-8") if start else ""

    def hovers(name: str, parameters: str) -> list[Path]:
        each = range(1, seeds + 1)
        return [flown(folder, f"{name}_gusts_{k}", vehicle, parameters, k) for k in each]

    gusts = hovers("before", before)
    found = tune_log([flown(folder, "before", vehicle, before), *gusts])
    new = f"{before}\n{found.parameters.text}"
    missed, rows = predicted(found, flown(folder, "new", vehicle, new)), []
    for one in found.axes:
        missed += [] if one.tuned else [f"{one.axis}: {one.why}"]
        hot = too_hot(one)
        for name in ("DRB", ATTITUDE_DRB) if one.tuned else ():
            was, now = one.today[name].value, one.tuned[name].value
            short = now < (1.0 if hot else BETTER) * was
            missed += [f"{one.axis} {name} {now / was:.2f} times"] if short else []
            rows.append((one.axis, name, was, now, now / was, "  too hot before" if hot else ""))
        rows.append((one.axis, "noise", 1.0, one.noise, one.noise, ""))
        missed += [f"{one.axis}: noise {one.noise:.2f} times"] if one.noise > LOUDER else []
    common.table("axis:<6|figure:<14|before:10.2f|new:10.2f|ratio:8.2f|:<16", rows)
    logs, rows = (gusts, hovers("new", new)), []
    errors = [[error_in_gusts(log) for log in each] for each in logs]
    for one in found.axes if seeds else ():
        old, now = (np.mean([error[one.axis] for error in each]) for each in errors)
        rows.append((AXES[one.axis], old, now, now / old, one.gusts if one.tuned else 1.0))
        if one.axis != "ped" and now > LESS * old:
            missed.append(f"{AXES[one.axis]}'s error {now / old:.2f} times")
        if abs(now / old - rows[-1][-1]) > FORETOLD:
            missed.append(f"{AXES[one.axis]}'s error isn't {rows[-1][-1]:.2f} times")
    common.table("in gusts:<10|before, deg:14.3f|new:10.3f|ratio:8.2f|predicted:12.2f", rows)
    print(*found.remarks, *(f"missed: {one}" for one in missed), sep="\n")
    return int(bool(missed))


if __name__ == "__main__":
    common.run(main)
