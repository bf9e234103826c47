"""A folder of flights: complete, kept when interrupted, gone on with, and not mixed up."""

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sim import FlightEnvelope, FlightPlan, Pilot, Recorder, Sweep, fly, fly_to, simulate

SHORT = Sweep(axis="lat", duration=8.0, trim_time=1.0)


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def whole(jr700, tmp_path_factory):
    """Three flights, flown without interruption in one thread."""
    folder = tmp_path_factory.mktemp("whole")
    fly_to(folder, jr700, SHORT, count=3, seed=7, jobs=1)
    return contents(folder)


def test_the_folder_holds_what_fly_returns(jr700, tmp_path):
    """One record a flight, with the numbers that `fly` gives."""
    flown = fly_to(tmp_path / "new", jr700, SHORT, count=2, seed=7, jobs=2)
    assert [path.name for path in flown.paths] == ["lat_0001.parquet", "lat_0002.parquet"]
    assert flown.found == 0
    for path, record in zip(flown.paths, fly(jr700, SHORT, count=2, seed=7, jobs=1)):
        kept = read_record(path)
        assert kept.values.tobytes() == record.values.tobytes()
        assert kept.provenance == record.provenance


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupted_run_goes_on_to_the_same_bytes(jr700, tmp_path, whole, jobs):
    """Ctrl-C keeps the finished flights, and the next call flies the rest only."""

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fly_to(tmp_path, jr700, SHORT, count=3, seed=7, jobs=jobs, on_flight=interrupt)
    kept = contents(tmp_path)
    assert kept == {"lat_0001.parquet": whole["lat_0001.parquet"]}
    (first,) = tmp_path.iterdir()
    written = first.stat().st_mtime_ns
    flown = fly_to(tmp_path, jr700, SHORT, count=3, seed=7, jobs=jobs)
    assert flown.found == 1
    assert first.stat().st_mtime_ns == written  # not even written again
    assert contents(tmp_path) == whole


def test_a_damaged_flight_is_flown_again(jr700, tmp_path, whole):
    """A truncated file is not taken for a flight."""
    for name, data in whole.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "lat_0002.parquet").write_bytes(whole["lat_0002.parquet"][:1000])
    ticks = []
    flown = fly_to(
        tmp_path, jr700, SHORT, count=3, seed=7, jobs=2, on_flight=lambda: ticks.append(1)
    )
    assert flown.found == 2
    assert len(ticks) == 3
    assert contents(tmp_path) == whole


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"excitation": Sweep(axis="lat", duration=9.0, trim_time=1.0)}, "excitation.duration"),
        ({"seed": 8}, "seed is 7 there and 8 here"),
        ({"pilot": Pilot(remnant=0.001)}, "pilot.remnant"),
        ({"recorder": Recorder(rate_hz=200.0)}, "recorder"),
    ],
)
def test_another_configuration_is_refused(jr700, tmp_path, whole, change, says):
    """Flights of another configuration are neither kept as ours nor overwritten."""
    (tmp_path / "lat_0003.parquet").write_bytes(whole["lat_0003.parquet"])
    seed = change.pop("seed", 7)
    plan = FlightPlan(**{"excitation": SHORT, **change})
    with pytest.raises(InputError, match=says):
        fly_to(tmp_path, jr700, plan, count=3, seed=seed)
    assert contents(tmp_path) == {"lat_0003.parquet": whole["lat_0003.parquet"]}


@pytest.fixture(scope="module")
def tight(jr700):
    """A watch that lets two of the three flights pass: the rate that the wildest one exceeds."""
    fastest = [np.abs(one.rates).max() for one in simulate(jr700, SHORT, count=3, seed=7, jobs=1)]
    return FlightEnvelope(rate=0.5 * sum(sorted(fastest)[1:])), int(np.argmax(fastest))


@pytest.mark.parametrize("jobs", [1, 3])
def test_a_flight_that_is_over_hurts_no_other(jr700, tmp_path, whole, tight, jobs):
    """The others have the numbers that they always have, in one batch too; all is kept."""
    watch, wild = tight
    flown = fly_to(
        tmp_path, jr700, FlightPlan(excitation=SHORT, envelope=watch), count=3, seed=7, jobs=jobs
    )
    assert list(flown.ended) == [flown.paths[wild]]
    (tmp_path / "whole").mkdir()
    for number, path in enumerate(flown.paths):
        kept = read_record(path)
        (tmp_path / "whole" / path.name).write_bytes(whole[path.name])
        healthy = read_record(tmp_path / "whole" / path.name)
        if number != wild:
            assert np.array_equal(kept.values, healthy.values)
            assert not kept.ended
        else:
            assert kept.ended == flown.ended[path]
            assert kept.duration < healthy.duration
    (beside,) = (tmp_path / "last_second").iterdir()
    assert beside.name == flown.paths[wild].name
    # it isn't flown again, and is told again
    again = fly_to(
        tmp_path, jr700, FlightPlan(excitation=SHORT, envelope=watch), count=3, seed=7, jobs=jobs
    )
    assert (again.found, again.ended) == (3, flown.ended)


def test_the_command_goes_on_and_says_so(tmp_path, capsys):
    """`fly --count` fills a folder, and a second call with more flights adds the missing ones."""
    arguments = ["fly", "--axis", "col", "--duration", "13", "--out", str(tmp_path)]
    assert main([*arguments, "--count", "1"]) == 0
    assert "1 flights of 13 s)" in capsys.readouterr().out
    assert main([*arguments, "--count", "2", "--jobs", "1"]) == 0
    assert "2 flights of 13 s, 1 of them there before" in capsys.readouterr().out
    assert main([*arguments, "--count", "2", "--seed", "4"]) == 2
    assert "seed is 1 there and 4 here" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--count", "0", "--out", "new"], "count must be"),
        (["--count", "2", "--out", "new", "--jobs", "0"], "jobs must be"),
        (["--count", "2", "--out", "a.parquet"], "--out is a folder"),
        (["--count", "2", "--out", "new", "--rerun", "a.rrd"], "leave out --count"),
        (["--count", "2", "--out", "file/new"], "file/new"),
    ],
)
def test_bad_input_leaves_nothing(tmp_path, monkeypatch, capsys, arguments, says):
    """A mistake is one line and status 2, and neither folder nor file appears."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert main(["fly", "--axis", "lat", "--duration", "13", "--quiet", *arguments]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
