"""ArduPilot's process is started apart from everything, and flown by scripts."""

import os
import sys
import time
from contextlib import nullcontext
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from command import fails
from helisim.base.errors import AutopilotError, InputError, UnknownNameError
from helisim.cli import main
from helisim.logs.dataflash import DataFlash
from helisim.records.storage import read_record
from helisim.sitl import isolated
from helisim.sitl.link import Sensed
from helisim.sitl.mixing import Mixer
from helisim.sitl.parameters import read_parameters
from helisim.sitl.pilot import Sticks
from helisim.sitl.process import Autopilot, find_program
from helisim.sitl.session import fly_script, script_of, told
from helisim.sitl.systemid import INTO, Sweep, sweeps
from helisim.vehicle.folder import model_folder
from script import SCRIPTS, loaded

FAKE = """#!{python}
import os, socket, struct, sys
os.makedirs("logs", exist_ok=True)
open("logs/00000001.BIN", "wb").write(b"log")
ports = sys.argv[sys.argv.index("--sim-port-out") + 1], sys.argv[sys.argv.index("--serial0") + 1]
frames, telemetry = int(ports[0]), int(ports[1].split(":")[2])
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
send = lambda data, port: sender.sendto(data, ("127.0.0.1", port))
{rest}
"""
GREETS = """
send(os.readlink("/proc/self/ns/net").encode(), frames)
send(open("start.parm").read().encode(), telemetry)
sender.recv(1)
"""
DIES = """
send(struct.pack("<HHI16H", 18458, 1000, 0, *[1000] * 16), frames)
sender.recv(4096)
print("it hurts")
sys.exit(7)
"""


def fake(tmp_path, rest):
    path = tmp_path / "program"
    path.write_text(FAKE.format(python=sys.executable, rest=rest))
    path.chmod(0o755)
    return path


class Still(nullcontext):
    """An aircraft that only waits."""

    crashed = ""
    time = 0.0
    sensed = Sensed(0.0, *np.zeros((4, 3)), np.array([1.0, 0.0, 0.0, 0.0]))

    def step(self, pulses):
        return self.sensed


def heard(socket):
    socket.setblocking(True)
    socket.settimeout(20.0)
    return socket.recv(4096)


def test_program_is_started_in_a_folder_and_a_network_of_its_own(tmp_path):
    """It finds its parameters there, reaches both sockets, and nothing is left at the end."""
    with Autopilot(fake(tmp_path, GREETS), "NAME 1\n") as autopilot:
        network = heard(autopilot.frames).decode()
        assert heard(autopilot.telemetry) == b"NAME 1\n"
        own = network != os.readlink("/proc/self/ns/net")
        assert own == (autopilot.shared == "")
        autopilot.check()
        autopilot.keep_log(tmp_path / "kept.bin")
        folder = autopilot.folder
    assert (tmp_path / "kept.bin").read_bytes() == b"log"
    assert not folder.exists()


def test_program_shares_the_network_where_it_may_have_none_of_its_own(tmp_path, monkeypatch):
    """The reason is told; it is flown all the same, on ports that nobody else has."""
    source = Path(isolated.__file__).read_text(encoding="utf-8")
    refused = tmp_path / "refused.py"
    refused.write_text(source.replace("= 0x10000000, 0x40000000", "= -1, -1"))
    monkeypatch.setattr(isolated, "__file__", str(refused))
    with Autopilot(fake(tmp_path, GREETS), "") as autopilot:
        assert autopilot.shared.startswith("network namespaces are not permitted: Invalid")
        assert heard(autopilot.frames).decode() == os.readlink("/proc/self/ns/net")


def test_program_that_ends_in_flight_ends_the_flight_at_once(tmp_path):
    """Its status and last words are told; nobody waits for the frames of the dead."""
    begun = time.monotonic()
    with pytest.raises(AutopilotError, match="status 7; its last words: it hurts"):
        fly_script(lambda pilot: pilot.wait(9.0), Still(), fake(tmp_path, DIES), "")
    assert time.monotonic() - begun < 20.0  # it waits 30 s for one that lives


def test_program_that_is_killed_is_told_with_what_it_said_last(tmp_path):
    """The signal is named, and a line that was printed many times is told once."""
    killed = DIES.replace(
        "sys.exit(7)", 'print("it hurts\\n" * 9, flush=True); os.kill(os.getpid(), 9)'
    )
    with pytest.raises(AutopilotError, match=r"by signal 9; its last words: it hurts$"):
        fly_script(lambda pilot: pilot.wait(9.0), Still(), fake(tmp_path, killed), "")


