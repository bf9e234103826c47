"""Proof of the new gains of `helisim tune LOG`: flown, beside their prediction and the old ones.

An unmodified ArduCopter-heli flies the vehicle with parameters to begin with (the vehicle's own, or
`--start`), sweeps roll, pitch and yaw to 24 Hz, and its log gives new gains; with those it sweeps
again, and both hover in gusts of 5 m/s, moderate turbulence, seed by seed. Gains of somebody else
(`--opponent`, a file, such as AutoTune's) are flown likewise, and the new ones held against them.
Bars: margins within 0.5 dB and 3 degrees of those predicted, DRB within 5 %; DRB and that of
attitude alone at least 1.25 times the opponent's, or its own where its margins are too small ("too
hot before"); attitude's error in gusts a quarter less in roll and pitch. Exit status 1: one missed.

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
RATIO, BETTER, LESS = 0.05, 1.25, 0.75
_SWEEPS = ("--script", "sysid,stop_hz=24", "--axes", "roll,pitch,yaw")
_SETTLES, _LASTS = 3.0, 57.0  # s of the hover that are judged, from its beginning


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
    """Return the rms of attitude less its target, deg, of a hover, by axis."""
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
    turned = {axis: (one + 180.0) % 360.0 - 180.0 for axis, one in off.items()}
    return {axis: float(np.sqrt(np.mean(one**2))) for axis, one in turned.items()}


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


def main(
    folder: Path, *, vehicle: str = "jr700", start: str = "", opponent: str = "", seeds: int = 5
) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    if not start and vehicle not in own.SWEPT:
        start = str(hs.model_folder(vehicle) / f"{vehicle}.parm")
    before = Path(start).read_text(encoding="utf-8") if start else ""
    found = tune_log(flown(folder, "before", vehicle, before))
    new = f"{before}\n{found.parameters.text}"
    missed = predicted(found, flown(folder, "new", vehicle, new))
    rival, today = before, found
    if opponent:
        rival = f"{before}\n{Path(opponent).read_text(encoding='utf-8')}"
        today = tune_log(flown(folder, "opponent", vehicle, rival))
    rows = []
    for one, other in zip(found.axes, today.axes):
        missed += [] if one.tuned else [f"{one.axis}: {one.why}"]
        hot = too_hot(other)
        for name in ("DRB", ATTITUDE_DRB) if one.tuned else ():
            ratio = one.tuned[name].value / other.today[name].value
            short = ratio < (1.0 if hot else BETTER)
            missed += [f"{one.axis} {name} {ratio:.2f} times"] if short else []
            was, now = other.today[name].value, one.tuned[name].value
            rows.append((one.axis, name, was, now, ratio, "  too hot before" if hot else ""))
    common.table("axis:<6|figure:<14|before:10.2f|new:10.2f|ratio:8.2f|:<16", rows)
    errors, rows = {"before": [], "new": []}, []
    for seed in range(1, seeds + 1):
        for name, text in (("before", rival), ("new", new)):
            log = flown(folder, f"{name}_gusts_{seed}", vehicle, text, seed)
            errors[name].append(error_in_gusts(log))
    for axis, word in AXES.items() if seeds else ():
        old, now = (np.mean([one[axis] for one in errors[name]]) for name in ("before", "new"))
        rows.append((word, old, now, now / old))
        if word != "Yaw" and now > LESS * old:
            missed.append(f"{word}'s error {now / old:.2f} times")
    common.table("in gusts:<10|before, deg:14.3f|new:10.3f|ratio:8.2f", rows)
    print(*(f"missed: {one}" for one in missed), sep="\n")
    return int(bool(missed))


if __name__ == "__main__":
    common.run(main)
