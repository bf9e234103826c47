"""ArduPilot's process is started apart from everything, and flown by scripts."""

import sys
import time

import numpy as np
import pytest

from helisim.base.errors import AutopilotError, InputError
from helisim.cli import main
from helisim.logs.dataflash import DataFlash
from helisim.records.storage import read_record
from helisim.sitl.link import Link, Sensed
from helisim.sitl.mixing import Mixer
from helisim.sitl.process import Autopilot
from helisim.sitl.session import fly_script, script_of
from helisim.sitl.systemid import sweeps
from helisim.vehicle.parameters import model_folder
from parm_file import parm_file
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
send(struct.pack("<HHI16H", 18458, 1000, 0, *[1000] * 16), frames)
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


class Still:
    """An aircraft that only waits."""

    crashed = ""
    time = 0.0
    sensed = Sensed(0.0, *np.zeros((4, 3)), np.array([1.0, 0.0, 0.0, 0.0]))

    def step(self, pulses):
        return self.sensed


def test_program_is_started_in_a_folder_of_its_own(tmp_path):
    with Link(0) as link, Autopilot(fake(tmp_path, GREETS), "NAME 1\n", link.port) as autopilot:
        assert link.receive(20.0).pulses == (1000,) * 16
        autopilot.telemetry.settimeout(20.0)
        assert autopilot.telemetry.recv(4096) == b"NAME 1\n"
        autopilot.check()
        autopilot.keep_log(tmp_path / "kept.bin")
        folder = autopilot.folder
    assert (tmp_path / "kept.bin").read_bytes() == b"log"
    assert not folder.exists()


def test_program_that_ends_in_flight_ends_the_flight_at_once(tmp_path):
    """Its status and last words are told; nobody waits for the frames of the dead."""
    begun = time.monotonic()
    with pytest.raises(AutopilotError, match="status 7; its last words: it hurts"):
        fly_script(lambda pilot: pilot.wait(9.0), Still(), fake(tmp_path, DIES), "")
    assert time.monotonic() - begun < 20.0  # it waits 30 s for one that lives


def test_program_that_is_none_is_told(tmp_path):
    """The system's own reason is part of the message."""
    none = tmp_path / "program"
    none.write_text("#!/no/such/interpreter\n")
    none.chmod(0o755)
    with pytest.raises(InputError, match=r"can't be started.*No such file"):
        Autopilot(none, "")


def test_sweeps_have_ardupilots_numbers():
    """ArduPilot's parameter list, SID_AXIS: 10 to 13 are the mixer's."""
    made = sweeps(["lat", "pitch", "ped", "heave", "thrust"], magnitude=0.1)
    assert [one.parameters["SID_AXIS"] for one in made] == [10, 11, 12, 13, 13]
    assert {one.magnitude for one in made} == {0.1}


def test_own_script_is_a_generator_called_fly(tmp_path):
    own = tmp_path / "own.py"
    own.write_text("def fly(pilot):\n    yield from pilot.wait(1.0)\n")
    assert script_of(str(own)).__name__ == "fly"
    for text, message in [
        ("def fly(pilot):\n    return 1\n", "yield from"),
        ("", "expected a function"),
    ]:
        own.write_text(text)
        with pytest.raises(InputError, match=message):
            script_of(str(own))
    with pytest.raises(InputError, match="no such file"):
        script_of(str(tmp_path / "other.py"))


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
    shipped = parm_file(model_folder("jr700") / "jr700.parm")
    taken = log.parameters()
    for name, value in shipped.items():
        if not name.startswith("LOG_"):  # which a script sets as it goes
            assert taken[name] == pytest.approx(value, rel=1e-6), name  # single precision


def its_pulses_are_repeated(log):
    """Our mixing of the rate controllers' outputs gives the pulses that it sent, all the flight.

    RCOU is logged ten times a second, between ticks: the tail's is of the tick before. On the
    ground the collective is limited, which RATE doesn't tell.
    """
    mixer = Mixer(log.parameters())
    rate, sent = log.table("RATE"), log.table("RCOU")
    names = {"lat": "ROut", "lon": "POut", "ped": "YOut", "col": "AOut"}
    wanted = [dict(zip(names, map(float, row))) for row in zip(*(rate[n] for n in names.values()))]
    last = np.searchsorted(rate.time, sent.time, side="right") - 1
    same = []
    for k, row in enumerate(last):
        if row > 0 and wanted[row]["col"] > 0.3:
            pulses = mixer.exact(wanted[row]) | {4: mixer.exact(wanted[row - 1])[4]}
            same.append([abs(pulses[n] - sent[f"C{n}"][k]) < 1.2 for n in (1, 2, 3, 4)])
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
