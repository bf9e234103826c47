"""Accuracy and speed of the identification beside open peers, on the same records.

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

Peers (`pip install helisim[benchmark]`) get the four records joined, which is fair as each begins
and ends in trim, decimated to 25 Hz, and the true order: 4.

    python scripts/benchmark/identification.py [SEEDS]
"""

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import control
import numpy as np
from numpy.typing import NDArray
from scipy.signal import decimate

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from plants import ROLLPITCH_IN1, fly, fly_closed_loop

from helisim.ident import frequency_response, identify, structures
from helisim.ident.evaluate import response, state_space
from helisim.records.record import FlightRecord

INPUTS, OUTPUTS, STICKS = ("lat", "lon"), ("p", "q"), ("LAT", "LON")
BAND = (3.0, 35.0)
GRID = np.geomspace(*BAND, 50)
TRUE_RESPONSE = response(structures.rollpitch, ROLLPITCH_IN1, GRID)
TRUE_POLES = state_space(structures.rollpitch, ROLLPITCH_IN1).poles()
PEER_RATE = 25.0

Responses = tuple[NDArray[np.complex128], NDArray[np.complex128]]
"""Poles in 1/s, and response over GRID."""


def flights(case: str, seed: int) -> list[FlightRecord]:
    """Fly the four sweeps of a case."""
    noise, gust = {"quiet": (0.01, 0.0), "gusty": (0.03, 0.5), "closed loop": (0.03, 0.5)}[case]
    level = {"p": noise, "q": noise}
    records = []
    for number, axis in enumerate(("lat", "lat", "lon", "lon")):
        if case == "closed loop":
            record = fly_closed_loop(
                structures.rollpitch,
                ROLLPITCH_IN1,
                axis=axis,
                sticks=STICKS,
                gain=0.1,
                gust=gust,
                seed=10 * seed + number,
                noise=level,
            )
        else:
            record = fly(
                structures.rollpitch,
                ROLLPITCH_IN1,
                axis=axis,
                seed=10 * seed + number,
                band=(1.5, 45.0),
                off_axis=0.01,
                correlated=0.15,
                noise=level,
                gust=gust,
            )
        records.append(record)
    return records


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


def pole_error(poles: NDArray[np.complex128]) -> float:
    """Return the mean relative distance of the true poles to the nearest found ones, percent."""
    distance = [np.min(np.abs(poles - pole)) / np.abs(pole) for pole in TRUE_POLES]
    return 100.0 * float(np.mean(distance))


def cost(found: NDArray[np.complex128]) -> float:
    """Return the mean J of a response against the true one, all weights 1."""
    ratio = found / TRUE_RESPONSE
    decibel, degree = 20.0 * np.log10(np.abs(ratio)), np.rad2deg(np.angle(ratio))
    return 20.0 * float(np.mean(decibel**2 + 0.01745 * degree**2))


def measure(method: Callable[[int], Responses], seeds: int) -> NDArray[np.float64]:
    """Return pole error (%), J and processor seconds of a method, (seeds, 3)."""
    rows = []
    for seed in range(seeds):
        begun = time.process_time()
        poles, found = method(seed)
        seconds = time.process_time() - begun
        rows.append((pole_error(poles), cost(found), seconds))
    return np.array(rows)


def row(name: str, method: Callable[[int], Responses], seeds: int) -> None:
    """Print the accuracy and the time of a method over the seeds."""
    rows = measure(method, seeds)
    mean, spread = np.mean(rows, axis=0), np.std(rows, axis=0)
    text = "".join(f"{m:11.3g} +- {s:<8.2g}" for m, s in zip(mean, spread))
    print(f"  {name:<22}{text}", flush=True)


def main(seeds: int = 10) -> None:
    """Print the benchmark."""
    print(f"mean +- scatter over {seeds} seeds")
    print(f"{'':<24}{'pole error, %':>18}{'J':>14}{'processor s':>26}")
    for case in ("quiet", "gusty", "closed loop"):
        flown = [flights(case, seed) for seed in range(seeds)]
        print(case)
        row("helisim, direct", lambda k, f=flown: ours(f[k], None), seeds)
        if case == "closed loop":
            row("helisim, joint", lambda k, f=flown: ours(f[k], STICKS), seeds)
        for method in ("N4SID", "PARSIM-P", "PARSIM-K"):
            try:
                row(method, lambda k, f=flown, m=method: peer(f[k], m), seeds)
            except ImportError:
                print(f"  {method:<22}      not installed: pip install helisim[benchmark]")
            except (ValueError, np.linalg.LinAlgError) as error:
                print(f"  {method:<22}      failed: {error}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
