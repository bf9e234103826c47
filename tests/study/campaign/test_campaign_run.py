"""Running a campaign: complete, kept when interrupted, gone on with, honest about failure."""

import re
import tomllib
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import helisim as hs
from command import fails
from helisim.base.errors import InputError, StorageError, WorkerError
from helisim.cli import main
from helisim.records.record import versions
from helisim.sim import Recorder
from helisim.study.campaign import campaign_from
from helisim.study.comparison import identify_model
from helisim.study.models import HEAVE
from helisim.study.replicates import read_dataset, run_campaign
from helisim.study.truth import true_values
from tabled import section, tabled

PLAN = Path(__file__).with_name("heave_plan.toml").read_text(encoding="utf-8")
ROWS = 2 * 2 * 2 * 3  # points, methods, numbers of flights, parameters


def plan(text=PLAN):
    return campaign_from(tomllib.loads(text))


def here(work, tasks):
    for task in reversed(tasks):
        yield work(task)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return run_campaign(plan(), tmp_path_factory.mktemp("whole"), executor=here)


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_the_dataset_is_what_the_pipeline_finds(whole):
    table, provenance = read_dataset(whole)
    assert table.num_rows == ROWS
    wanted = {"replicate": 1, "flights": 2, "method": "designed"}
    rows = [row for row in table.to_pylist() if wanted.items() <= row.items()]
    vehicle = hs.load("jr700")
    noise = {name: 4 * level for name, level in Recorder().noise.items()}
    recorder = Recorder(noise=noise, latency=Recorder.of(vehicle).latency)
    sweep = hs.Sweep(axis="col", duration=30.0)
    # col is axis 0 of 4, and the second replicate has seed 3 + 1
    plan_ = hs.FlightPlan(excitation=sweep, recorder=recorder)
    fit = identify_model(HEAVE, {"col": hs.fly(vehicle, plan_, count=2, seed=4 * 4)})
    truth = true_values(vehicle, HEAVE, recorder)
    assert [row["parameter"] for row in rows] == list(fit.values)
    for row in rows:
        found = fit[row["parameter"]]
        # 1e-6: this process may use more threads in BLAS, which changes the last bits
        assert row["estimate"] == pytest.approx(found.value, rel=1e-6)
        for name in ("cramer_rao", "insensitivity", "standard_error"):
            assert row[name] == pytest.approx(getattr(found, name), rel=1e-6)
        assert row["truth"] == pytest.approx(truth[row["parameter"]], rel=1e-9)
        assert row["cost"] == pytest.approx(fit.cost, rel=1e-6)
        assert (row["recorder.noise"], row["seed"], row["point"]) == (4.0, 4, 1)
        assert row["flight_time"] == pytest.approx(60.0, abs=1e-6)
        assert row["failure"] is None
    assert provenance["campaign"]["models"] == ["heave"]
    assert set(provenance["versions"]) >= {"helisim", "mujoco", "numpy", "scipy"}


@pytest.mark.slow
def test_an_interrupted_campaign_goes_on_to_the_same_bytes(tmp_path, whole):

    def interrupt():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(plan(), tmp_path, executor=here, on_replicate=interrupt)
    assert list(contents(tmp_path)) == ["parts/000001.parquet"]
    (tmp_path / "parts" / "000000.parquet").write_bytes(b"PAR1 cut short")
    done, ticks = [], []

    def counting(work, tasks):
        done.extend(task.number for task in tasks)
        yield from here(work, tasks)

    path = run_campaign(plan(), tmp_path, executor=counting, on_replicate=lambda: ticks.append(1))
    assert done == [0]
    assert len(ticks) == 2
    assert contents(tmp_path) == {"dataset.parquet": whole.read_bytes()}
    before = path.stat().st_mtime_ns
    assert run_campaign(plan(), tmp_path, executor=None) == path  # nothing is left to do
    assert path.stat().st_mtime_ns == before


@pytest.mark.parametrize("place", ["dataset.parquet", "parts/000000.parquet"])
def test_another_campaign_in_the_folder_is_refused(tmp_path, whole, place):
    (tmp_path / "parts").mkdir()
    (tmp_path / place).write_bytes(whole.read_bytes())
    with pytest.raises(InputError, match=r"another campaign: campaign\.seed is 3 there and 4"):
        run_campaign(plan(PLAN.replace("seed = 3", "seed = 4")), tmp_path, executor=here)
    assert contents(tmp_path) == {place: whole.read_bytes()}


@tabled("setting", "reason")
def test_a_replicate_that_fails_says_why(tmp_path, setting, reason):
    text = f"{section(globals(), 'FAILS')}\n{setting}"
    table, _ = read_dataset(run_campaign(plan(text), tmp_path, executor=here))
    rows = table.to_pylist()
    assert [row["parameter"] for row in rows] == ["Z_w", "Z_col", "tau_col"] * 2
    for row in rows[:3]:
        assert row["failure"] is None
        assert row["estimate"] is not None
    for row in rows[3:]:
        assert re.search(reason, row["failure"])
        assert row["estimate"] is row["standard_error"] is row["truth"] is None


@pytest.mark.slow
def test_doubts_are_kept_with_the_estimate(tmp_path, recwarn):
    text = section(globals(), "DOUBTS")
    table, _ = read_dataset(run_campaign(plan(text), tmp_path, executor=here))
    assert {"cross-control" in row["flags"] for row in table.to_pylist()} == {True}
    assert not list(recwarn)


def test_a_worker_that_would_give_other_numbers_is_refused(tmp_path, monkeypatch):
    def elsewhere(work, tasks):
        other = {**versions(), "numpy": "1.0"}
        monkeypatch.setattr("helisim.study.replicates.versions", lambda: other)
        yield from here(work, tasks)

    with pytest.raises(WorkerError, match=r"numpy is '1\.0' there"):
        run_campaign(plan(), tmp_path, executor=elsewhere)


def test_other_files_are_no_datasets(tmp_path, whole):
    path, (table, _) = tmp_path / "dataset.parquet", read_dataset(whole)
    with pytest.raises(StorageError, match="no such file"):
        read_dataset(tmp_path)
    path.write_bytes(whole.read_bytes()[:500])
    with pytest.raises(StorageError, match="truncated"):
        read_dataset(path)
    for metadata, says in (
        (None, "not a campaign's dataset"),
        ({"helisim": '{"format": "x"}'}, "'x'"),
    ):
        pq.write_table(table.replace_schema_metadata(metadata), path)
        with pytest.raises(StorageError, match=says):
            read_dataset(path)


def test_the_command_summarises_a_dataset(whole, capsys, tmp_path):
    assert main(["study", "campaign", str(whole.parent), "--by", "recorder.noise"]) == 0
    printed = capsys.readouterr().out
    assert "heave (recorder.noise 0.5, flights 1, method designed)" in printed
    assert "heave (recorder.noise 4, flights 2, method joint)" in printed
    assert "Z_col" in printed
    assert max(map(len, printed.splitlines())) <= 80
    before = contents(whole.parent)
    mistakes = {("--by", "noise"): "available: replicate, point"}
    mistakes["--out", tmp_path / "new"] = "leave out --out"
    for options, said in mistakes.items():
        assert said in fails(capsys, "study", "campaign", whole.parent, "--quiet", *options)
    assert contents(whole.parent) == before
    assert not any(tmp_path.iterdir())
