"""Manoeuvres, missions and grounds on the command line, and flights beside an autopilot."""

import shutil
import signal
import socket
import threading
import tomllib
from pathlib import Path

import pytest

import helisim.sitl
import lock_step
import played_autopilot as played
from command import fails
from helisim.cli import main
from helisim.cli.flying import _commands
from helisim.records.storage import read_record
from helisim.sim import Chirp, Deck, FlightPlan, Swing
from helisim.sitl import Link
from tabled import section, tabled


@pytest.fixture
def planned(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def excitation(*arguments):
        assert main(["fly", *arguments, "--print-plan"]) == 0
        return FlightPlan.from_dict(tomllib.loads(capsys.readouterr().out)).excitation

    return excitation


def test_settings_are_numbers_lists_and_texts_and_plans_nest_parts(planned, tmp_path):
    wanted = Chirp(axis="ped", amplitude=0.02, band=(1.0, 30.0), at="actuators")
    asked = "chirp,axis=ped,amplitude=0.02,band=1:30,at=actuators"
    assert planned("--excitation", asked) == wanted
    general = ["--axis", "ped", "--amplitude", "0.02", "--at", "actuators"]
    assert planned("--excitation", "chirp,band=1:30", *general) == wanted
    given = planned("--excitation", "multisine,axis=lat+ped,amplitude=0.05:0.01,period=10")
    assert (given.axis, given.amplitude, given.period) == ("lat+ped", (0.05, 0.01), 10.0)
    shutil.copy(Path(__file__).with_name("sequence.toml"), tmp_path / "plan.toml")
    assert planned("--plan", "plan.toml").duration == 11.5
    assert main(["fly", "--plan", "plan.toml", "--out", "flown.parquet", "--quiet"]) == 0
    assert read_record("flown.parquet").duration == pytest.approx(11.5, abs=0.01)


MINE = section(globals(), "MINE")


def test_a_mission_of_ones_own_is_flown(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_missions.py").write_text(MINE)
    assert main(["fly", "--mission", "my_missions:Nod,north=0.5", "--out", "a.parquet"]) == 0
    assert "Reached: up to" in capsys.readouterr().out
    assert read_record("a.parquet").provenance["mission"]["north"] == 0.5


@pytest.mark.parametrize(("word", "name"), [("roll", "lat"), ("heave", "col"), ("yaw+p", "ped+p")])
def test_axes_are_known_by_their_motion(word, name):
    assert _commands(word) == name
    assert _commands(f"doublet,axis={word},amplitude=0.1") == f"doublet,axis={name},amplitude=0.1"


FLY = ["fly", "--excitation", "doublet", "--axis", "ped"]
HEAVE, ROLL = Swing(amplitude=0.3, period=6.0), Swing(amplitude=0.05, period=8.0)
SEA = Deck(length=8.0, heave=HEAVE, roll=ROLL)


@tabled("text", "meant")
def test_the_plan_has_the_ground_that_is_asked_for(capsys, tmp_path, text, meant):
    assert main([*FLY, "--ground", text, "--print-plan"]) == 0
    printed = capsys.readouterr().out
    assert FlightPlan.from_dict(tomllib.loads(printed)).ground == meant
    path = tmp_path / "plan.toml"
    path.write_text(printed)
    assert main(["fly", "--plan", str(path), "--print-plan"]) == 0
    assert capsys.readouterr().out == printed


def test_a_flight_is_recorded_over_its_ground(tmp_path, capsys):
    out = tmp_path / "deck.parquet"
    assert main([*FLY, "--ground", "deck,heave=0.3/6,parked", "--rotor", "--out", str(out)]) == 0
    record = read_record(out)
    assert FlightPlan.of_record(record).ground.deck.heave == HEAVE
    assert record["contact"][0] > 70.0
    assert record.ended == ""


@pytest.fixture
def counting(monkeypatch):
    monkeypatch.setattr(helisim.sitl, "Aircraft", lambda *_, **__: lock_step.Counting())


def test_no_autopilot_and_another_protocol(capsys, counting, monkeypatch):
    said = fails(capsys, "sitl", "--port", 0, "--wait", 0.01, "--quiet")
    assert "no autopilot sent a frame" in said
    assert "arducopter-heli --model JSON:127.0.0.1" in said
    receive = Link.receive

    def hello(link, *given, **more):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.sendto(b"hello", ("127.0.0.1", link.port))
        return receive(link, *given, **more)

    monkeypatch.setattr(Link, "receive", hello)
    said = fails(capsys, "sitl", "--port", 0, "--wait", 0.5, "--quiet")
    assert "no autopilot sent a frame" in said
    assert (
        "what came was a packet of 5 bytes with the magic number 25960; expected 18458 or 29569"
        in said
    )


def served(frames, *arguments):
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
    record, recording = tmp_path / "flown.parquet", tmp_path / "flown.rrd"
    status, _ = served(300, "--record", record, "--rerun", recording)
    assert status == 0
    assert read_record(record).duration == pytest.approx(0.3, abs=0.02)
    assert recording.stat().st_size > 10_000
    assert f"Written: {record} (0." in capsys.readouterr().out
    assert served(10, "--record", tmp_path / "short.parquet")[0] == 0
    assert "Not written: a flight of" in capsys.readouterr().out
    assert not (tmp_path / "short.parquet").exists()
