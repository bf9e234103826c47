"""Kill -9 at random moments, and look whether all is there that was reported as saved.

`fly`, `campaign` and `reproduce` each run until they are killed, without a chance to tidy up, so
many times, at moments drawn from a seed. After each kill every file must be whole and hold what
an undisturbed run holds, and whatever was reported as saved must be there. A flight or campaign
is then gone on with in the same folder, a reproduction begins anew in another. In the end all
must be there, to the byte.

    python scripts/proof/kill_study.py [KILLS] [COMMAND...]
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from helisim.base.errors import HelisimError
from helisim.base.files import read_json
from helisim.records.storage import read_table
from helisim.sim import Sweep, fly_to
from helisim.study.campaign import campaign_from
from helisim.study.experiment import reproduce
from helisim.study.replicates import run_campaign
from helisim.vehicle import load

COMMANDS = ("fly", "campaign", "reproduce")
GOES_ON = ("fly", "campaign")  # Those that a second call goes on with.
SEED = 9
_PATIENCE = 4  # Kills of which one comes before the work is complete, at least.
PLAN = """
[campaign]
replicates = 4
models = ["yaw_base"]
flights = 1
[set.sweep]
duration = 30
[vary.recorder]
noise = { values = [0.5, 4], relative = true }
"""


def work(command: str, folder: Path) -> None:
    """Do a command's work and report, a line each, what is saved."""

    def saved(_: str = "") -> None:
        print("saved", flush=True)

    if command == "fly":
        vehicle = load()
        print("begins", flush=True)
        sweep = Sweep(axis="lat", duration=20.0)
        fly_to(folder, vehicle, sweep, count=20, seed=1, jobs=1, on_flight=saved)
    elif command == "campaign":
        plan = campaign_from(tomllib.loads(PLAN))
        print("begins", flush=True)
        run_campaign(plan, folder, on_replicate=saved)
    else:
        print("begins", flush=True)
        reproduce(out=folder, flights=1, seed=1, jobs=1, on_progress=saved)
    print("complete", flush=True)


def run(
    command: str, folder: Path, moment: float | None = None, pace: float = 0.0
) -> tuple[list[str], float]:
    """Run a command in a process and return its lines and how long they took, s.

    It returns when the process and the workers that it started are gone: all have its output.
    """
    arguments = [sys.executable, __file__, "--work", command, str(folder)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    with subprocess.Popen(
        arguments, stdout=subprocess.PIPE, text=True, env=environment, cwd=folder.parent
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline()]
        began = time.monotonic()
        if moment is not None:
            while lines[-1] and len(lines) - 1 < int(moment):
                lines.append(process.stdout.readline())
            time.sleep(pace * (moment % 1.0))
            process.kill()
        lines += process.stdout.readlines()
    return [line.strip() for line in lines], time.monotonic() - began


def units(command: str, folder: Path) -> int:
    """Return how many units of work a folder holds, as they are reported."""
    if command == "fly":
        return len(list(folder.glob("[!.]*.parquet")))
    if command == "campaign":
        if (folder / "dataset.parquet").exists():
            return len(campaign_from(tomllib.loads(PLAN)))
        return len(list((folder / "parts").glob("[!.]*.parquet")))
    return len(list((folder / "flights").glob("[!.]*_[0-9]*.parquet")))


def torn(folder: Path, whole: Path) -> list[str]:
    """Return the files that aren't, to the byte, what an undisturbed run wrote, or can't be read.

    A part of a campaign, which the undisturbed run has no longer, must be readable.
    """
    found = []
    for path in folder.rglob("[!.]*.*"):
        other = whole / path.relative_to(folder)
        if other.exists():
            if path.is_file() and path.read_bytes() != other.read_bytes():
                found.append(f"{path.name} differs")
            continue
        try:
            read_json(path) if path.suffix == ".json" else _read_table(path)
        except HelisimError as error:
            found.append(str(error))
    return found


def _read_table(path: Path) -> None:
    if path.suffix == ".parquet":
        read_table(path, path.read_bytes())


def study(command: str, kills: int, scratch: Path, seed: int = SEED) -> dict[str, int]:
    """Kill a command so many times while it works and return what was found, by name."""
    whole = scratch / f"{command} whole"
    lines, lasts = run(command, whole)
    reports = lines.count("saved")
    rng = np.random.default_rng([seed, *command.encode()])
    found = dict.fromkeys(("kills", "in time", "reported", "lost", "torn", "strays"), 0)
    folder = scratch / f"{command} 0"
    while found["in time"] < kills and found["kills"] < _PATIENCE * kills:
        moment = rng.uniform()
        done = units(command, folder) / units(command, whole)
        if command not in GOES_ON or done == 1.0:
            folder, done = scratch / f"{command} {found['kills']}", 0.0
        after = reports * (done + moment * (1.0 - done))
        lines, _ = run(command, folder, float(after), lasts / reports)
        reported = lines.count("saved")
        if command == "reproduce":  # models and the report are reported too, when all are flown
            reported = min(reported, units(command, whole))
        found["kills"] += 1
        found["in time"] += "complete" not in lines
        found["reported"] += reported
        if folder.exists():
            found["lost"] += max(0, reported - units(command, folder))
            found["torn"] += len(torn(folder, whole))
            found["strays"] += len(list(folder.rglob(".*.tmp.*")))
        else:
            found["lost"] += reported
    run(command, folder)
    kept = {path.relative_to(whole) for path in whole.rglob("[!.]*.*")}
    missing = [path for path in kept if not (folder / path).exists()]
    found["not complete in the end"] = len(missing) + len(torn(folder, whole))
    return found


def main(kills: int = 20, commands: Sequence[str] = COMMANDS) -> int:
    """Print a line a command; return 1 if anything was lost or torn."""
    bad = 0
    with tempfile.TemporaryDirectory(prefix="helisim-kill-") as scratch:
        for command in commands:
            found = study(command, kills, Path(scratch))
            print(f"{command}: {json.dumps(found)}", flush=True)
            bad += found["lost"] + found["torn"] + found["not complete in the end"]
    return 1 if bad else 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--work"]:
        work(sys.argv[2], Path(sys.argv[3]))
        raise SystemExit(0)
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    named = [word for word in sys.argv[1:] if not word.isdigit()]
    raise SystemExit(main(*numbers[:1], **({"commands": named} if named else {})))
