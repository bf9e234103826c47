"""What a log of ArduPilot's mode SystemID tells of a helicopter, beside the truth.

`helisim identify LOG`, with nothing else, on flights by an unmodified ArduCopter-heli, of

- the JR700 at constant rotor speed (`--set drive.governor=ideal`), as the structures have it: the
  truth is the exact linearisation of the vehicle that flew, in ArduPilot's units (its mixer's
  outputs -1 to 1, throttle 0 to 1) by its mixer, the pulses and our swashplate;
- ArduPilot's own simulated helicopters, as their steps have what its public source states (in
  libraries/SITL; the Blade 360's by Walker and Tischler, VFS Forum 77): a truth is what is stated,
  times what the same fits find of exact responses with these steps over those without.

Bounds are Cramér-Rao bounds as printed; delays are left out. And `helisim margins LOG` beside the
exact loops: ArduCopter's law by the log's parameters, and the vehicle that flew, motor and all,
linearised exactly, at ticks for which pulses are held; the tail's go out a tick later. Crossover
and DRB are judged by how many dB the exact curve misses 0 or -3 dB where the measured one has them,
curves where 0.1 < |L| < 10 and roll or pitch move by 0.04 degrees: ArduPilot doesn't feed back less
than twice the first step of an arccosine in single precision, the root of 2^-23.

    python scripts/sitl_study.py --jr700 jr700.bin --heli-blade360 b.bin     not all are needed
    python scripts/sitl_study.py --loops loops.bin --heli-loops heli.bin
    python scripts/sitl_study.py --fly FOLDER                          all are flown, some minutes

ArduCopter-heli, which `HELISIM_ARDUPILOT` names, flies; the logs stay in FOLDER. Status 1: a bar is
missed, or a figure was not measured.
"""

import math
import sys
import tempfile
from collections import namedtuple
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "proof"))
import ardupilots_helicopter as heli_flights
import common

import helisim as hs
from helisim.base.files import read_toml
from helisim.base.linear import Linear, LinearSystem
from helisim.base.units import STANDARD_GRAVITY
from helisim.cli import main as command
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import HALF_POWER, margins, rejection
from helisim.handling.loop import axis_of
from helisim.handling.measured.interval import Interval
from helisim.look.loops import FlownLoops, flown_law, flown_loops
from helisim.records.record import ATTITUDES, IN1, RATES
from helisim.sitl import Aircraft
from helisim.sitl.mixing import Mixer, command_scale

JR700, HELI, BLADE, LOOPS = "jr700", "heli", "heli-blade360", "loops"
BARS = {JR700: 2.0, HELI: 3.0, BLADE: 3.0}  # whose log -> largest median error, %
LARGEST = {JR700: 3.0, HELI: 3.0}  # whose log -> largest error of any derivative, %
INSIDE, NEAR = 95.0, 0.9  # %, and share: inside their bounds, within two standard errors, at least
DECIBEL, DEGREES, _JUDGED = 0.5, 3.0, 10.0  # Bars of loops; |L| to 1, or 1 to it, up to which.
_MOVES = 2.0 * math.sqrt(2.0**-23)  # rad, two steps of the arccosine
FLIGHTS = {
    JR700: "--script sysid --axes roll,pitch,yaw,thrust --set drive.governor=ideal",
    LOOPS: "--script sysid,stop_hz=24 --axes roll,pitch,yaw",
}
SOURCES = read_toml(Path(__file__).with_suffix(".toml"))  # coefficients, as ArduPilot's has them
OUTPUTS = (*RATES, *ATTITUDES)


def commanded(parameters: Mapping[str, float], hover: float) -> tuple[hs.Vehicle, np.ndarray]:
    """Return the JR700 that flew, and its inputs by commands, as `IN1`; `hover` is their col."""
    aircraft = Aircraft(JR700)
    plate = aircraft.vehicle.swashplate
    return aircraft.vehicle, command_scale(Mixer(parameters), aircraft.outputs, plate, hover)


def exact_jr700(parameters: Mapping[str, float], hover: float) -> dict[str, float]:
    """Return the derivatives of the JR700 by ArduPilot's commands."""
    vehicle, scale = commanded(parameters, hover)
    by, own = dict(zip(IN1, np.diag(scale))), vehicle.derivatives.items()
    return {name: value * by.get(name.partition("_")[2], 1.0) for name, value in own}


