"""How long `helisim reproduce` takes, cold and warm, and where the time of a cold one goes.

First the command itself, twice, as whole processes: with nothing compiled before, then with what
the first compiled. Then, part by part from a cold start, the experiment with a Rerun recording, and
apart from it the identification of all models from the flights. Printed are wall and processor
seconds and the load of the machine before; nothing is left behind. With other programs at work
only the processor seconds mean something.

    OPENBLAS_NUM_THREADS=1 python scripts/benchmark/experiment.py [FLIGHTS]
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np


def now(who: int = resource.RUSAGE_SELF) -> np.ndarray:
    used = resource.getrusage(who)
    return np.array([time.perf_counter(), used.ru_utime + used.ru_stime])


def show(part: str, spent: np.ndarray) -> None:
    print(f"{part:<42}{spent[0]:>8.1f}{spent[1]:>8.1f}", flush=True)


def whole_command(folder: str, flights: int) -> np.ndarray:
    words = ["reproduce", "--quiet", "--flights", str(flights), "--out", f"{folder}/command"]
    begun = now(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "helisim", *words],
        env={**os.environ, "NUMBA_CACHE_DIR": f"{folder}/compiled"},
        stdout=subprocess.DEVNULL,
        check=False,  # with few flights a tolerance may be missed
    )
    return now(resource.RUSAGE_CHILDREN) - begun


def main(flights: int = 10) -> None:
    head = f"{'wall s':>8}{'CPU s':>8}"
    print(f"{f'load of the machine {os.getloadavg()[0]:.1f}':<42}{head}")
    with tempfile.TemporaryDirectory() as folder:
        for state in ("cold", "warm"):
            show(f"helisim reproduce, {state}", whole_command(folder, flights))
    parts: dict[str, np.ndarray] = {}
    last = now()

    def clock(part: str) -> None:
        nonlocal last
        begun, last = last, now()
        parts[part] = parts.get(part, 0.0) + last - begun

    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = f"{folder}/compiled"
        from helisim.physics import native
        from helisim.show.recording import write_recording
        from helisim.show.report import write_report
        from helisim.study.comparison import identify_model
        from helisim.study.experiment import named_records, reproduce
        from helisim.study.models import MODELS
        from helisim.vehicle import load as load_vehicle

        clock("imports")
        native.compiled()
        clock("compilation")
        names = {model.name for model in MODELS}
        ground = "ground tests, identification, truth"
        out = Path(folder) / "run"

        def told(what: str) -> None:
            clock(ground if what in names else "flights, recorded")

        run = reproduce(out=out, flights=flights, rotor=True, on_progress=told)
        write_report(out, run)
        clock("report")
        records, model = named_records(run.flights), load_vehicle("jr700").visual_model()
        write_recording(Path(folder) / "run.rrd", records, model=model)
        clock("Rerun recording")
    count = sum(map(len, run.flights.values()))
    print(f"\nthe experiment with a recording, {count} flights kept, cold, part by part:")
    print(f"{'':<42}{head}")
    for part, spent in (*parts.items(), ("all", sum(parts.values()))):
        show(part, spent)
    found = {table.name: table for table in run.results.tables}
    alone = now()
    for model in MODELS:
        identify_model(model, run.flights, before=found, ground=run.results.ground)
    show(f"identification of {len(MODELS)} models alone", now() - alone)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
