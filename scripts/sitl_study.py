"""What a log of ArduPilot's mode SystemID tells of a helicopter, beside the truth.

`helisim identify LOG`, with nothing else, on two kinds of flights by an unmodified ArduCopter-heli:

- of the JR700, whose rotor keeps its speed (`--set drive.governor=ideal`), as in the structures:
  the truth is the exact linearisation of the vehicle that flew, in ArduPilot's units (its mixer's
  outputs -1 to 1, throttle 0 to 1) by its mixer, the pulses and our swashplate;
- of ArduPilot's own simulated helicopter, an outside truth: the coefficients that its public source
  states (ArduPilot, libraries/SITL/SIM_Helicopter.cpp; those of its Blade 360 are Walker's and
  Tischler's, VFS Forum 77, 2021), in the same units.

And `helisim margins LOG` on a flight of the JR700 whose sweeps go to 24 Hz, beside the exact loops:
what `scripts/proof/flown_loops.py` prints.

A bound is the Cramér-Rao bound that is printed beside a value. Delays are no derivatives, and are
left out. The exit status is 1 if a bar is missed.

    python scripts/sitl_study.py --jr700 jr700.bin --heli heli.bin     what is left out isn't judged
    python scripts/sitl_study.py --loops loops.bin
    python scripts/sitl_study.py --fly FOLDER                          all are flown, some minutes

What is flown needs ArduCopter-heli, which `HELISIM_ARDUPILOT` names; the logs stay in FOLDER.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "proof"))
import flown_loops

from helisim.base.files import read_toml
from helisim.ident import load_fit
from helisim.logs.dataflash import DataFlash
from helisim.sitl import Aircraft
from helisim.sitl.mixing import Mixer, command_scale

JR700 = "jr700"
BARS = {JR700: 2.0, "heli": 3.0, "heli-blade360": 3.0}
"""Whose log -> largest median error, percent."""
LARGEST = {JR700: 3.0}
"""Whose log -> largest error of a derivative, percent."""
INSIDE = 95.0  # Percent of the derivatives that are inside their bounds, at least.
AXES = ("lat", "lon", "ped", "col")
_OWN_HELICOPTER = Path(__file__).parent / "proof" / "ardupilots_helicopter.py"
LOOPS = "loops"  # The flight of the JR700 whose sweeps go beyond its gain margins.


SOURCES = read_toml(Path(__file__).with_suffix(".toml"))
"""Coefficients of ArduPilot's own helicopters, as its source has them."""


class Row(NamedTuple):
    """One derivative: identified, its bound and standard error, and the truth."""

    name: str
    unit: str
    value: float
    bound: float
    deviation: float
    truth: float

    @property
    def error(self) -> float:
        return 100.0 * (self.value / self.truth - 1.0)

    @property
    def inside(self) -> bool:
        return abs(self.value - self.truth) <= self.bound

    def __str__(self) -> str:
        mark = "" if self.inside else "  outside"
        return (
            f"{self.name:<8}{self.unit:<8}{self.value:>12.5g}{self.truth:>12.5g}{self.error:>9.2f}"
            f"{100.0 * self.bound / abs(self.value):>9.2f}"
            f"{100.0 * self.deviation / abs(self.value):>9.2f}{mark}"
        )


def identified(log: Path) -> dict[str, tuple[float, float, float, str]]:
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder, "model.json")
        command = [sys.executable, "-m", "helisim", "identify", str(log), "--quiet"]
        command += ["--json", str(model)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1, 3):  # 1 and 3 are fits that it finds wrong or doubtful
            sys.exit(done.stderr.strip())
        fits = [load_fit(path) for path in sorted(model.parent.glob("*.json"))]
    return {
        name: (one.value, one.cramer_rao, one.standard_error, one.definition.unit)
        for fit in fits
        for name, one in fit.parameters.items()
        if not one.definition.fixed  # assumed, not found
    }


def exact_jr700(parameters: Mapping[str, float], hover: float) -> dict[str, float]:
    aircraft = Aircraft(JR700)
    vehicle = aircraft.vehicle
    scale = command_scale(Mixer(parameters), aircraft.outputs, vehicle.swashplate, hover)
    by = dict(zip(("col", "lon", "lat", "ped"), np.diag(scale)))  # by the autopilot's
    own = vehicle.derivatives.items()
    return {name: value * by.get(name.partition("_")[2], 1.0) for name, value in own}


