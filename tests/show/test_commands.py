"""The commands `record`, `report` and `view`: what they write, and how they fail."""

from dataclasses import replace

import pytest

from command import fails
from helisim.cli import main
from helisim.cli.options import write_recording
from helisim.records.record import CHANNELS, ROTOR
from helisim.records.storage import read_record, write_record
from made_run import make_flight, write_run


def test_a_log_becomes_a_recording(tmp_path, capsys):
    """`record` writes the recording and says how to open it; --quiet says nothing."""
    log, out = tmp_path / "a.parquet", tmp_path / "a.rrd"
    write_record(make_flight(), log)
    assert main(["record", str(log), "--out", str(out)]) == 0
    assert f"rerun {out}" in capsys.readouterr().out
    assert out.stat().st_size > 0
    assert main(["record", str(log), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


def test_a_log_file_is_told_of_each_flight_read_and_recorded(tmp_path, capsys, monkeypatch):
    """With every line of progress shown: the logs as they are read, then as they are recorded."""
    monkeypatch.setattr("helisim.cli.options._SILENT", 0.0)
    monkeypatch.setattr("helisim.cli.options._INTERVAL", 0.0)
    logs = [tmp_path / "a.parquet", tmp_path / "b.parquet"]
    for log in logs:
        write_record(make_flight(), log)
    out = tmp_path / "two.rrd"
    command = ["record", *map(str, logs), "--out", str(out)]
    assert main(command) == 0
    lines = [line.rpartition(",")[0] for line in capsys.readouterr().err.splitlines()]
    steps = ("a read", "b read", "a", "b")
    assert lines == [f"{what}: step {k} of 4" for k, what in enumerate(steps, start=1)]
    assert main([*command, "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_a_recording_beside_flights_is_progress(tmp_path, capsys, monkeypatch):
    """What `fly --rerun` and `reproduce --rerun` write says how far it is, then how to open it."""
    monkeypatch.setattr("helisim.cli.options._SILENT", 0.0)
    write_recording(tmp_path / "a.rrd", {"lat": make_flight()})
    said = capsys.readouterr()
    assert said.err.startswith("lat: flight 1 of 1")
    assert f"rerun {tmp_path / 'a.rrd'}" in said.out


def test_flights_without_rotor_are_told_how_to_get_arrows(tmp_path, capsys):
    """The option is named where a disc can't tilt, and not where it can."""
    plain, full = tmp_path / "plain.parquet", tmp_path / "full.parquet"
    write_record(make_flight(tuple(name for name in CHANNELS if name not in ROTOR)), plain)
    write_record(make_flight(), full)
    assert main(["record", str(plain), "--out", str(tmp_path / "a.rrd")]) == 0
    assert "helisim fly --rotor" in " ".join(capsys.readouterr().out.split())
    assert main(["record", str(full), "--out", str(tmp_path / "a.rrd")]) == 0
    assert "--rotor" not in capsys.readouterr().out


def test_fly_records_the_rotor_on_request(tmp_path):
    """`fly --rotor` adds the rotor's channels to the record."""
    out = tmp_path / "lat.parquet"
    assert main(["fly", "--axis", "lat", "--duration", "13", "--rotor", "--out", str(out)]) == 0
    assert set(ROTOR) <= set(read_record(out).names)


@pytest.mark.slow
def test_a_run_becomes_a_recording_and_a_report(tmp_path, capsys):
    """`record DIR` takes all flights and the findings; `report DIR` writes page and figures."""
    write_run(tmp_path)
    assert main(["record", str(tmp_path), "--out", str(tmp_path / "run.rrd")]) == 0
    capsys.readouterr()
    assert main(["report", str(tmp_path)]) == 0
    assert f"Written: {tmp_path / 'report.html'}" in capsys.readouterr().out
    figures = list((tmp_path / "figures").iterdir())
    assert len(figures) == 5 + 2 + 1  # pairs, sweeps, a verification


def test_the_vehicle_that_flew_is_drawn(tmp_path, capsys, monkeypatch):
    """The Blade 360's flight shows a Blade 360; two vehicles do not fit into one recording."""
    drawn = []
    monkeypatch.setattr(
        "helisim.show.recording.write_recording",
        lambda path, flights, *, model, **_: drawn.append(model.names),
    )
    for name in ("blade360", "jr700"):
        record = make_flight()
        write_record(
            replace(record, provenance={**record.provenance, "vehicle": name}),
            tmp_path / f"{name}.parquet",
        )
    out = ["--out", str(tmp_path / "a.rrd")]
    assert main(["record", str(tmp_path / "blade360.parquet"), *out]) == 0
    assert drawn[0].startswith(b"blade360 ")
    capsys.readouterr()
    both = [str(tmp_path / f"{name}.parquet") for name in ("blade360", "jr700")]
    assert "blade360, jr700" in fails(capsys, "record", *both, *out)


def test_mistakes_end_in_one_line(tmp_path, capsys, monkeypatch):
    """Each says what is wrong, and no file stays behind."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert "no such file" in fails(capsys, "record", "a.parquet", "--out", "a.rrd")
    assert ".rrd" in fails(capsys, "record", "a.parquet", "--out", "a.txt")
    assert "results.json" in fails(capsys, "record", ".", "--out", "a.rrd")
    assert "results.json" in fails(capsys, "report", ".")
    assert "results.json" in fails(capsys, "report", "absent")
    assert "available: col, lon, lat, ped" in fails(capsys, "view", "--axis", "roll")
    assert "--duration" in fails(capsys, "view", "--duration", "nan")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [[], ["--axis", "lat"]])
def test_a_view_needs_a_display(capsys, monkeypatch, arguments):
    """Without one, the message names the way that needs none."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("helisim.show.viewer.sys.platform", "linux")
    assert "`helisim fly` writes a recording" in fails(capsys, "view", *arguments)
