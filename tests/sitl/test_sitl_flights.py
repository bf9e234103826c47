"""ArduPilot's process is started apart from everything, and flown by scripts."""

import re
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from autopilot_logs import Log
from command import parm_file
from helisim.base.errors import AutopilotError, InputError
from helisim.cli import main
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins
from helisim.logs.dataflash import DataFlash
from helisim.records import storage
from helisim.records.record import IN1
from helisim.records.storage import read_record, write_record
from helisim.sitl.aircraft import Aircraft
from helisim.sitl.link import Link, Sensed
from helisim.sitl.mixing import Mixer
from helisim.sitl.parameters import parameters_for
from helisim.sitl.process import Autopilot
from helisim.sitl.session import fly_script, script_of
from helisim.sitl.systemid import sweeps
from helisim.vehicle import load
from helisim.vehicle.parameters import model_folder
from script import loaded
from tabled import section, tabled

DOCS = Path(__file__).parents[2] / "docs"
FAKE = section(globals(), "FAKE")
GREETS = section(globals(), "GREETS")
DIES = section(globals(), "DIES")
FLIES = section(globals(), "FLIES")
ENDS = section(globals(), "ENDS")


def fake(tmp_path, rest):
    path = tmp_path / "program"
    path.write_text(FAKE.format(python=sys.executable, rest=rest))
    path.chmod(0o755)
    return path


class Still:
    """An aircraft that only waits."""

    crashed = ""
    time = 0.0

    @property
    def sensed(self):
        return Sensed(self.time, *np.zeros((4, 3)), np.array([1.0, 0.0, 0.0, 0.0]))

    def step(self, pulses):
        self.time += 0.005
        return self.sensed


def test_program_is_started_in_a_folder_of_its_own(tmp_path):
    with Link(0) as link, Autopilot(fake(tmp_path, GREETS), "NAME 1\n", link.port) as autopilot:
        assert link.receive(20.0).pulses == (1000,) * 16
        autopilot.telemetry.settimeout(20.0)
        assert autopilot.telemetry.recv(4096) == b"NAME 1\n"
        autopilot.check()
        autopilot.keep_log(tmp_path / "kept.bin")
        folder = autopilot.folder
        given = (folder / "given").read_text().split()
    assert (tmp_path / "kept.bin").read_bytes() == b"log"
    assert not folder.exists()
    # ArduPilot's ports: 0 tells, 3 and 4 are the GPSs', the others would listen on all addresses
    assert {given[given.index(f"--serial{k}") + 1] for k in (1, 2, 5, 6, 7, 8)} == {"none:"}


def test_program_that_ends_in_flight_or_is_none_is_told_at_once(tmp_path):
    with pytest.raises(AutopilotError, match="status 7; its last words: it hurts"):
        fly_script(lambda pilot: pilot.wait(9.0), Still(), fake(tmp_path, DIES), "")
    none = tmp_path / "program"
    none.write_text("#!/no/such/interpreter\n")
    none.chmod(0o755)
    with pytest.raises(InputError, match=r"can't be started.*No such file"):
        Autopilot(none, "")


