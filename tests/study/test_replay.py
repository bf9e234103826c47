"""A run repeats from its own provenance, and whatever differs is found and named."""

import json
import shutil

import numpy as np
import pytest

from helisim.base.errors import InputError, StorageError
from helisim.cli import main
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record, write_record
from helisim.study.experiment import reproduce
from helisim.study.replay import arguments_of, changes, compare_runs, leaves
from killing import kill_at


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small run on disk."""
    folder = tmp_path_factory.mktemp("runs") / "a run, übung"
    reproduce(out=folder, flights=1, seed=3, jobs=2)
    return folder


@pytest.fixture
def copied(run, tmp_path):
    """A copy of the run that a test may change."""
    return shutil.copytree(run, tmp_path / "copy")


@pytest.mark.slow
def test_a_run_repeats_to_the_byte(run, capsys):
    """`reproduce --from` flies and identifies the same again, with other threads: nothing moves."""
    capsys.readouterr()
    assert main(["reproduce", "--from", str(run), "--jobs", "1", "--quiet", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["arguments"]["seed"] == 3
    assert found["records_of_other_bytes"] == {}
    assert found["other_numbers"] == {}
    assert found["changed"] == {}
    assert len(found["records"]) >= 8
    assert found["numbers_compared"] > 10_000


@pytest.mark.slow
def test_a_killed_run_leaves_the_results_before(copied):
    """Kill -9 when new results are about to be complete: those before are there, whole."""
    path = copied / "results.json"
    before = path.read_bytes() + b" "  # valid, and told from the new ones
    path.write_bytes(before)
    kill_at(path.name, "reproduce", "--reuse", "--seed", "3", "--out", str(copied), "--quiet")
    assert path.read_bytes() == before
    assert arguments_of(copied).seed == 3


def test_a_copy_is_the_same(run, copied):
    """Equal folders compare as equal; what is printed says how much was compared."""
    found = compare_runs(run, copied)
    assert found.same
    assert f"{len(found.records)} of {len(found.records)} are the same to the byte" in str(found)
    assert "all are the same" in str(found)


def test_the_last_digit_of_a_result_is_noticed(run, copied):
    """One number that moved by one unit in the last place is named, with both values."""
    path = copied / "results.json"
    results = json.loads(path.read_text())
    row = results["tables"][0]["parameters"][0]
    row["identified"] = float(np.nextafter(row["identified"], np.inf))
    path.write_text(json.dumps(results))
    found = compare_runs(run, copied)
    name = f"results.tables[{results['tables'][0]['name']}].parameters[{row['name']}].identified"
    assert list(found.other_numbers) == [name]
    assert not found.same
    assert repr(row["identified"]) in found.other_numbers[name]


def test_the_last_bit_of_a_record_is_noticed(run, copied):
    path = copied / "flights" / "lat_01.parquet"
    record = read_record(path)
    values = record.values.copy()
    values[100, 4] = np.nextafter(values[100, 4], np.inf)
    changed = FlightRecord(record.time, values, record.channels, record.provenance)
    write_record(changed, path)
    found = compare_runs(run, copied)
    assert not found.same
    assert f"{record.names[4]} differ from 1 s on" in found.other_numbers["lat_01.parquet"]


def test_other_versions_are_told_apart_from_other_numbers(run, copied):
    """A record and results of other versions, with the same numbers, are the same run."""
    path = copied / "flights" / "lat_01.parquet"
    record = read_record(path)
    versions = {**record.provenance["versions"], "numpy": "1.0"}
    older = {**record.provenance, "versions": versions}
    write_record(FlightRecord(record.time, record.values, record.channels, older), path)
    results = json.loads((copied / "results.json").read_text())
    results["versions"]["numpy"] = "1.0"
    (copied / "results.json").write_text(json.dumps(results))
    found = compare_runs(copied, run)
    assert found.same
    assert "versions.numpy is '1.0' there" in found.other_bytes["lat_01.parquet"]
    assert found.changed["numpy"] == ("1.0", np.__version__)
    assert f"numpy: 1.0 then, {np.__version__} now" in str(found)


def test_the_same_difference_of_many_records_is_one_line(run, copied):
    """All records of another version differ in one way: that is said once, with how many."""
    for path in (copied / "flights").glob("*.parquet"):
        record = read_record(path)
        versions = {**record.provenance["versions"], "numpy": "1.0"}
        provenance = {**record.provenance, "versions": versions}
        write_record(FlightRecord(record.time, record.values, record.channels, provenance), path)
    found = compare_runs(copied, run)
    lines = [line for line in str(found).splitlines() if "versions.numpy" in line]
    assert len(lines) == 1
    assert f"col_01.parquet and {len(found.records) - 1} more: the same numbers" in lines[0]


def test_leaves_of_data_are_named_by_their_place():
    """Items of a list by their name, or number; what is no number of a run is left out."""
    then = {"tables": [{"name": "a", "x": [1.0, 2.0]}], "versions": {"numpy": "2"}}
    now = {"tables": [{"name": "a", "x": [1.0, 3.0]}, {"name": "b"}]}
    assert leaves(then, "r", ["versions"]) == {
        "r.tables[a].name": "a",
        "r.tables[a].x[0]": 1.0,
        "r.tables[a].x[1]": 2.0,
    }
    assert changes(leaves(then, "r", ["versions"]), leaves(now, "r")) == {
        "r.tables[a].x[1]": "2.0 before, 3.0 now, 33 % apart",
        "r.tables[b].name": "None before, 'b' now",
    }


@pytest.mark.parametrize("damage", ["remove", "cut"])
def test_a_lost_or_damaged_record_is_a_difference(run, copied, damage):
    path = copied / "flights" / "col_01.parquet"
    if damage == "remove":
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:1000])
    found = compare_runs(copied, run)
    assert set(found.other_numbers) == {"col_01.parquet"}
    assert not found.same


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("flights", "many"),
        ("flights", True),
        ("seed", None),
        ("parameters", [1]),
        ("parameters", {"air.density": "thick"}),
        ("timestep", "short"),
        ("rotor", 1),
        ("out", "/somewhere/else"),
    ],
)
def test_arguments_that_can_not_be_are_refused(copied, name, value):
    """What a run says of itself is checked before anything flies; no other option gets in."""
    path = copied / "results.json"
    results = json.loads(path.read_text())
    results["configuration"]["arguments"][name] = value
    path.write_text(json.dumps(results))
    with pytest.raises(InputError, match=r"results\.json.*configuration\.arguments"):
        arguments_of(copied)


def test_what_is_no_run_is_refused(tmp_path, run, capsys):
    """An empty folder, a run of another version, the run as its own output, other options."""
    with pytest.raises(StorageError, match=r"results\.json: no such file"):
        arguments_of(tmp_path)
    (tmp_path / "results.json").write_text('{"tables": []}')
    with pytest.raises(InputError, match="another version wrote it"):
        arguments_of(tmp_path)
    capsys.readouterr()
    for options, says in (
        (["--out", str(run)], "give another folder"),
        (["--seed", "1"], "leave out --seed"),
        (["--flights", "2", "--set", "air.density=1"], "leave out --flights, --set"),
    ):
        assert main(["reproduce", "--from", str(run), *options]) == 2
        captured = capsys.readouterr()
        assert says in captured.err
        assert len(captured.err.splitlines()) == 1