def stated(
    source: Mapping[str, float], parameters: Mapping[str, float], hover: float
) -> dict[str, float]:
    mixer = Mixer(parameters)

    def moved(axis: str) -> np.ndarray:
        at = {"col": hover, "ped": 0.1}
        ends = []
        for step in (1e-3, -1e-3):
            pulses = mixer.exact({**at, axis: at.get(axis, 0.0) + step})
            s = [(pulses[channel] - 1000.0) / 1000.0 for channel in (1, 2, 3, 4)]
            roll, pitch = 1.283 * (s[0] - s[1]), 1.48 * ((s[0] + s[1]) / 2.0 - s[2])
            less = source["less_cyclic"]
            ends.append((roll / less, pitch / less, 2.0 * source["yaw"] * s[3], sum(s[:3]) / 3.0))
        return (np.array(ends[0]) - ends[1]) / 2e-3

    lat, lon, ped, col = map(moved, AXES)
    return {
        **{name: source[name] for name in ("tau_f", "L_b", "M_a", "A_b", "B_a", "N_r", "Z_w")},
        **{
            f"{tilt}_{axis}": source[f"{moment}flt"] * by[0] + source[f"{moment}flg"] * by[1]
            for tilt, moment in (("A", "M"), ("B", "L"))
            for axis, by in (("lat", lat), ("lon", lon))
        },
        "N_ped": source["N_ped"] * ped[2],
        "Z_col": source["Z_col"] * col[3],
    }


def rows(whose: str, log: Path) -> list[Row]:
    flown = DataFlash(log)
    parameters, sweeps = flown.parameters(), flown.table("SIDD").time
    hover = flown_loops.throttle(flown, sweeps[0], sweeps[-1])
    found = identified(log)
    mine = whose == JR700
    true = exact_jr700(parameters, hover) if mine else stated(SOURCES[whose], parameters, hover)
    return [
        Row(name, unit, value, bound, deviation, true[name])
        for name, (value, bound, deviation, unit) in found.items()
        if name in true
    ]


def judged(whose: str, log: Path) -> list[str]:
    table = rows(whose, log)
    if not table:
        sys.exit(f"{log}: no derivative of {whose} is identified")
    print(f"\n{whose}: {log}")
    headings = ("identified", "truth", "error %", "bound %", "std. %")
    print(f"{'':<16}" + "".join(f"{one:>{12 if k < 2 else 9}}" for k, one in enumerate(headings)))
    print(*table, sep="\n")
    errors = [abs(one.error) for one in table]
    error, largest = median(errors), max(errors)
    inside = 100.0 * sum(one.inside for one in table) / len(table)
    near = sum(abs(one.value - one.truth) <= 2.0 * one.deviation for one in table)
    print(
        f"median error {error:.2f} % (bar {BARS[whose]:g}), largest {largest:.2f} %; inside their "
        f"bounds {inside:.0f} % (bar {INSIDE:g}); within two standard errors {near} of {len(table)}"
    )
    bars = (
        (error - BARS[whose], f"median error {error:.2f} %", BARS[whose]),
        (largest - LARGEST.get(whose, np.inf), f"largest error {largest:.2f} %", LARGEST[JR700]),
        (INSIDE - inside, f"{inside:.0f} % inside their bounds", INSIDE),
    )
    return [f"{whose}: {what}, bar {bar:g} %" for over, what, bar in bars if over > 0.0]


def flown(whose: str, log: Path) -> Path:
    if whose in (JR700, LOOPS):
        script = "sysid,stop_hz=24" if whose == LOOPS else "sysid"
        axes = "roll,pitch,yaw,thrust" if whose == JR700 else "roll,pitch,yaw"
        sweeps = ["--script", script, "--axes", axes, "--log", str(log)]
        governor = ["--set", "drive.governor=ideal"] if whose == JR700 else []
        command = [sys.executable, "-m", "helisim", "sitl", "--vehicle", JR700, *sweeps, *governor]
    else:
        command = [sys.executable, str(_OWN_HELICOPTER), str(log), whose]
    print(f"{whose} is flown", flush=True)
    if subprocess.run(command, check=False).returncode:
        sys.exit(f"{whose} was not flown to its end")
    return log


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    for whose in BARS:
        parser.add_argument(f"--{whose}", type=Path, nargs="+", default=[], metavar="LOG")
    parser.add_argument(f"--{LOOPS}", type=Path, nargs="+", default=[], metavar="LOG")
    parser.add_argument("--fly", type=Path, metavar="FOLDER", help="fly them first, logs to here")
    options = vars(parser.parse_args(arguments))
    logs: dict[str, list[Path]] = {
        whose: options[whose.replace("-", "_")] for whose in (*BARS, LOOPS)
    }
    if (folder := options["fly"]) is not None:
        folder.mkdir(parents=True, exist_ok=True)
        for whose in (JR700, "heli", LOOPS):
            logs[whose].append(flown(whose, folder / f"{whose}.bin"))
    if not any(logs.values()):
        parser.error("no log is named, and nothing is to be flown")
    missed = [bar for whose in BARS for log in logs[whose] for bar in judged(whose, log)]
    if logs[LOOPS] and flown_loops.main([str(log) for log in logs[LOOPS]]):
        missed.append("figures of loops, above")
    print(*(f"missed: {one}" for one in missed), sep="\n")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
