"""`helisim sitl`: what is wrong is one line, exit status 2."""

import socket

import pytest

import helisim.sitl.aircraft
from command import fails
from helisim.cli import main
from script import loaded

played = loaded("proof/played_autopilot")


@pytest.fixture
def counting(monkeypatch):
    """Let an aircraft fly that only counts."""
    monkeypatch.setattr(helisim.sitl.aircraft, "Aircraft", lambda *_, **__: played.Counting())


@pytest.fixture
def taken():
    """A UDP port that another program listens on."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        yield other.getsockname()[1]


def test_a_port_that_is_taken(capsys, taken):
    said = fails(capsys, "sitl", "--port", taken)
    assert f"UDP port {taken} of 127.0.0.1 can't be bound" in said
    assert "--sim-port-out" in said


def test_no_autopilot(capsys, counting):
    said = fails(capsys, "sitl", "--port", 0, "--wait", 0.01, "--quiet")
    assert "no autopilot sent a frame" in said
    assert "arducopter-heli --model JSON:127.0.0.1" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--wait", "0"], "--wait must be above 0 s"),
        (["--wait", "nan"], "--wait must be above 0 s"),
        (["--send", "battery"], "unknown field of an answer 'battery'; available: airspeed"),
        (["--port", "99999"], "a UDP port is 1 to 65535, got 99999"),
        (["--address", "nowhere.invalid"], "can't be bound"),
        (["nosuch"], "unknown vehicle 'nosuch'"),
    ],
)
def test_what_can_not_be_is_refused(capsys, arguments, said):
    assert said in fails(capsys, "sitl", *arguments)


def test_a_flight_ends_with_a_summary(capsys, counting, monkeypatch):
    """What it listens on and how to start, what comes, and at the end what was flown."""
    import threading

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    autopilot = played.PlayedAutopilot(port, resend=0.05)
    thread = threading.Thread(target=lambda: [autopilot.frame((1000,)) for _ in range(50)])
    thread.start()
    assert main(["sitl", "--port", str(port), "--wait", "0.5"]) == 0
    thread.join()
    autopilot.close()
    printed = capsys.readouterr()
    assert f"Listening on UDP 127.0.0.1:{port}" in printed.out
    assert f"--model JSON:127.0.0.1 --sim-port-out {port}" in printed.out
    assert "16 channels, 1200 Hz wanted" in printed.err
    assert printed.out.splitlines()[-1].startswith("Flown: 0.1 s")
    assert "50 frames" in printed.out
