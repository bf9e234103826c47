"""The loops of an ArduCopter-heli's law about a helicopter that is known, from a log of sweeps."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from helisim.base.errors import LogError
from helisim.cli import main
from helisim.handling.arducopter import ADDED, COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins
from helisim.look.loops import flown_loops
from helisim.look.sweeps import SID_AXES
from sid_logs import SidLog, _system, chirp

RATE = 100.0
PARAMETERS = {
    "SCHED_LOOP_RATE": RATE,
    "INS_GYRO_FILTER": 0.0,
    "ATC_INPUT_TC": 0.2,
    "ATC_RATE_FF_ENAB": 1.0,
    **{f"ATC_ANG_{word}_P": 3.0 for word in ("RLL", "PIT", "YAW")},
    **{
        f"ATC_RAT_{word}_{name}": value
        for word, p in (("RLL", 0.2), ("PIT", 0.15), ("YAW", 0.08))
        for name, value in {
            "P": p, "I": 0.05, "D": 0.0, "FF": 0.1, "D_FF": 0.0, "FLTT": 20.0, "FLTE": 0.0,
            "FLTD": 0.0, "IMAX": 1.0, "ILMI": 1.0,
        }.items()
    },
}  # fmt: skip
LAW = ArduCopterLaw.of(PARAMETERS)
SWEEP = {"low": 0.5, "high": 8.0, "length": 24.0}
OUTPUTS = ("p", "q", "r", "phi", "theta", "psi")


def plant():
    """Return A, B and C of the helicopter of `sid_logs` with its angles, at ticks."""
    a, b = _system()
    whole = np.zeros((12, 12))
    whole[:6, :6], whole[:6, 9:] = a, b[:, :3]
    whole[[6, 7, 8], [0, 1, 4]] = 1.0
    held = expm(whole / RATE)
    return held[:9, :9], held[:9, 9:], np.eye(9)[[0, 1, 4, 6, 7, 8]]


class Plant:
    """Responses of the helicopter from commands to motion."""

    inputs, outputs = COMMANDS, OUTPUTS

    def response(self, frequency):
        """Return (6, 3, n_freq)."""
        a, b, c = plant()
        z = np.exp(1j * frequency / RATE)
        return np.stack([c @ np.linalg.solve(one * np.eye(9) - a, b) for one in z], axis=-1)


class Flown(SidLog):
    """A log of flights by `LAW`; the pilot brings back what drifts off, by his stick."""

    def __init__(self, pilot=0.0, **options):
        super().__init__(rate=RATE, parameters=PARAMETERS, **options)
        self._pilot = pilot
        self.define(7, "ANG", "Qffffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw",
                    units="sdddddd", multipliers="F------")  # fmt: skip
        for number, name in ((8, "PIDR"), (9, "PIDP"), (10, "PIDY")):
            self.define(number, name, "Qfffff", "TimeUS,P,I,D,FF,DFF")

    def fly(self, axis):
        """Fly a sweep of one SID_AXIS, and write what is logged of it."""
        one, row = SID_AXES[axis], COMMANDS.index(SID_AXES[axis].control)
        time = np.arange(2800) / RATE
        swept, frequency = chirp(time - 1.0, **SWEEP)
        size = {"mixer": 0.05, "rate": 0.3, "input": 0.1, "recovery": 0.1}[one.place]
        targ = np.where(time < 1.0, 0.0, size * swept)
        law = (replace(LAW, input_time=None) if one.place == "recovery" else LAW).ticked
        (a, b, c), state, inner, drift = plant(), np.zeros(9), np.zeros(len(law.a)), np.zeros(2)
        rows, added = [], 0.0
        for k in range(time.size):
            asked = np.array([*(-self._pilot * drift), 0.0])
            if one.place in ("input", "recovery"):
                asked[row] += targ[k]
            wanted = np.zeros(len(ADDED))
            wanted[row] = targ[k] * (one.place == "rate")
            seen = np.concatenate([c @ state, asked, wanted])
            back = law.c @ inner + law.d @ seen
            inner = law.a @ inner + law.b @ seen
            total = back.copy()
            total[row] += added
            added = targ[k] * (one.place == "mixer")
            rows.append([*total, *back, *(c @ state), *inner[15:18]])
            state = a @ state + b @ total
            drift += (c @ state)[3:5] / RATE
        self._write(axis, time, targ, frequency, np.array(rows).T)
        return self

    def _write(self, axis, time, targ, frequency, rows):
        unit = 1.0 if axis > 9 else np.degrees(1.0)
        total, back, rates, angles, aims = np.split(rows, [3, 6, 9, 12])
        begun, zero = self._now, np.zeros(time.size)
        length, low = SWEEP["length"], SWEEP["low"]
        self.write(
            4, self.us, axis, unit * np.abs(targ).max(), low, SWEEP["high"], 1.0, 2.0 / low,
            length, 1.0,
        )  # fmt: skip
        self.mode(25)
        degrees = np.degrees(rates)
        turned = np.degrees([x for pair in zip(aims, angles) for x in pair])
        sent = [x for r, u in zip(degrees, total) for x in (zero, r, u)]
        written = [
            (5, [time, unit * targ, frequency, *degrees, zero, zero, zero - 9.8]),
            (6, [*sent, zero, zero, zero + 0.5]),
            (7, [*turned]),
            *((8 + k, [one, zero, zero, zero, zero]) for k, one in enumerate(back)),
        ]
        each = [self._rows(number, begun + time, values) for number, values in written]
        self.messages.append(np.hstack(each).tobytes())
        self._now = begun + float(time[-1]) + 4.0


def off(found, axis):
    """Return by how much a measured loop is off the exact one: dB and deg, (n_freq,)."""
    curve = found.loop.broken(axis)
    exact = ClosedLoop(Plant(), LAW, curve.frequency).broken(axis).response
    ratio = curve.response / exact
    return 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))


@pytest.mark.parametrize("axis", [10, 9, 1, 5])
def test_the_loop_is_the_laws_and_the_helicopters(tmp_path, axis):
    """Wherever it is swept. 0.1 dB and 1 deg are what 24 s of a sweep leave at its lowest end."""
    path = Flown().fly(axis).save(tmp_path)
    found = flown_loops(path).margins(draws=2)
    decibel, degrees = off(found, SID_AXES[axis].control)
    assert np.abs(decibel).max() < 0.1
    assert np.abs(degrees).max() < 1.0


def test_what_a_pilot_answers_is_no_part_of_the_law(tmp_path):
    """He brings back what drifts off: its share of the loop, to 20 deg, is taken out."""
    path = Flown(pilot=0.5).fly(10).save(tmp_path)
    flown = flown_loops(path)
    decibel, degrees = off(flown.margins(draws=2), "lat")
    assert np.abs(decibel).max() < 0.1
    assert np.abs(degrees).max() < 1.0
    (record,) = flown.records
    answered = record["lat_sum"] - record["lat_disturbance"] - record["lat"]
    assert np.std(answered) > 0.02 * np.std(record["lat"])


def test_a_stick_that_moves_while_it_is_swept_is_told(tmp_path):
    """RCIN's first channel, by 30 us."""
    log = Flown()
    log.define(11, "RCIN", "QHHHH", "TimeUS,C1,C2,C3,C4")
    begun = log.us
    log.fly(1)
    for k, pulse in enumerate((1500, 1530)):
        log.write(11, begun + 1_000_000 * (k + 5), pulse, 1500, 1500, 1500)
    path = log.save(tmp_path)
    assert any("the pilot moved that stick too" in one for one in flown_loops(path).remarks)


