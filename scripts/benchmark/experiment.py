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


class Clock:
    """Sums up wall and processor seconds by part."""

    def __init__(self) -> None:
        self.parts: dict[str, list[float]] = {}
        self._last = (time.perf_counter(), time.process_time())

    def __call__(self, part: str) -> None:
        now = (time.perf_counter(), time.process_time())
        spent = self.parts.setdefault(part, [0.0, 0.0])
        for k in range(2):
            spent[k] += now[k] - self._last[k]
        self._last = now

    def __str__(self) -> str:
        whole = [sum(spent[k] for spent in self.parts.values()) for k in range(2)]
        rows = [("", "wall s", "CPU s")] + [
            (part, f"{wall:.1f}", f"{cpu:.1f}")
            for part, (wall, cpu) in (*self.parts.items(), ("all", whole))
        ]
        return "\n".join(f"{part:<42}{wall:>8}{cpu:>8}" for part, wall, cpu in rows)


def whole_command(folder: str, flights: int) -> tuple[float, float]:
    words = ["reproduce", "--quiet", "--flights", str(flights), "--out", f"{folder}/command"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": f"{folder}/compiled"}
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "helisim", *words],
        env=environment,
        stdout=subprocess.DEVNULL,
        check=False,  # with few flights a tolerance may be missed
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - start, spent


def main(flights: int = 10) -> None:
    load = os.getloadavg()[0]
    print(f"{f'load of the machine {load:.1f}':<42}{'wall s':>8}{'CPU s':>8}")
    with tempfile.TemporaryDirectory() as folder:
        for state in ("cold", "warm"):
            wall, cpu = whole_command(folder, flights)
            print(f"{f'helisim reproduce, {state}':<42}{wall:>8.1f}{cpu:>8.1f}", flush=True)
    print()
    clock = Clock()
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
        out = Path(folder) / "run"
        run = reproduce(
            out=out,
            flights=flights,
            rotor=True,
            on_progress=lambda what: clock(
                "ground tests, identification, truth" if what in names else "flights, recorded"
            ),
        )
        write_report(out, run)
        clock("report")
        records, model = named_records(run.flights), load_vehicle("jr700").visual_model()
        write_recording(Path(folder) / "run.rrd", records, model=model)
        clock("Rerun recording")
    count = sum(map(len, run.flights.values()))
    print(f"the experiment with a recording, {count} flights kept, cold, part by part:")
    print(clock)
    alone = Clock()
    found = {table.name: table for table in run.results.tables}
    for model in MODELS:
        identify_model(model, run.flights, before=found, ground=run.results.ground)
    alone(f"identification of {len(MODELS)} models alone")
    print("\n".join(str(alone).splitlines()[1:-1]))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