def exact_plant(parameters: Mapping[str, float], hover: float, period: float) -> LinearSystem:
    """Return the JR700 that flew at ticks of a period (s), by ArduPilot's commands."""
    vehicle, scale = commanded(parameters, hover)
    linear = vehicle.linearize().select(IN1, OUTPUTS)
    by = scale[:, [IN1.index(name) for name in COMMANDS]]
    direct = np.zeros((len(OUTPUTS), len(COMMANDS)))
    own = LinearSystem(linear.a, linear.b @ by, linear.c, direct, None, COMMANDS, OUTPUTS)
    return replace(own.discretise(period), delays={"ped": period})


def stated(
    source: Mapping[str, float], parameters: Mapping[str, float], hover: float
) -> dict[str, float]:
    """Return the derivatives that ArduPilot's source states, by its commands."""
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

    lat, lon, ped, col = map(moved, ("lat", "lon", "ped", "col"))
    return {
        **source,
        **{
            f"{tilt}_{axis}": source[f"{moment}flt"] * by[0] + source[f"{moment}flg"] * by[1]
            for tilt, moment in (("A", "M"), ("B", "L"))
            for axis, by in (("lat", lat), ("lon", lon))
        },
        "N_ped": source["N_ped"] * ped[2],
        "Z_col": source["Z_col"] * col[3],
    }


_FRAME = 833e-6  # s, of ArduPilot's own helicopters' frames: 1200 a second, in whole microseconds
_FRAMES, _TICK, _FOLLOWS = 3, 3 * _FRAME, 0.1  # in a tick; s; s, within which sensors follow
_AGE = _FRAME / 6.0  # s: its gyro is sampled 1000 times a second, at five of six frames
_LEAN, _G = np.radians(3.2), STANDARD_GRAVITY  # rad, with which it hovers


def ardupilots_helicopter(parameters: Mapping[str, float], whose=HELI, parts=1) -> LinearSystem:
    """Return one of ArduPilot's own simulated helicopters at the autopilot's ticks.

    It is integrated by Euler's method, each frame: the rotor's tilts by the rates before, the rates
    by the new tilts, then attitudes, speeds and places. Its sensors are those of a second body that
    follows it within 0.1 s by the same method: above 10 rad/s they feel 0.8 % more, a frame over
    0.1 s. Frames in `parts` take both away. How collective turns it isn't in it.
    """
    true, frame = stated(SOURCES[whose], parameters, 0.5), _FRAME / parts
    flaps = np.array([[-1.0, true["B_a"]], [true["A_b"], -1.0]]) / true["tau_f"]
    cyclic = np.array([[true[f"{x}_{by}"] for by in ("lat", "lon")] for x in "BA"]) / true["tau_f"]
    pushes = np.array([[true.get(f"{x}_{by}", 0.0) for by in "uvw"] for x in "LMNXYZ"])
    moved, sine, cosine = np.array((true["L_b"], true["M_a"])), np.sin(_LEAN), np.cos(_LEAN)
    turned = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])

    def step(states: np.ndarray, commands: np.ndarray) -> np.ndarray:
        tilts, lat_lon, (ped, col) = states[:2], commands[:2], commands[2:]
        rates, angles, speed, felt_angles, felt_speed, behind = states[2:].reshape(6, 3)
        before = felt_speed[2]
        for _ in range(_FRAMES * parts):
            tilts = tilts + frame * (flaps @ tilts + cyclic @ lat_lon - rates[:2])
            tail = true["N_r"] * rates[2] + true["N_ped"] * ped
            moments, forces = np.split(pushes @ speed, 2)
            forces += 0.0, true["Y_p"] * rates[0] - true["side"] * tail, true["Z_col"] * col
            rates = rates + frame * (moments + np.array((*moved * tilts, tail)))
            angles = angles + frame * turned @ rates
            forces += -_G * (tilts[1] + angles[1]), _G * (tilts[0] + angles[0]), 0.0
            speed = speed + frame * forces
            felt = rates + turned.T @ (angles - felt_angles) / _FOLLOWS
            felt_angles = felt_angles + frame * turned @ felt
            behind = behind + frame * speed
            follows = forces + (speed - felt_speed + behind / _FOLLOWS) / _FOLLOWS
            felt_speed = felt_speed + frame * follows
            behind = behind - frame * felt_speed
        own = tilts, rates, angles, speed, felt_angles, felt_speed, behind
        return np.hstack((*own, felt, felt_angles, (felt_speed[2] - before) / _TICK))

    inputs, late = (*COMMANDS, "col"), true["delay"] // _FRAME
    return replace(
        LinearSystem.of_steps(step, 20, _TICK, inputs, (*OUTPUTS, "az")),
        delays={name: _FRAME * (late + _FRAMES * (name == "ped")) for name in inputs},
        output_delays={name: _TICK + _AGE * (name in RATES) for name in (*OUTPUTS, "az")},
    )


