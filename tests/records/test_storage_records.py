import errno
import json
import math
import os
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

import helisim as hs
from helisim import cli
from helisim.base.errors import StorageError, UnknownNameError
from helisim.base.files import atomic_write, read_json, read_toml, toml_value, write_json  # noqa: F401  (rows name them)
from helisim.cli import main
from helisim.ident import load_fit, structures  # noqa: F401  (rows name it)
from helisim.logs import Map  # noqa: F401  (rows name it)
from helisim.logs.examples import FOLDER
from helisim.records.record import Channel, FlightRecord, channel, versions
from helisim.records.storage import read_record, write_record
from ident_data import heave
from script import loaded
from tabled import tabled

SUFFIXES = (".parquet", ".csv")
AWKWARD = Channel('gap, "rotor" [x]', "m/s^2 [raw]", "OTHER", "an odd name; Ω and a\nsecond line")


SMALL = FlightRecord(
    [0.0, 0.5, 1.0], [[1.0, 4.0], [2.0, 5.0], [3.0, 6.0]], (channel("p"), channel("q"))
)
"""Its CSV has five comment lines, the header on line 6 and the rows on lines 7 to 9."""


def make_record(n: int = 50, provenance: dict | None = None) -> FlightRecord:
    rng = np.random.default_rng(7)
    channels = (channel("lat"), channel("LAT"), channel("p"), AWKWARD)
    return FlightRecord(
        time=np.arange(n) / 100.0,
        values=rng.standard_normal((n, len(channels))) * [1e-12, 1.0, 1e9, np.pi],
        channels=channels,
        provenance={"seed": 7, "note": "zero gyro µ"} if provenance is None else provenance,
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_record_comes_back_exactly_and_equal_ones_are_equal_bytes(tmp_path, suffix):
    record = make_record()
    assert read_record(write_record(record, tmp_path / f"flight{suffix}")) == record
    origins = ({"a": 1, "b": [2, {"c": 3, "d": 4}]}, {"b": [2, {"d": 4, "c": 3}], "a": 1})
    first, second = (
        write_record(make_record(provenance=one), tmp_path / f"{k}{suffix}").read_bytes()
        for k, one in enumerate(origins)
    )
    assert first == second


@given(
    values=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=2, max_size=8),
    seed=st.integers(0, 2**53),
)
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_any_finite_double_survives(tmp_path_factory, suffix, values, seed):
    path = tmp_path_factory.mktemp("any") / f"flight{suffix}"
    record = FlightRecord(
        np.arange(len(values)), np.array(values)[:, None], (channel("p"),), {"seed": seed}
    )
    back = read_record(write_record(record, path))
    assert back.values.tobytes() == record.values.tobytes()
    assert back.provenance["seed"] == seed


def test_parquet_is_plain_to_other_readers(tmp_path):
    record = make_record()
    table = pq.read_table(write_record(record, tmp_path / "flight.parquet"))
    assert table.column_names == ["time", *record.names]
    np.testing.assert_array_equal(table["p"].to_numpy(), record["p"])
    assert table.schema.field("p").metadata[b"unit"] == b"rad/s"
    assert table.schema.field("p").metadata[b"kind"] == b"OUT"
    header = json.loads(table.schema.metadata[b"helisim"])
    assert header["version"] == 1
    assert header["provenance"] == dict(record.provenance)


