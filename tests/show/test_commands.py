"""The commands `record` and `report`: what they write."""

from pathlib import Path

import pytest

from command import fails
from helisim.cli import main
from helisim.records.storage import write_record
from made_run import make_flight, write_run


def test_a_log_becomes_a_recording(tmp_path, capsys):
    log, out = tmp_path / "a.parquet", tmp_path / "a.rrd"
    write_record(make_flight(), log)
    assert main(["record", str(log), "--out", str(out)]) == 0
    assert f"rerun {out}" in capsys.readouterr().out
    assert out.stat().st_size > 0
    assert main(["record", str(log), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_run_becomes_a_recording_and_a_report(tmp_path, capsys):
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
    both = [str(tmp_path / f"{name}.parquet") for name in ("blade360", "jr700")]
    for path in both:
        write_record(make_flight(vehicle=Path(path).stem), path)
    out = ["--out", str(tmp_path / "a.rrd")]
    assert main(["record", both[0], *out]) == 0
    assert drawn[0].startswith(b"blade360 ")
    capsys.readouterr()
    assert "'blade360', 'jr700'" in fails(capsys, "record", *both, *out)
