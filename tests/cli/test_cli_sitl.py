"""`helisim sitl`: what is wrong is one line, exit status 2; a flight, its summary and record."""

import signal
import socket
import sys
import threading

import pytest

import helisim.sitl
from command import fails
from helisim.cli import main
from helisim.records.storage import read_record
from helisim.sitl import Link
from script import SCRIPTS

sys.path.insert(0, str(SCRIPTS / "proof"))

import lock_step
import played_autopilot as played


@pytest.fixture
def counting(monkeypatch):
    """Let an aircraft fly that only counts."""
    monkeypatch.setattr(helisim.sitl, "Aircraft", lambda *_, **__: lock_step.Counting())


def test_no_autopilot(capsys, counting):
    said = fails(capsys, "sitl", "--port", 0, "--wait", 0.01, "--quiet")
    assert "no autopilot sent a frame" in said
    assert "arducopter-heli --model JSON:127.0.0.1" in said


def test_another_protocol(capsys, counting, monkeypatch):
    receive = Link.receive

    def hello(link, *given, **more):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(b"hello", ("127.0.0.1", link.port))
        return receive(link, *given, **more)

    monkeypatch.setattr(Link, "receive", hello)
    said = fails(capsys, "sitl", "--port", 0, "--quiet")
    assert "a packet of 5 bytes with the magic number 25960; expected 18458 or 29569" in said


def served(frames, *arguments):
    """Run the command while a played autopilot flies; return its status and port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    autopilot = played.PlayedAutopilot(port, resend=0.05)
    thread = threading.Thread(target=lambda: [autopilot.frame((1500,) * 8) for _ in range(frames)])
    thread.start()
    status = main(["sitl", *map(str, arguments), "--port", str(port), "--wait", "0.5"])
    thread.join()
    autopilot.close()
    return status, port


def test_a_flight_ends_with_a_summary(capsys, counting):
    status, port = served(50)
    assert status == 0
    printed = capsys.readouterr()
    assert f"Listening on UDP 127.0.0.1:{port}" in printed.out
    assert f"--model JSON:127.0.0.1 --sim-port-out {port} --defaults jr700.parm" in printed.out
    assert "16 channels, 1200 Hz wanted" in printed.err
    assert printed.out.splitlines()[-1].startswith("Flown: 0.1 s")
    assert "50 frames" in printed.out


@pytest.mark.parametrize("polite", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_flight_with_its_summary(capsys, counting, monkeypatch, polite):
    receive, calls = Link.receive, []

    def ended(link, timeout=None, **more):
        if timeout is None:
            calls.append(more)
        if len(calls) > 20:
            signal.raise_signal(polite)
        return receive(link, timeout, **more)

    monkeypatch.setattr(Link, "receive", ended)
    assert served(20)[0] == 0
    assert len(calls) == 21
    assert "20 frames; " in capsys.readouterr().out


@pytest.mark.slow
def test_what_was_flown_is_written(capsys, tmp_path):
    """Each start of the autopilot has a record; one too short for it is told."""
    record, recording = tmp_path / "flown.parquet", tmp_path / "flown.rrd"
    status, _ = served(300, "--record", record, "--rerun", recording)
    assert status == 0
    assert read_record(record).duration == pytest.approx(0.3, abs=0.02)
    assert recording.stat().st_size > 10_000
    assert f"Written: {record} (0." in capsys.readouterr().out
    assert served(10, "--record", tmp_path / "short.parquet")[0] == 0
    assert "Not written: a flight of" in capsys.readouterr().out
    assert not (tmp_path / "short.parquet").exists()