@pytest.mark.parametrize("name", ["flight.hdf5", "flight", "flight.csv.gz"])
def test_an_unknown_suffix_lists_those_that_exist(tmp_path, name):
    for attempt in (lambda path: write_record(SMALL, path), read_record):
        with pytest.raises(StorageError, match=r"unknown suffix .*available: \.parquet, \.csv"):
            attempt(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("keep", [0, 3, 200, 0.5, 0.99, "flip"])
def test_damaged_parquet_is_refused(tmp_path, keep):
    path = write_record(make_record(), tmp_path / "flight.parquet")
    data = bytearray(path.read_bytes())
    if keep == "flip":
        data[300] ^= 0x10  # inside the first page, the time column
    else:
        del data[keep if isinstance(keep, int) else int(keep * len(data)) :]
    path.write_bytes(data)
    with pytest.raises(StorageError, match=r"flight\.parquet: not Parquet, truncated or corrupt"):
        read_record(path)


@tabled("change", "error", "message")
def test_foreign_parquet_is_refused(tmp_path, change, error, message):
    path = tmp_path / "foreign.parquet"
    pq.write_table(change(pq.read_table(write_record(make_record(), path))), path)
    with pytest.raises(error, match=message):
        read_record(path)


def headed(table, **changes):
    header = json.loads(table.schema.metadata[b"helisim"])
    return table.replace_schema_metadata({"helisim": json.dumps({**header, **changes})})


def with_p(table, row, value):
    kind = pa.string() if isinstance(value, str) else pa.float64()
    field = pa.field("p", kind, metadata=table.schema.field("p").metadata)
    return table.set_column(3, field, pa.array([1.0] * row + [value] * (50 - row), kind))


@tabled("old", "new", "error", "message")
def test_a_damaged_csv_is_refused(tmp_path, old, new, error, message):
    path = write_record(SMALL, tmp_path / "flight.csv")
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(error, match=message) as caught:
        read_record(path)
    assert str(caught.value).startswith(str(path))


# Files are written whole or not at all, read where they are sane, and say what made them.


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


@tabled("write")
def test_every_writer_leaves_the_old_file_when_the_disk_is_full(tmp_path, monkeypatch, write):
    path = tmp_path / "file.json"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(StorageError, match=r"file\.json: can't write it: No space left"):
        write(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@tabled("name")
def test_any_name_that_the_system_takes_is_written_and_read(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    write_json({"name": name}, path)
    assert read_json(path) == {"name": name}
    assert list(path.parent.iterdir()) == [path]


@tabled("name", "text", "read")
def test_what_parsers_stumble_over_is_one_clear_error(tmp_path, name, text, read):
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


@pytest.fixture(scope="module")
def files(tmp_path_factory):
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


# The recorded logs that come with helisim.

maker = loaded("examples/make_examples")


@pytest.fixture(scope="module")
def logs():
    return {name: hs.open_example(name) for name in hs.examples()}


def test_each_is_a_short_record_with_its_origin(logs):
    assert len(logs) == 7
    for name, record in logs.items():
        assert 8.0 <= record.duration <= 45.0
        np.testing.assert_allclose(record.sample_time, 1.0 / maker.RATE)
        if name != "logger":
            kind, axis = name.split("_")
            flown = record.provenance["excitation"]
            assert (flown["kind"].lower(), flown["axis"]) == (kind, axis)
            assert record.provenance["vehicle"] == "jr700"
    with pytest.raises(UnknownNameError, match=r"unknown example 'sweep'; available: sweep_col"):
        hs.open_example("sweep")


@tabled("structure", "sweeps", "unseen", "options")
def test_models_are_identified_from_them(structure, sweeps, unseen, options, logs, jr700):
    model = getattr(hs.structures, structure)
    frf = hs.frequency_response(
        [logs[name] for name in sweeps], inputs=model.inputs, outputs=model.outputs, **options
    )
    fit = hs.identify(frf, model)
    assert fit.converged
    assert fit.excellent
    found = 0
    for name, one in fit.parameters.items():
        if name in jr700.derivatives:
            truth = jr700.derivatives[name]
            # one flight an axis, so with more scatter than the bound of the smallest coupling, a
            # sixth of B_lat: 1.3 of it
            allowed = 1.5 if name == "B_lon" else 1.0
            limit = 2.0 * one.standard_error if one.fixed else allowed * one.cramer_rao  # assumed
            assert abs(one.value - truth) <= limit, (name, one.value, truth)
            found += 1
    assert found >= 2
    if unseen is not None:
        doublet, start, stop = unseen
        assert hs.verify(fit, logs[doublet].slice(start, stop)).acceptable


def test_the_foreign_log_is_the_same_helicopter_and_the_script_makes_them(logs, jr700, tmp_path):
    assert logs["logger"].names == ("LAT", "LON", "lat", "lon", "p", "q")
    responses = [
        hs.frequency_response(logs[name], inputs="lat", outputs="p", band=(4.0, 20.0))
        for name in ("logger", "sweep_lat")
    ]
    apart = np.abs(responses[0].response / responses[1].response - 1.0)
    error = np.hypot(*(one.random_error for one in responses))
    assert np.max(apart / error) < 5.0  # of some forty points, none beyond five deviations
    assert np.median(apart) < 0.02
    again = maker.flown(jr700, hs.Doublet(axis="lat"), maker.SEED)
    shipped = logs["doublet_lat"]
    assert again.names == shipped.names
    for name in again.names:
        # IN1 is computed from three servos, each rounded to its step: three half steps apart
        step = maker.RESOLUTION.get(name, 1.5 * maker.RESOLUTION["servo_front"])
        assert np.max(np.abs(again[name] - shipped[name])) <= 1.001 * step, name
    written = [tmp_path / f"{k}.csv" for k in range(2)]
    for path in written:
        maker.write_logger(again, path)
    assert written[0].read_bytes() == written[1].read_bytes()
    assert (FOLDER / "logger.toml").read_text(encoding="utf-8") == maker.MAP


def test_they_are_copied_for_other_commands(tmp_path, capsys):
    folder = tmp_path / "new" / "logs"
    assert cli.main(["examples", "--to", str(folder)]) == 0
    assert "Written: 8 files in" in capsys.readouterr().out
    assert {path.name for path in folder.iterdir()} == {path.name for path in FOLDER.iterdir()}
    assert cli.main(["examples", "--to", str(folder), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    mine = folder / "logger.csv"
    mine.write_text("mine")
    (folder / "sweep_lat.parquet").unlink()
    assert cli.main(["examples", "--to", str(folder)]) == 2
    assert "logger.csv: exists and is another file" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert not (folder / "sweep_lat.parquet").exists()
