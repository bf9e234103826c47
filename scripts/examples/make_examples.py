"""Fly and write the logs that come with helisim: python scripts/examples/make_examples.py [FOLDER].

Four sweeps of the JR700, one an axis, from which its models can be identified; two doublets that
no fit has seen; and a second lateral sweep as another logger writes it. Recorded at 50 Hz with the
resolution of a small flight computer, which is what keeps the files small. The same versions of
all that provenance names give the same bytes.
"""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import helisim as hs
from helisim.base.files import atomic_write
from helisim.logs.examples import FOLDER
from helisim.records import record as channels

# Hz: seven samples to the period of 42 rad/s, the highest frequency of the roll-pitch fit.
RATE, ANTIALIAS, DURATION = 50.0, 20.0, 45.0
SEED, LOGGER_SEED = 11, 13
RESOLUTION = {
    **dict.fromkeys((*channels.SERVOS, *channels.IN2), 0.001),
    **dict.fromkeys(channels.RATES, 0.002),
    **dict.fromkeys(channels.ATTITUDES, 0.001),
    **dict.fromkeys(channels.VELOCITIES, 0.01),
    **dict.fromkeys(channels.ACCELERATIONS, 0.05),
    **dict.fromkeys(channels.POSITIONS, 0.01),
}
"""In the channels' units: below the recorder's noise, a fraction of it."""
KEPT = (*channels.IN1, *channels.IN2, *channels.RATES, *channels.ATTITUDES, *channels.VELOCITIES)

UNITS = {"percent": 100.0, "deg/s": 180.0 / np.pi}
"""Of the logger's columns, in SI units."""
COLUMNS = {
    "aileron_stick_pct": ("LAT", "percent", 1, 1),
    "elevator_stick_pct": ("LON", "percent", -1, 1),
    "swash_roll_pct": ("lat", "percent", 1, 2),
    "swash_pitch_pct": ("lon", "percent", -1, 2),
    "gyro_x_dps": ("p", "deg/s", 1, 1),
    "gyro_y_dps": ("q", "deg/s", 1, 1),
}
"""Column -> its channel, unit, sign and decimals."""
TIME = '# What the columns of logger.csv are.\n[time]\ncolumn = "time_ms"\nunit = "ms"\n'
MAP = TIME + "".join(
    f'\n[channels.{channel}]\ncolumn = "{column}"\nunit = "{unit}"\n' + "sign = -1\n" * (sign < 0)
    for column, (channel, unit, sign, _) in COLUMNS.items()
)


def flown(vehicle: hs.Vehicle, excitation: hs.Excitation, seed: int) -> hs.FlightRecord:
    recorder = replace(
        hs.Recorder.of(vehicle), rate_hz=RATE, antialias_hz=ANTIALIAS, resolution=RESOLUTION
    )
    plan = hs.FlightPlan(excitation=excitation, recorder=recorder)
    (record,) = hs.fly(vehicle, plan, seed=seed)
    kept = [record.channels[record.names.index(name)] for name in KEPT]
    return hs.FlightRecord(record.time, record.select(KEPT), tuple(kept), record.provenance)


def write_logger(record: hs.FlightRecord, path: Path) -> None:
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["time_ms", *COLUMNS])
        for k, time in enumerate(record.time):
            cells = (
                f"{sign * UNITS[unit] * record[name][k]:.{digits}f}"
                for name, unit, sign, digits in COLUMNS.values()
            )
            rows.writerow([f"{1e3 * time:.0f}", *cells])


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    vehicle = hs.load("jr700")
    for axis in channels.AXES:
        sweep = hs.Sweep(axis=axis, duration=DURATION)
        hs.write_record(flown(vehicle, sweep, SEED), folder / f"sweep_{axis}.parquet")
    for axis in ("lat", "ped"):
        doublet = flown(vehicle, hs.Doublet(axis=axis), SEED)
        hs.write_record(doublet, folder / f"doublet_{axis}.parquet")
    foreign = flown(vehicle, hs.Sweep(axis="lat", duration=DURATION), LOGGER_SEED)
    write_logger(foreign, folder / "logger.csv")
    with atomic_write(folder / "logger.toml") as path:
        path.write_text(MAP, encoding="utf-8")
    size = sum(path.stat().st_size for path in folder.iterdir())
    print(f"Written: {folder}, {size / 1000.0:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