def as_stepped(fits: list[hs.Fit], parameters: Mapping[str, float], whose: str) -> dict[str, float]:
    """Return how many times as much the same fits find for its steps, by the exact responses."""
    found, plants = {}, [ardupilots_helicopter(parameters, whose, parts) for parts in (1, 16)]
    for fit in fits:
        data, how = fit.data, {"band": fit.bands, "responses": [*fit.bands]}
        own = (one.select(data.inputs, data.outputs).response(data.frequency) for one in plants)
        exact = (replace(data, response=one, direct=None) for one in own)
        stepped, smooth = (hs.identify(one, fit.structure, **how).values for one in exact)
        found |= {name: stepped[name] / value for name, value in smooth.items() if value}
    return found


Derivative = namedtuple("Derivative", "name unit value bound deviation stated truth error")
"""One derivative: identified, its bound and error, as stated, the truth, and by how many % off."""


def derivatives(whose: str, log: Path) -> list[Derivative]:
    flown = hs.DataFlash(log)
    parameters, swept = flown.parameters(), flown.table("SIDD").time
    hover = throttle(flown, swept[0], swept[-1])
    mine = whose == JR700
    own = exact_jr700(parameters, hover) if mine else stated(SOURCES[whose], parameters, hover)
    with tempfile.TemporaryDirectory() as folder:
        words = ["identify", str(log), "--quiet", "--json", str(Path(folder, "model.json"))]
        with redirect_stdout(StringIO()):
            status = command(words)
        if status not in (0, 1, 3):  # 1 and 3 are fits that it finds wrong or doubtful
            sys.exit(f"{log} is not identified")
        fits = [hs.load_fit(path) for path in sorted(Path(folder).glob("*.json"))]
    stepped = {} if mine else as_stepped(fits, parameters, whose)
    true = {name: value * stepped.get(name, 1.0) for name, value in own.items()}
    return [
        Derivative(
            *(name, one.unit, one.value, one.cramer_rao, one.standard_error, own[name], true[name]),
            error=100.0 * (one.value / true[name] - 1.0),
        )
        for name, one in {name: one for fit in fits for name, one in fit.parameters.items()}.items()
        if name in true and not one.fixed  # assumed, not found
    ]


def judged(whose: str, log: Path) -> list[str]:
    found = derivatives(whose, log)
    if not found:
        sys.exit(f"{log}: no derivative of {whose} is identified")
    print(f"\n{whose}: {log}")
    common.table(
        ":<7|:<8|found:11.5g|stated:11.5g|truth:11.5g|error %:9.2f|bound %:9.2f|std. %:8.2f|:<9",
        (
            (*one[:3], one.stated, one.truth, one.error, 100.0 * one.bound / abs(one.value),
             100.0 * one.deviation / abs(one.value),
             "" if abs(one.value - one.truth) <= one.bound else "  outside")
            for one in found
        ),
    )  # fmt: skip
    errors = [abs(one.error) for one in found]
    error, largest, most = median(errors), max(errors), LARGEST.get(whose, math.inf)
    inside = 100.0 * sum(abs(one.value - one.truth) <= one.bound for one in found) / len(found)
    near = [abs(one.value - one.truth) <= 2.0 * one.deviation for one in found]
    bars = {
        f"median error {error:.2f} % (bar {BARS[whose]:g})": error > BARS[whose],
        f"largest {largest:.2f} % (bar {most:g})": largest > most,
        f"inside their bounds {inside:.0f} % (bar {INSIDE:g})": inside < INSIDE,
        f"within two standard errors {sum(near)} of {len(near)} (bar {NEAR:.0%})": np.mean(near)
        < NEAR,
    }
    print(*bars, sep=", ")
    return [f"{whose}: {what}" for what, missed in bars.items() if missed]


Figure = namedtuple("Figure", "axis figure value low high exact unit off bar")
"""A loop's figure: measured, its 95 % interval, exact, by how much it is off, and the bar."""


