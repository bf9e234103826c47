"""Every file says what made it: versions, configuration, seed and model."""

import json

import numpy as np
import pytest

from helisim.cli import main
from helisim.records.record import FlightRecord, channel, versions
from helisim.records.storage import read_record, write_record


def heave(seed, n=3000):
    """A vertical speed that answers the collective, as a record without provenance."""
    rng = np.random.default_rng(seed)
    col = np.convolve(rng.standard_normal(n), np.ones(9) / 9.0, "same")
    w = np.zeros(n)
    for k in range(1, n):
        w[k] = 0.99 * w[k - 1] - 0.4 * col[k - 1]
    values = np.column_stack([col, w + 0.01 * rng.standard_normal(n)])
    return FlightRecord(0.01 * np.arange(n), values, (channel("col"), channel("w")))


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """One file of each kind that the commands write, by kind."""
    folder = tmp_path_factory.mktemp("files")
    for name, seed in (("sweep", 1), ("other", 2)):
        write_record(heave(seed), folder / f"{name}.parquet")
    kinds = ("flight.parquet", "flight.csv", "flight.rrd", "fit.json")
    kinds += ("fit.html", "frf.json", "frf.csv", "verified.json")
    out = {kind: folder / kind for kind in kinds}
    fly = ["fly", "--axis", "lat", "--duration", "13", "--seed", "5"]
    sweep = str(folder / "sweep.parquet")
    fit = [f"--json={out['fit.json']}", f"--report={out['fit.html']}"]
    frf = ["--inputs", "col", "--outputs", "w"]
    verified = [f"--json={out['verified.json']}"]
    for command in (
        [*fly, f"--out={out['flight.parquet']}", f"--rerun={out['flight.rrd']}"],
        [*fly, f"--out={out['flight.csv']}"],
        ["identify", sweep, "--structure", "heave", *fit],
        ["frf", sweep, *frf, f"--json={out['frf.json']}", f"--csv={out['frf.csv']}"],
        ["verify", *map(str, (out["fit.json"], folder / "other.parquet")), *verified],
    ):
        assert main([*command, "--quiet"]) in (0, 1)
    return out


def stated(path):
    if path.suffix == ".json":
        return json.loads(path.read_text())["provenance"]
    if path.name == "frf.csv":
        return json.loads(path.read_text().splitlines()[0].removeprefix("# provenance: "))
    return dict(read_record(path).provenance)


KINDS = ("flight.parquet", "flight.csv", "fit.json", "frf.json", "frf.csv")


@pytest.mark.parametrize("kind", [*KINDS, "verified.json"])
def test_a_file_states_the_versions(files, kind):
    found = stated(files[kind])
    assert found["versions"] == versions()
    assert found["versions"]["numpy"] == np.__version__


@pytest.mark.parametrize("kind", ["flight.parquet", "flight.csv"])
def test_a_flight_states_vehicle_model_seed_and_configuration(files, kind, jr700):
    found = stated(files[kind])
    assert found["model_digest"] == jr700.digest
    assert (found["vehicle"], found["seed"], found["flight"]) == ("jr700", 5, 0)
    assert found["excitation"]["axis"] == "lat"
    assert {"parameters", "timestep_s", "pilot", "recorder", "made_by"} <= found.keys()