def test_a_script_flies_until_its_log_is_whole(tmp_path):
    """Frames of 5 ms: a step each 0.01 s, sticks each 0.05 s, 4 s without growth after 600."""
    log = Log()
    log.define(3, "DSF", "QII", "TimeUS,Dp,Blk")
    for lost in (0, 7):
        log.write(3, 0, lost, 1)
    told, kept = tmp_path / "told", tmp_path / "kept.bin"
    rest = FLIES.replace("{log!r}", repr(log.data)).replace("{told!r}", repr(str(told)))
    steps, seen = [], []

    def script(pilot):
        for step in pilot.wait(2.0):
            steps.append(pilot.time)
            yield step

    program, see = fake(tmp_path, rest), {"on_frame": lambda _, sensed: seen.append(sensed.time)}
    flight = fly_script(script, Still(), program, "", log=kept, **see)
    assert kept.read_bytes() == log.data
    assert flight.lost == 7
    assert np.diff(steps)[1:] == pytest.approx(0.01)  # the first is at the first frame, 5 ms
    assert steps[-1] == pytest.approx(2.0, abs=0.02)
    assert seen[-1] == pytest.approx(3.0 + 4.0, abs=0.03)
    assert flight.served.frames == len(seen)
    heard = np.array(told.read_text().split(), float)
    assert np.diff(heard)[1:] == pytest.approx(10.0)
    given = parm_file(tmp_path / "told.parm")  # the sticks' pulses mean what the pilot sends
    ends = {"MIN": 1000, "MAX": 2000, "TRIM": 1500, "DZ": 0, "REVERSED": 0}
    wanted = {f"RC{k}_{n}": one for k in range(1, 9) for n, one in ends.items()}
    assert given.items() >= wanted.items()
    with pytest.raises(AutopilotError, match=r"ended from outside at 0\.0 s"):
        fly_script(script, Still(), program, "", on_frame=lambda *_: True)
    struck = Still()
    struck.crashed = "a wall"
    with pytest.raises(AutopilotError, match=r"crashed at 0\.0 s: a wall"):
        fly_script(script, struck, program, "")


@tabled("does", "dies", "status", "said", "frames")
def test_a_flight_that_ends_early_keeps_log_and_record(
    tmp_path, monkeypatch, capsys, does, dies, status, said, frames
):
    rest = ENDS.replace("{dies}", str(dies or -1))
    own, temporary = tmp_path / "own.py", tmp_path / "temporary"
    begins = "import signal\nfrom helisim.base.errors import AutopilotError\ndef fly(pilot):"
    lines = begins, "yield from pilot.wait(0.5)", does, "yield from pilot.wait(9.0)"
    own.write_text("\n    ".join(lines))
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    again = lambda *given: signal.raise_signal(signal.SIGTERM) or write_record(*given)  # noqa: E731
    monkeypatch.setattr(storage, "write_record", again)
    log, record = tmp_path / "kept.bin", tmp_path / "kept.parquet"
    words = ["--script", own, "--ardupilot", fake(tmp_path, rest), "--log", log, "--record", record]
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL}
    before = {one: signal.signal(one, usual[one]) for one in usual}  # a job in the background
    try:  # of a shell ignores SIGINT, by nohup SIGHUP
        assert main(["sitl", *map(str, words)]) == status
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    printed = capsys.readouterr()
    assert re.search(said, printed.err.splitlines()[-1])
    assert f"its log until then is kept: {log}" in printed.err
    flown = len(log.read_text().split())
    assert frames <= flown < frames + 100
    assert read_record(record).duration == pytest.approx(1e-3 * flown, abs=0.02)
    assert not list(temporary.iterdir())


def test_sweeps_have_ardupilots_numbers_and_own_scripts_are_generators_called_fly(tmp_path):
    """ArduPilot's parameter list, SID_AXIS: 10 to 13 are the mixer's."""
    made = sweeps(["lat", "pitch", "ped", "heave", "thrust"], magnitude=0.1)
    assert [one.parameters["SID_AXIS"] for one in made] == [10, 11, 12, 13, 13]
    assert {one.magnitude for one in made} == {0.1}
    for slowest, lasts in ((0.2, 10.0), (1.0, 7.0)):  # two periods, and both fades
        with pytest.raises(InputError, match=f"here {lasts:g} s"):
            sweeps(["lat"], start_hz=slowest, seconds=lasts)
        sweeps(["lat"], start_hz=slowest, seconds=lasts + 0.1)
    own = tmp_path / "own.py"
    own.write_text("def fly(pilot):\n    yield from pilot.wait(1.0)\n")
    assert script_of(str(own)).__name__ == "fly"
    returns = "def fly(pilot):\n    return 1\n"
    for text, message in ((returns, "yield from"), ("", "expected a function")):
        own.write_text(text)
        with pytest.raises(InputError, match=message):
            script_of(str(own))
    with pytest.raises(InputError, match="no such file"):
        script_of(str(tmp_path / "other.py"))