def figures(flown: FlownLoops, plant: Linear, law: ArduCopterLaw) -> list[Figure]:
    found, rows = flown.margins(), []
    sizes = {one.names[-1]: float(np.ptp(one[one.names[0]])) / 2.0 for one in flown.records}
    measured = {(one.axis, one.name): one.interval for one in found.figures}
    for axis in found.loop.axes:
        curve = found.loop.broken(axis)
        fine = ClosedLoop(plant, law, np.geomspace(*curve.frequency[[0, -1]], 2000))
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
            rows.append(Figure(axis, name, own.value, own.low, own.high, true, unit, off, bar))
        same = ClosedLoop(plant, law, curve.frequency)
        true, moved = same.broken(axis).response, np.abs(same.turned(axis, axis).response)
        near = np.abs(np.log(np.abs(true))) < np.log(_JUDGED)
        near &= (axis == "ped") | (sizes[axis] * moved > _MOVES)
        ratio, at = curve.response[near] / true[near], curve.frequency[near]
        decibel, degrees = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
        for name, off, bar in ("|L|, worst at", decibel, DECIBEL), ("its phase", degrees, DEGREES):
            worst = int(np.argmax(np.abs(off)))
            where = at[worst], at[0], at[-1]
            rows.append(Figure(axis, name, *where, np.nan, "rad/s", off[worst], bar))
    return rows


def throttle(log: hs.DataFlash, start: float, stop: float) -> float:
    """Return the median throttle, 0 to 1, between two times of a log, s."""
    table = log.table("RATE")
    between = (table.time >= start) & (table.time <= stop)
    return float(np.median(np.asarray(table["AOut"], float)[between]))


def judged_loops(log: Path, *, own: bool) -> list[str]:
    """Print a log's loops beside those of its `own` helicopter or the JR700; return what misses."""
    flown, opened = flown_loops(log), hs.DataFlash(log)
    swept = [sweep for one in flown.logs.values() for sweep in one]
    start, stop = (opened.begins + one for one in (swept[0].start, swept[-1].stop))
    hover, parameters = throttle(opened, start, stop), opened.parameters()
    law = flown_law(opened, start)
    plant = ardupilots_helicopter(parameters) if own else exact_plant(parameters, hover, law.period)
    found = figures(flown, plant.select(COMMANDS, OUTPUTS), law)
    print(f"\nloops as flown: {log}")
    common.table(
        ":<6|:<14|measured:9.3f|95 % from:9.3f|to:9.3f|exact:9.3f| :<7|off:+8.3f|:<12",
        (
            (*one[:6], f" {one.unit}", one.off, f" {'deg' if one.bar == DEGREES else 'dB'}{mark}")
            for one in found
            for mark in ["" if abs(one.off) <= one.bar else "  missed"]
        ),
    )
    exact = [one for one in found if np.isfinite(one.exact)]
    inside = sum(one.low <= one.exact <= one.high for one in exact)
    print(f"{inside} of {len(exact)} exact figures are inside their 95 % intervals")
    return [
        f"loop of {axis_of(one.axis).word}: {one.figure} off by {one.off:+.2f}, bar {one.bar:g}"
        for one in found
        if not abs(one.off) <= one.bar
    ]


def flown(whose: str, log: Path) -> Path:
    print(f"{whose} is flown", flush=True)
    if whose in SOURCES:
        heli_flights.main(log, whose)
    elif command(["sitl", "--vehicle", JR700, *FLIGHTS[whose].split(), "--log", str(log)]):
        sys.exit(f"{whose} was not flown to its end")
    return log


def main(
    *,
    jr700: list[Path] = (),
    heli: list[Path] = (),
    heli_blade360: list[Path] = (),
    loops: list[Path] = (),
    heli_loops: list[Path] = (),
    fly: str = "",
) -> int:
    logs = {JR700: [*jr700], HELI: [*heli], BLADE: [*heli_blade360], LOOPS: [*loops]}
    for whose, some in logs.items() if fly else ():
        Path(fly).mkdir(parents=True, exist_ok=True)
        some.append(flown(whose, Path(fly, f"{whose}.bin")))
    if not any((*logs.values(), heli_loops)):
        sys.exit("no log is named, and nothing is to be flown")
    missed = [bar for whose in BARS for log in logs[whose] for bar in judged(whose, log)]
    for own, some in (False, logs[LOOPS]), (True, heli_loops):
        missed += [bar for log in some for bar in judged_loops(log, own=own)]
    print(*(f"missed: {one}" for one in missed), sep="\n")
    return int(bool(missed))


if __name__ == "__main__":
    common.run(main)