@pytest.mark.parametrize("words", [[], ["--script", "hover"]])
def test_options_of_sweeps_are_refused_where_none_are_flown(capsys, words):
    """An option that does nothing is not taken in silence, 0 neither."""
    assert main(["sitl", *words, "--axes", "yaw", "--from", "0"]) == 2
    assert "--axes, --from: of the sweeps that --script sysid flies" in capsys.readouterr().err


def test_program_that_is_none_is_told(tmp_path):
    """The system's own reason is part of the message."""
    none = tmp_path / "program"
    none.write_text("#!/no/such/interpreter\n")
    none.chmod(0o755)
    with pytest.raises(InputError, match=r"can't be started.*No such file"):
        Autopilot(none, "")
    with pytest.raises(InputError, match="is not a program"):
        find_program(tmp_path / "nothing")


def test_no_program_is_known_without_its_variable(monkeypatch):
    monkeypatch.delenv("HELISIM_ARDUPILOT", raising=False)
    with pytest.raises(InputError, match="set HELISIM_ARDUPILOT"):
        find_program()


def test_axes_have_ardupilots_numbers():
    """ArduPilot's parameter list, SID_AXIS: 1 input roll angle to 19 input longitudinal velocity.

    Lateral comes before longitudinal, as roll before pitch.
    """
    numbers = [number for place in INTO.values() for number in place.numbers.values()]
    assert numbers == list(range(1, 20))
    assert INTO["mixer"].numbers == {"roll": 10, "pitch": 11, "yaw": 12, "thrust": 13}


def test_every_name_of_an_axis_means_the_same_sweep():
    assert sweeps(["lat", "lon", "ped", "col"]) == sweeps(["roll", "pitch", "yaw", "heave"])
    assert sweeps(["thrust"]) == sweeps(["col"])


def test_sweeps_are_changed_and_repeated():
    made = sweeps(["roll", "thrust"], ["rate", "mixer"], count=2, magnitude=3.0)
    assert [(one.into, one.axis, one.magnitude) for one in made] == [
        *[("rate", "roll", 3.0)] * 2,
        *[("mixer", "roll", 3.0)] * 2,
        *[("mixer", "thrust", 3.0)] * 2,
    ]
    assert made[0].parameters["SID_AXIS"] == 7


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"start_hz": 0.0}, "above 0"),
        ({"stop_hz": 0.1}, "to a higher one"),
        ({"seconds": 256.0}, "at most 255"),
        ({"seconds": 9.0}, "two periods"),
        ({"magnitude": 0.0}, "magnitude"),
        ({"fade_in": 21.0}, "fades in"),
    ],
)
def test_sweeps_that_ardupilot_could_not_fly_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        sweeps(["roll"], **changes)


def test_axes_and_places_that_do_not_exist_are_told():
    with pytest.raises(UnknownNameError, match="roll"):
        sweeps(["rol"])
    with pytest.raises(UnknownNameError, match="mixer"):
        sweeps(["roll"], ["mixr"])
    with pytest.raises(InputError, match="adds nothing to rate of thrust"):
        sweeps(["thrust"], ["rate"])


def test_sticks_are_the_usual_channels():
    """Roll, pitch, throttle, yaw on 1 to 4, the motor's interlock on 8: ArduPilot's usual ones."""
    pulses = Sticks(roll=1.0, pitch=-1.0, throttle=0.25, yaw=0.5, rotor=True).pulses
    assert pulses == [2000, 1000, 1250, 1750, 1000, 1000, 1000, 2000]
    assert Sticks().pulses == [1500, 1500, 1000, 1500, 1000, 1000, 1000, 1000]


def test_own_script_is_a_generator_called_fly(tmp_path):
    own = tmp_path / "own.py"
    own.write_text("def fly(pilot):\n    yield from pilot.wait(1.0)\n")
    assert script_of(str(own)).__name__ == "fly"
    for text, message in [
        ("def fly(pilot):\n    return 1\n", "yield from"),
        ("", "expected a function"),
        ("1 / 0", "ZeroDivisionError"),
    ]:
        own.write_text(text)
        with pytest.raises(InputError, match=message):
            script_of(str(own))
    with pytest.raises(UnknownNameError, match="hover, square, sysid"):
        script_of("hovr")
    with pytest.raises(InputError, match="no such file"):
        script_of(str(tmp_path / "other.py"))


def test_what_an_own_script_does_wrong_is_told_with_its_line(tmp_path):
    """In one line; a traceback would end in the user's line after twenty of ours."""
    path = tmp_path / "wrong.py"
    path.write_text("def fly(pilot):\n    yield\n    pilot.climb(3)\n")
    steps = told(script_of(str(path)), object())
    next(steps)
    with pytest.raises(InputError, match=r"wrong\.py, line 3: AttributeError: .*climb"):
        next(steps)


