"""Files are written whole or not at all, read where they are sane, and say what made them."""

import errno
import json
import math
import os
import tomllib
from pathlib import Path

import numpy as np
import pytest

from helisim.base.errors import StorageError
from helisim.base.files import atomic_write, read_json, read_toml, toml_value, write_json
from helisim.cli import main
from helisim.ident import load_fit, structures
from helisim.logs import Map
from helisim.records.record import FlightRecord, channel, versions
from helisim.records.storage import read_record, write_record


def write_half(path: Path, failure: type[BaseException]) -> None:
    with atomic_write(path) as temporary:
        temporary.write_text("half")
        raise failure


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError, OSError])
def test_an_interrupted_write_leaves_the_old_file(tmp_path, failure):
    path = tmp_path / "results.json"
    path.write_text("old")
    with pytest.raises(StorageError if failure is OSError else failure):
        write_half(path, failure)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def refuse(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "write", [structures.heave.to_toml, lambda path: write_json({"a": 1}, path)]
)
def test_every_writer_leaves_the_old_file_when_the_disk_is_full(tmp_path, monkeypatch, write):
    path = tmp_path / "file.json"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(StorageError, match=r"file\.json: can't write it: No space left"):
        write(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "name", ["Flüge und Läufe/日本 1.json", 'it\'s "a" % {file} #1.json', "é" * 120 + ".json"]
)
def test_any_name_that_the_system_takes_is_written_and_read(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    write_json({"name": name}, path)
    assert read_json(path) == {"name": name}
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    ("name", "text", "read"),
    [
        ("deep.json", "[" * 100_000, read_json),
        ("deep.json", '{"format":' * 100_000, load_fit),
        ("deep.toml", "a = " + "[" * 100_000, read_toml),
        ("deep.toml", "a = " + "[" * 100_000, Map.from_toml),
        ("deep.toml", "a = " + "9" * 10_000, read_toml),
        ("list.json", "[1, 2]", read_json),
        ("half.json", '{"a": 1', read_json),
        ("bytes.json", "\udcff", read_json),
    ],
)
def test_what_parsers_stumble_over_is_one_clear_error(tmp_path, name, text, read):
    """Nesting that exhausts the stack, endless numbers, cut or foreign files name the file."""
    path = tmp_path / name
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(StorageError, match=name.replace(".", r"\.")):
        read(path)


@pytest.mark.parametrize(
    "value",
    ["", 'a "b" \\ c', "two\nlines", "\x7f\x1f", "é", True, 3, 0.1, 1e-300, math.inf, ["a", [1]]],
)
def test_a_toml_value_comes_back(value):
    assert tomllib.loads(f"x = {toml_value(value)}") == {"x": value}


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
