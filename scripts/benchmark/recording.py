"""Measure what a Rerun recording of one flight costs, with everything in it.

    python scripts/benchmark/recording.py

The flight is a lateral sweep of 90 s recorded at 100 Hz with the rotor's true tilt and loads; the
recording has it in 3D. Loading and flying are not counted. Times are the best of five: the others
have other programs in them.
"""

import tempfile
import time
from pathlib import Path

import helisim as hs
from helisim.show.recording import write_recording

TIMES = 5


def main() -> None:
    """Print the seconds and the megabytes."""
    vehicle = hs.load("jr700")
    recorder = hs.Recorder.of(vehicle, rotor=True)
    (record,) = hs.fly(
        vehicle, hs.FlightPlan(excitation=hs.Sweep(axis="lat"), recorder=recorder), seed=1
    )
    model = vehicle.visual_model()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "lat.rrd"
        walls, processors = [], []
        for _ in range(TIMES):
            wall, processor = time.perf_counter(), time.process_time()
            write_recording(path, {"lat": record}, model=model)
            walls.append(time.perf_counter() - wall)
            processors.append(time.process_time() - processor)
        size = path.stat().st_size
    print(f"flight     {record.duration:g} s, {len(record)} samples, {len(record.names)} channels")
    print(f"size    {size / 1e6:7.2f} MB")
    print(f"written {min(walls):7.2f} s, of which {min(processors):.2f} s of processor time")


if __name__ == "__main__":
    main()