def test_a_sweep_is_told_with_its_units():
    sweep = sweeps(["yaw"], ["rate"])[0]
    assert str(sweep).startswith("SystemID axis 9, rate yaw: 15 deg/s, 0.2 to 12 Hz in 90 s")
    assert {one.name for one in fields(Sweep)} >= {"fade_in", "fade_out"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--script", "hovr"], "hover"),
        (["--script", "sysid"], "--log FILE.bin"),
        (["--script", "sysid", "--log", "out.txt"], "suffix"),
        (["--script", "sysid", "--log", "out.bin", "--axes", "rol"], "roll"),
        (["--script", "sysid", "--log", "out.bin", "--height", "2"], "--height"),
        (["--script", "hover", "--speed", "0"], "--speed"),
        (["--script", "hover"], "set HELISIM_ARDUPILOT"),
        (["--script", "hover", "--ardupilot", "nothing"], "is not a program"),
        (["--script", "hover", "--ardupilot", sys.executable, "--tail", "gyro"], "H_TAIL_TYPE 1"),
        (["--script", "hover", "--ardupilot", sys.executable, "--parm", "no.parm"], "no.parm"),
        (["--log", "out.bin"], "--script"),
    ],
)
def test_what_can_not_be_flown_is_one_line(words, message, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("HELISIM_ARDUPILOT", raising=False)
    assert message in fails(capsys, "sitl", *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_own_flight_goes_from_the_ground_to_the_ground(ardupilot, tmp_path, capsys):
    """The shipped example, by the real autopilot: off the ground and back; its log is whole."""
    record, log = tmp_path / "flight.parquet", tmp_path / "flight.bin"
    script = [SCRIPTS / "own_flight.py", "--log", log, "--record", record]
    done = main(["sitl", "--ardupilot", str(ardupilot), "--script", *map(str, script)])
    printed = capsys.readouterr()
    assert done == 0, printed.err
    assert "to the right" in printed.err
    flown = read_record(record)
    height = flown["down"][0] - flown["down"]
    assert 2.7 < height.max() < 3.3  # it is there from within 0.3 m on
    assert abs(height[-1]) < 0.02
    assert flown["rotor_speed"][-1] < 0.02 * flown["rotor_speed"].max()
    written = DataFlash(log)
    assert written.skipped == 0
    assert written.table("DSF")["Dp"][-1] == 0
    assert written.table("RATE").time[-1] > flown.duration - 60.0
    its_parameters_were_taken(written)
    its_pulses_are_repeated(written)


def its_parameters_were_taken(log):
    """Each name of the shipped file is one of ArduPilot's, and no value was limited or refused."""
    shipped = read_parameters(model_folder("jr700") / "jr700.parm")
    taken = log.parameters()
    for name, value in shipped.items():
        if not name.startswith("LOG_"):  # which a script sets as it goes
            assert taken[name] == pytest.approx(value, rel=1e-6), name  # single precision


def its_pulses_are_repeated(log):
    """Our mixing of the rate controllers' outputs gives the pulses that it sent, all the flight.

    RCOU is logged ten times a second, between ticks: the tail's is of the tick before. On the
    ground the collective is limited, which RATE doesn't tell.
    """
    mixer = Mixer.of(log.parameters())
    rate, sent = log.table("RATE"), log.table("RCOU")
    names = {"lat": "ROut", "lon": "POut", "ped": "YOut", "col": "AOut"}
    wanted = [
        dict(zip(names, map(float, row))) for row in zip(*(rate.columns[n] for n in names.values()))
    ]
    last = np.searchsorted(rate.time, sent.time, side="right") - 1
    same = []
    for k, row in enumerate(last):
        if row > 0 and wanted[row]["col"] > 0.3:
            pulses = mixer.pulses(wanted[row]) | {4: mixer.pulses(wanted[row - 1])[4]}
            same.append([pulses[n] == sent.columns[f"C{n}"][k] for n in (1, 2, 3, 4)])
    assert len(same) > 50
    assert np.mean(same, axis=0).min() > 0.9


@pytest.mark.slow
def test_two_flights_are_the_same_to_the_last_bit(ardupilot, tmp_path):
    """Ten seconds of each, in which the autopilot starts; the proof flies for minutes."""
    proof = loaded("proof/autopilot_flights")
    first, second = (
        proof.flown(lambda pilot: pilot.wait(10.0), ardupilot, tmp_path, armed=False)
        for _ in range(2)
    )
    assert first.record == second.record
    assert first.flight.served.frames > 10_000