@pytest.mark.slow
def test_own_flight_goes_from_the_ground_to_the_ground(ardupilot, tmp_path, capsys):
    """The page's example, by the real autopilot: off the ground and back; its log is whole."""
    record, log, own = (tmp_path / name for name in ("flight.parquet", "flight.bin", "own.py"))
    page = (DOCS / "extend" / "sitl_flight.md").read_text(encoding="utf-8")
    own.write_text(re.search(r"<!-- file: .*\n```python\n([^`]+)```", page)[1])
    script = [own, "--log", log, "--record", record]
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
    assert written.skipped == written.table("DSF")["Dp"][-1] == 0
    assert written.table("RATE").time[-1] > flown.duration - 60.0
    its_parameters_were_taken(written)
    its_pulses_are_repeated(written)


def its_parameters_were_taken(log):
    shipped, taken = parm_file(model_folder("jr700") / "jr700.parm"), log.parameters()
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
    records, path = [], tmp_path / "flight.parquet"
    for _ in range(2):
        aircraft, text = Aircraft("jr700", recorded=True), parameters_for("jr700").text
        flight = fly_script(lambda pilot: pilot.wait(10.0), aircraft, ardupilot, text)
        assert flight.served.frames > 10_000
        records.append(write_record(aircraft.record(), path).read_bytes())
    assert records[0] == records[1]


@pytest.fixture(scope="module")
def study():
    return loaded("sitl_study")


def test_its_own_helicopter_in_ardupilots_units(study):
    """By hand: swashplate 120 degrees, 280 us of collective, the tail 400 us to each side.

    Full roll puts the two front servos 0.45 x 2 cos 30 degrees of 1000 us apart, full pitch the
    front ones 0.45 x 1.5 above the rear one.
    """
    parameters = {"H_COL_MIN": 1460.0, "H_COL_MAX": 1740.0}
    true = study.stated(study.SOURCES["heli"], parameters, 0.5)
    roll, pitch = 1.283 * 0.9 * 3**0.5 / 2.0 / 7.2, 1.48 * 0.675 / 7.2
    assert true["B_lat"] == pytest.approx(1.7635 * roll)
    assert true["B_lon"] == pytest.approx(-0.61171 * pitch)
    assert true["A_lat"] == pytest.approx(0.52454 * roll)
    assert true["A_lon"] == pytest.approx(1.9432 * pitch)
    assert true["N_ped"] == pytest.approx(21.6 * 2.96 * 0.8)
    # 14 degrees of collective, of which 5 carry the weight; 0.2 %: it rounds a turn's rad/s
    assert true["Z_col"] == pytest.approx(-9.80665 * 14.0 / 5.0, rel=2.1e-3)


def test_the_jr700_in_ardupilots_units(study, jr700):
    """By hand: 900 us of full cyclic on servos that 500 us move by their whole travel, 0.75."""
    parameters = {"H_SW_TYPE": 0.0, "SERVO4_MIN": 1000.0, "SERVO4_MAX": 2000.0}
    parameters |= {f"H_SW_H3_SV{k}_POS": place for k, place in ((1, 0.0), (2, -120.0), (3, 120.0))}
    true, own = study.exact_jr700(parameters, 0.5), jr700.derivatives
    for name, scale in {"B_lat": 0.675, "A_lon": 0.675, "N_ped": 0.75, "Z_col": 0.75}.items():
        # it flies with its motor, whose trim is another by 1e-5
        assert true[name] == pytest.approx(scale * own[name], rel=1e-4)
    assert true["L_b"] == pytest.approx(own["L_b"], rel=1e-4)


@pytest.mark.study
def test_logs_that_it_wrote_meet_the_bars(study, ardupilot, monkeypatch, tmp_path):
    monkeypatch.setenv("HELISIM_ARDUPILOT", str(ardupilot))
    assert study.main(fly=str(tmp_path)) == 0


