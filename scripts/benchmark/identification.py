"""Accuracy and speed of the identification beside open peers, on the same records.

Three parts: a small plant, where accuracy is compared; a large one, and a single log, where speed
is.

The plant is Table 3's [IN1 OUT] model (roll and pitch rate over cyclic, delays of 11.5 and
-8.3 ms), flown in four sweeps of 90 s from 1.5 to 45 rad/s, recorded at 100 Hz:

    quiet        open loop, 0.01 rad/s of white noise on the rates
    gusty        open loop, 0.03 rad/s, and a gust that accelerates roll and pitch by 0.5 rad/s^2
                 rms below 6 rad/s each
    closed loop  the same noise and gust, under rate feedback of 0.1 s/rad

In open loop the other axis carries 15 % of the sweep and 0.01 rms of remnant below 20 rad/s; in
closed loop both sticks carry the remnant. Printed are the mean error of the poles, the mean
cost J of the identified against the true response over 3 to 35 rad/s, and the seconds of
processor time from records to model: mean and standard deviation over the seeds.

The large plant is the hover model of tests/recovery, twelve states and 38 parameters in closed
loop: eight sweeps of 100 s at 100 Hz with four inputs and nine outputs. Seconds are processor time
of the frequency response and of the fit, default options, no band.

The single log is 60 s of a first-order plant at 100 Hz as CSV. `helisim identify` and, beside it, a
script that reads the same file with NumPy and identifies it with a peer are run as processes of
their own: imports count. The first run of each is not timed.

Peers (`pip install helisim[benchmark]`) get the four records joined, which is fair as each begins
and ends in trim, decimated to 25 Hz, and the true order: 4.

    python scripts/benchmark/identification.py [SEEDS]
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray
from scipy.signal import decimate

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from fleet import FLEET
from plants import ROLLPITCH_IN1, fly, fly_closed_loop
from recovering import recover

from helisim.ident import frequency_response, identify, structures
from helisim.ident.evaluate import response, state_space
from helisim.records.record import FlightRecord

INPUTS, OUTPUTS, STICKS = ("lat", "lon"), ("p", "q"), ("LAT", "LON")
BAND = (3.0, 35.0)
GRID = np.geomspace(*BAND, 50)
TRUE_RESPONSE = response(structures.rollpitch, ROLLPITCH_IN1, GRID)
TRUE_POLES = state_space(structures.rollpitch, ROLLPITCH_IN1).poles()
PEER_RATE = 25.0
CASES = {"quiet": (0.01, 0.0), "gusty": (0.03, 0.5), "closed loop": (0.03, 0.5)}  # noise, gust

Responses = tuple[NDArray[np.complex128], NDArray[np.complex128]]
"""Poles in 1/s, and response over GRID."""


def flights(case: str, seed: int) -> list[FlightRecord]:
    """Fly the four sweeps of a case."""
    noise, gust = CASES[case]
    options = {"noise": dict.fromkeys(OUTPUTS, noise), "gust": gust}
    if case == "closed loop":
        flown, more = fly_closed_loop, {"sticks": STICKS, "gain": 0.1}
    else:
        flown, more = fly, {"band": (1.5, 45.0), "off_axis": 0.01, "correlated": 0.15}
    return [
        flown(
            structures.rollpitch,
            ROLLPITCH_IN1,
            axis=axis,
            seed=10 * seed + number,
            **options,
            **more,
        )
        for number, axis in enumerate(("lat", "lat", "lon", "lon"))
    ]


def ours(records: Sequence[FlightRecord], reference: Sequence[str] | None) -> Responses:
    """Identify by frequency response: the direct method, or the joint one with references."""
    frf = frequency_response(
        records, inputs=INPUTS, outputs=OUTPUTS, band=BAND, reference=reference
    )
    fit = identify(frf, structures.rollpitch, frequencies_per_response=40)
    return fit.model.poles(), fit.response(GRID).response


def peer(records: Sequence[FlightRecord], method: str) -> Responses:
    """Identify by a subspace method of sippy-unipi."""
    from sippy_unipi import system_identification

    step = round(1.0 / (PEER_RATE * records[0].sample_time))
    columns = np.concatenate([record.select([*OUTPUTS, *INPUTS]) for record in records])
    slow = decimate(columns, step, axis=0, ftype="fir").T
    found = system_identification(slow[:2], slow[2:], method, SS_fixed_order=4, tsample=step * 0.01)
    model = control.StateSpace(found.A, found.B, found.C, found.D, step * 0.01)
    poles = np.log(np.asarray(model.poles(), dtype=np.complex128)) * PEER_RATE
    return poles, np.asarray(control.frequency_response(model, GRID).complex)


def measure(
    method: Callable[..., Responses], flown: Sequence[list[FlightRecord]], *options: object
) -> NDArray[np.float64]:
    """Return pole error (%), J against the true response and CPU time (s), (seeds, 3).

    The pole error is the mean relative distance of the true poles to the nearest found ones; all
    weights of J are 1.
    """
    rows = []
    for records in flown:
        begun = time.process_time()
        poles, found = method(records, *options)
        seconds = time.process_time() - begun
        off = [np.min(np.abs(poles - pole)) / np.abs(pole) for pole in TRUE_POLES]
        ratio = found / TRUE_RESPONSE
        decibel, degree = 20.0 * np.log10(np.abs(ratio)), np.rad2deg(np.angle(ratio))
        cost = 20.0 * float(np.mean(decibel**2 + 0.01745 * degree**2))
        rows.append((100.0 * float(np.mean(off)), cost, seconds))
    return np.array(rows)


def hover(seeds: int) -> None:
    """Print the processor time of the 38-parameter case in closed loop."""
    found = [recover(FLEET["hover"](), seed) for seed in range(seeds)]
    response, fit = (
        [getattr(one, part) for one in found] for part in ("response_seconds", "fit_seconds")
    )
    inside = [one.inside for one in found]
    print("38 parameters in closed loop, processor s, median of the seeds")
    print(
        f"  frequency response {np.median(response):.2f}, fit {np.median(fit):.2f}, "
        f"both {np.median(np.add(response, fit)):.2f}; inside their bounds "
        f"{min(inside)} to {max(inside)} of 38"
    )


PEER_SCRIPT = """
import sys
import numpy as np
from sippy_unipi import system_identification
_, pedal, rate = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1, unpack=True)
model = system_identification(rate, pedal, {order}, tsample=0.01)
print(model.G if hasattr(model, "G") else model.A)
"""
PEER_METHODS = {"ARX": '"ARX", ARX_orders=[1, 1, 1]', "N4SID": '"N4SID", SS_fixed_order=1'}


def one_log(runs: int = 5) -> None:
    """Print the processor time of a first-order model from one log, imports included."""
    truth = {"N_r": -0.75, "N_ped": 76.0, "tau_r_base": 0.02}
    record = fly(
        structures.yaw_base,
        truth,
        axis="ped",
        seed=0,
        duration=60.0,
        band=(0.5, 25.0),
        amplitude=0.02,
        noise={"r": 0.01},
    )
    print("a first-order model from one log, processor s of the process, median of the runs")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "yaw.csv"
        columns = np.column_stack([record.time, record.select(["ped", "r"])])
        np.savetxt(log, columns, delimiter=",", header="time [s],ped [1],r [rad/s]", comments="")
        ours = [sys.executable, "-m", "helisim", "identify", str(log), "--structure", "tf:0/1"]
        ours += ["--inputs", "ped", "--outputs", "r", "--quiet"]
        _row_of_processes("helisim identify", ours, runs)
        for name, order in PEER_METHODS.items():
            code = PEER_SCRIPT.format(order=order)
            _row_of_processes(name, [sys.executable, "-c", code, str(log)], runs)


def _row_of_processes(name: str, command: Sequence[str], runs: int) -> None:
    seconds = [processor_seconds(command) for _ in range(runs + 1)][1:]
    if None in seconds:
        print(f"  {name:<22}      failed: is it installed? pip install helisim[benchmark]")
    else:
        print(f"  {name:<22}{np.median(seconds):8.2f}  {min(seconds):.2f} to {max(seconds):.2f}")


def processor_seconds(command: Sequence[str]) -> float | None:
    """Return a process's own processor time, user and system; None if it failed."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return used.ru_utime + used.ru_stime if process.returncode == 0 else None


def main(seeds: int = 10) -> None:
    """Print the benchmark."""
    one_log()
    hover(min(seeds, 5))
    print(f"mean +- scatter over {seeds} seeds")
    print(f"{'':<24}{'pole error, %':>18}{'J':>14}{'processor s':>26}")
    for case in CASES:
        flown = [flights(case, seed) for seed in range(seeds)]
        print(case)
        methods = [("helisim, direct", ours, None)]
        if case == "closed loop":
            methods.append(("helisim, joint", ours, STICKS))
        methods += [(name, peer, name) for name in ("N4SID", "PARSIM-P", "PARSIM-K")]
        for name, method, option in methods:
            try:
                rows = measure(method, flown, option)
            except ImportError:
                text = "      not installed: pip install helisim[benchmark]"
            except (ValueError, np.linalg.LinAlgError) as error:
                text = f"      failed: {error}"
            else:
                spread = zip(np.mean(rows, axis=0), np.std(rows, axis=0))
                text = "".join(f"{m:11.3g} +- {s:<8.2g}" for m, s in spread)
            print(f"  {name:<22}{text}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
