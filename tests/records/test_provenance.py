"""Every file says what made it: versions, configuration, seed and model."""

import json

import numpy as np
import pytest
from rerun.chunk import RrdReader
from scipy.io import loadmat

from helisim.cli import main
from helisim.records.record import FlightRecord, channel, difference, made_by, versions
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
    kinds = ("flight.parquet", "flight.csv", "flight.rrd", "fit.json", "fit.tex", "fit.mat")
    kinds += ("fit.html", "frf.json", "frf.csv", "verified.json")
    out = {kind: folder / kind for kind in kinds}
    fly = ["fly", "--axis", "lat", "--duration", "13", "--seed", "5"]
    sweep = str(folder / "sweep.parquet")
    fit = [f"--{o}={out[k]}" for o, k in (("json", "fit.json"), ("latex", "fit.tex"))]
    fit += [f"--{o}={out[k]}" for o, k in (("matlab", "fit.mat"), ("report", "fit.html"))]
    frf = ["--inputs", "col", "--outputs", "w"]
    verified = [f"--json={out['verified.json']}"]
    for command in (
        [*fly, f"--out={out['flight.parquet']}", f"--rerun={out['flight.rrd']}"],
        [*fly, f"--out={out['flight.csv']}"],
        ["identify", sweep, "--structure", "heave", "--seed", "5", *fit],
        ["frf", sweep, *frf, f"--json={out['frf.json']}", f"--csv={out['frf.csv']}"],
        ["verify", *map(str, (out["fit.json"], folder / "other.parquet")), *verified],
    ):
        assert main([*command, "--quiet"]) in (0, 1)
    return out


def stated(path):
    """Return the provenance that a file states."""
    match path.suffix:
        case ".json":
            return json.loads(path.read_text())["provenance"]
        case ".tex":
            return json.loads(path.read_text().splitlines()[0].removeprefix("% "))
        case ".mat":
            return json.loads(loadmat(path)["Provenance"][0])
    if path.name == "frf.csv":
        return json.loads(path.read_text().splitlines()[0].removeprefix("# provenance: "))
    return dict(read_record(path).provenance)


KINDS = ("flight.parquet", "flight.csv", "fit.json", "fit.tex", "fit.mat", "frf.json", "frf.csv")


@pytest.mark.parametrize("kind", [*KINDS, "verified.json"])
def test_a_file_states_the_versions(files, kind):
    """Python, the machine's kind, and each program that its numbers depend on."""
    found = stated(files[kind])
    assert found["versions"] == versions()
    assert found["versions"]["numpy"] == np.__version__


@pytest.mark.parametrize("kind", ["flight.parquet", "flight.csv"])
def test_a_flight_states_vehicle_model_seed_and_configuration(files, kind, jr700):
    """Everything that is needed to fly it again."""
    found = stated(files[kind])
    assert found["model_digest"] == jr700.digest
    assert (found["vehicle"], found["seed"], found["flight"]) == ("jr700", 5, 0)
    assert found["excitation"]["axis"] == "lat"
    assert {"parameters", "timestep_s", "pilot", "recorder", "made_by"} <= found.keys()


@pytest.mark.parametrize("kind", ["fit.json", "fit.tex", "fit.mat"])
def test_a_fit_states_its_data_and_its_options(files, kind):
    """Which records, windows and band, and how the search was asked."""
    found = stated(files[kind])
    assert len(found["records"]) == 1
    assert found["options"]["seed"] == 5
    assert {"windows_s", "band_rad_s", "conditioning", "reference", "method"} <= found.keys()


def test_pages_and_recordings_state_it_too(files):
    """In the text of the page, and among the recording's properties."""
    assert f'"numpy": "{np.__version__}"' in files["fit.html"].read_text().replace("&quot;", '"')
    properties = ""
    for chunk in RrdReader(str(files["flight.rrd"])).stream():
        batch = chunk.to_record_batch()
        columns = [name for name in batch.schema.names if "provenance" in name]
        properties += "".join(str(batch.column(name).to_pylist()) for name in columns)
    assert f'"numpy": "{np.__version__}"' in properties
    assert '"model_digest"' in properties


def test_a_linearisation_states_its_vehicle(capsys, jr700):
    """`linearize --json` says which model with which parameters it belongs to."""
    assert main(["linearize", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["provenance"]
    assert found["model_digest"] == jr700.digest
    assert found["parameters"] == dict(jr700.parameters)
    assert found["versions"] == versions()


def test_what_differs_is_named():
    """The first difference between two provenances is said with its place and both values."""
    one = made_by("test", seed=1, plan={"axis": "lat"})
    assert difference(one, made_by("test", seed=1, plan={"axis": "lat"})) == ""
    found = difference(one, made_by("test", seed=1, plan={"axis": "lon"}))
    assert found == "plan.axis is 'lat' there and 'lon' here"