def test_two_logs_give_the_figures_of_all_their_axes(tmp_path):
    """Crossover and phase margin in each."""
    logs = [Flown().fly(axis).save(tmp_path, f"{axis}.bin") for axis in (10, 12)]
    found = flown_loops(logs).margins(draws=20)
    fine = ClosedLoop(Plant(), LAW, np.geomspace(2.0, 60.0, 2000))
    for axis in ("lat", "ped"):
        exact = margins(fine.broken(axis))
        one = found.figure("crossover", axis, "actuators")
        assert one.value == pytest.approx(exact.crossover, rel=0.01)


def test_the_command_needs_nothing_but_the_log(tmp_path, capsys):
    """It prints what it took from where, and figures with intervals; options overrule."""
    path = Flown().fly(10).fly(12).save(tmp_path)
    assert main(["margins", str(path), "--draws", "20", "--quiet"]) == 0
    text = capsys.readouterr().out
    assert "lat: goes on = RATE.ROut" in text
    assert "DRB" in text
    assert "SID_F_STOP_HZ" in text  # the gain margin of yaw lies above 8 Hz
    words = ["--axis", "yaw", "--band", "5", "40", "--draws", "20", "--quiet"]
    assert main(["margins", str(path), *words]) == 0
    text = capsys.readouterr().out
    assert "ped   actuators" in text
    assert "lat   actuators" not in text


@pytest.mark.parametrize(
    ("axes", "words", "said"),
    [
        ((), [], "no SystemID messages"),
        ((10,), ["--rate", "100"], "--rate"),
        ((13,), [], "no loop is closed through it"),
    ],
)
def test_what_cannot_be_measured_is_said_in_one_line(tmp_path, capsys, axes, words, said):
    """With exit status 2."""
    log = SidLog()
    for axis in axes:
        log.sweep(axis, length=12.0, low=1.0)
    assert main(["margins", str(log.save(tmp_path)), *words, "--quiet"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_attitudes_are_needed(tmp_path):
    """What is to be set is said."""
    path = SidLog().sweep(10, length=12.0, low=1.0).save(tmp_path)
    with pytest.raises(LogError, match="no ATT messages beside the sweeps: set LOG_BITMASK"):
        flown_loops(path)


def test_no_simulator_is_needed():
    """Not even its import."""
    code = "import helisim.look.loops, sys; sys.exit('mujoco' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