@pytest.fixture(scope="module")
def flown_jr700(study):
    parameters = parm_file(model_folder("jr700") / "jr700.parm")
    return study.exact_plant(parameters, 0.5, 0.0025), ArduCopterLaw.of(parameters)


def test_the_exact_vehicle_is_that_of_python_control_at_ticks(flown_jr700):
    """Held for a tick; a full roll is 0.675 of the vehicle's lat; the tail's pulses wait a tick."""
    plant, _ = flown_jr700
    frequency = np.array([1.0, 10.0, 60.0])
    system = load("jr700", parameters={"drive.governor": "motor"}).linearize().system
    own = system.sample(0.0025)(np.exp(0.0025j * frequency))
    found = plant.response(frequency)
    late = {"ped": np.exp(-0.0025j * frequency)}
    for axis, rate, scale in (("lat", "p", 0.675), ("lon", "q", 0.675), ("ped", "r", 0.75)):
        row, column = system.output_labels.index(rate), system.input_labels.index(axis)
        true = scale * own[row, column] * late.get(axis, 1.0)
        here = found[plant.outputs.index(rate), COMMANDS.index(axis)]
        assert here == pytest.approx(true, rel=1e-3)
    assert set(plant.inputs) < set(IN1)


def test_margins_are_predicted_of_the_helicopter_that_flies(study):
    """With its motor, sampled at ticks: flown, yaw had 12.06 +- 0.12 dB and 50.4 +- 0.4 degrees."""
    made = parameters_for("jr700")
    plant = study.exact_plant(made.values, 0.5, 0.0025)
    loop = ClosedLoop(plant, ArduCopterLaw.of(made.values), np.geomspace(0.2, 1250.0, 2000))
    told = [one.why for one in made.settings if one.name.startswith("ATC_ANG")]
    for axis, text in zip(COMMANDS, told):
        cut = margins(loop.broken(axis))
        gain, phase = map(
            float, re.search(r"margin ([\d.]+) dB, phase margin (\d+)", text).groups()
        )
        assert gain == pytest.approx(cut.least_gain, abs=0.5)
        assert phase == pytest.approx(np.degrees(cut.least_phase), abs=1.5)
    assert (cut.least_gain, np.degrees(cut.least_phase)) == pytest.approx((12.06, 50.4), 0.02)


def test_ardupilots_own_helicopter_moves_as_its_source_states(study):
    """Yaw: 21.6 x 2.96 over s + 2.96, 80 % of the servo's way; 50 ms, and a tick, held for another.

    Roll above the rotor's modes: 3588.6 / 0.068232 x 1.7635 of the cyclic over s squared. Heave has
    2.25 1/s. Its sensors' body is pulled to it by 1 over 0.1 s, and turns, or pulls, a frame early.
    """
    plant, frequency = study.ardupilots_helicopter({}), np.array([2.0, 20.0, 300.0])
    found = plant.response(frequency)
    s, early = 1j * frequency, 833e-6 / 0.1
    yaw = 21.6 * 2.96 * 0.8 / (s + 2.96) * np.exp(-s * (0.05 + 0.0025 + 0.00125))
    # half a frame early by Euler's method, and the gyro's age
    assert found[2, 2, :2] == pytest.approx(yaw[:2], rel=0.02)
    felt = 1.0 + early * s / (s + 10.0)
    assert abs(found[2, 2, :2]) == pytest.approx(abs(yaw * felt)[:2], rel=2e-3)
    heave, stated = s / (s + 2.25), study.stated(study.SOURCES["heli"], {}, 0.5)["Z_col"]
    felt = 1.0 + early * s * (s + 10.0) / (s**2 + 10.0 * s + 100.0)
    assert abs(found[6, 3, :2]) == pytest.approx(abs(stated * heave * felt)[:2], rel=2e-3)
    cyclic = 1.283 * 0.9 * 3**0.5 / 2.0 / 7.2
    high = 3588.6 * 1.7635 * cyclic / 0.068232 / s[2] ** 2
    assert abs(found[0, 0, 2]) == pytest.approx(abs(high), rel=0.05)  # 3588.6 / 300^2
