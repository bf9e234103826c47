"""A seed gives the same bytes of a record in any process, with any threads, installed anywhere."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import helisim
from helisim.records.storage import write_record
from helisim.sim import Sweep, fly
from helisim.vehicle import load
from helisim.vehicle.folder import models_folder

SEEDS = (0, 3, 4, 11, 2**40)
FLIGHTS = 2

SCRIPT = """
import sys
import helisim as hs
vehicle = hs.load()
for seed in map(int, sys.argv[2:]):
    records = hs.fly(vehicle, hs.Sweep(axis="lat", duration=13.0), count=2, seed=seed, jobs=2)
    for k, record in enumerate(records):
        hs.write_record(record, f"{seed}_{k}.{sys.argv[1]}")
print(hs.__file__)
"""


@pytest.fixture(scope="module")
def here(jr700, tmp_path_factory) -> dict[str, bytes]:
    """The bytes of the records that this process writes, one thread a flight, by name."""
    folder = tmp_path_factory.mktemp("here")
    for seed in SEEDS:
        flown = fly(jr700, Sweep(axis="lat", duration=13.0), count=FLIGHTS, seed=seed, jobs=1)
        for k, record in enumerate(flown):
            for suffix in ("parquet", "csv"):
                write_record(record, folder / f"{seed}_{k}.{suffix}")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def flown_by(folder: Path, suffix: str, **environment: str) -> tuple[dict[str, bytes], str]:
    """Fly in another process; return the bytes of its records, and where helisim is."""
    folder.mkdir()
    command = [sys.executable, "-c", SCRIPT, suffix, *map(str, SEEDS)]
    done = subprocess.run(
        command,
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return {path.name: path.read_bytes() for path in folder.iterdir()}, done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["parquet", "csv"])
def test_another_process_with_other_threads_writes_the_same_bytes(here, tmp_path, suffix):
    """Neither the process, its hash seed, its locale, its clock nor any number of threads."""
    environment = {
        "PYTHONHASHSEED": "7",
        "OPENBLAS_NUM_THREADS": "2",
        "LC_ALL": "C",
        "TZ": "Asia/Tokyo",
    }
    there, _ = flown_by(tmp_path / "there", suffix, **environment)
    assert there == {name: data for name, data in here.items() if name.endswith(suffix)}
    assert len(there) == FLIGHTS * len(SEEDS)


@pytest.mark.slow
def test_another_installation_writes_the_same_bytes(here, tmp_path):
    """Nor the folder that helisim is installed in, whatever its name."""
    site = tmp_path / "Pfad mit Lücken" / "site"
    package = Path(helisim.__file__).parent
    skip = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc")
    shutil.copytree(package, site / "helisim", ignore=skip)
    if not (site / "helisim" / "models").exists():  # a checkout has them beside the sources
        shutil.copytree(models_folder(), site / "helisim" / "models")
    path = os.pathsep.join((str(site), os.environ.get("PYTHONPATH", "")))
    there, where = flown_by(tmp_path / "there", "parquet", PYTHONPATH=path)
    assert Path(where).parent == site / "helisim"
    assert there == {name: data for name, data in here.items() if name.endswith("parquet")}


def test_seeds_give_different_bytes(here):
    """No two flights of all these are the same."""
    assert len(set(here.values())) == 2 * FLIGHTS * len(SEEDS)


def test_the_model_digest_follows_what_flies(jr700):
    """The same model has the same digest; another parameter or time step has another."""
    assert load().digest == jr700.digest
    others = {
        jr700.digest,
        load(parameters={"main_rotor.hub_stiffness": 100.0}).digest,
        load(timestep=0.001).digest,
        jr700.with_settings({"gyro.k_p": 0.2}).digest,
    }
    assert len(others) == 4
