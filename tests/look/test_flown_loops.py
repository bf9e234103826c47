"""The loops of an ArduCopter-heli's law about a helicopter that is known, from a log of sweeps."""

import numpy as np
import pytest
from scipy.linalg import expm

import script
from command import fails
from helisim.cli import main
from helisim.handling.arducopter import COMMANDS, ArduCopterLaw
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins, rejection
from helisim.handling.loop import Curve
from helisim.look.loops import flown_loops
from helisim.look.sweeps import SID_AXES
from sid_logs import SidLog, _system, chirp

lost_samples = script.loaded("proof/lost_samples")

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
    a, b = _system(slip=False)
    whole = np.zeros((12, 12))
    whole[:6, :6], whole[:6, 9:] = a[:6, :6], b[:6, :3]
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
        row = COMMANDS.index(SID_AXES[axis].control)
        time = np.arange(2800) / RATE
        swept, frequency = chirp(time - 1.0, **SWEEP)
        targ, law = np.where(time < 1.0, 0.0, 0.05 * swept), LAW.ticked
        (a, b, c), state, inner, drift = plant(), np.zeros(9), np.zeros(len(law.a)), np.zeros(2)
        rows, added = [], 0.0
        for k in range(time.size):
            asked = np.array([*(-self._pilot * drift), 0.0])
            seen = np.concatenate([c @ state, asked, np.zeros(len(law.b[0]) - 9)])
            back = law.c @ inner + law.d @ seen
            inner = law.a @ inner + law.b @ seen
            total = back.copy()
            total[row] += added
            added = targ[k]
            rows.append([*total, *back, *(c @ state), *inner[15:18]])
            state = a @ state + b @ total
            drift += (c @ state)[3:5] / RATE
        self._write(axis, time, targ, frequency, np.array(rows).T)
        return self

    def _write(self, axis, time, targ, frequency, rows):
        total, back, rates, angles, aims = np.split(rows, [3, 6, 9, 12])
        begun, zero = self._now, np.zeros(time.size)
        length, low = SWEEP["length"], SWEEP["low"]
        self.write(
            4, self.us, axis, np.abs(targ).max(), low, SWEEP["high"], 1.0, 2.0 / low,
            length, 1.0,
        )  # fmt: skip
        self.mode(25)
        degrees = np.degrees(rates)
        turned = np.degrees([x for pair in zip(aims, angles) for x in pair])
        sent = [x for r, u in zip(degrees, total) for x in (zero, r, u)]
        written = [
            (5, [time, targ, frequency, *degrees, zero, zero, zero - 9.8]),
            (6, [*sent, zero, zero, zero + 0.5]),
            (7, [*turned]),
            *(
                (8 + k, [one, zero, zero, zero, zero])
                for k, one in enumerate(back)
                if f"PID{'RPY'[k]}" not in self._without
            ),
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


def test_the_loop_is_the_laws_and_the_helicopters_and_what_disturbs_it_is_told(tmp_path):
    """0.1 dB and 1 deg are what 24 s of a sweep leave at its lowest end."""
    found = flown_loops(Flown().fly(10).save(tmp_path))
    decibel, degrees = off(found.margins(draws=2), "lat")
    assert np.abs(decibel).max() < 0.1
    assert np.abs(degrees).max() < 1.0
    assert not found.remarks
    # a pilot who brings back what drifts off is part of the loop that is measured
    found = flown_loops(Flown(pilot=0.5).fly(10).save(tmp_path))
    assert any("the pilot moved that stick too" in one for one in found.remarks)
    log = Flown().fly(10)
    log.write(1, log.us, b"ATC_RAT_RLL_P", 0.3, 0.3)
    found = flown_loops(log.fly(10).save(tmp_path))
    assert found.remarks == ("gains were changed between sweeps: the loop is a mean of both",)


@pytest.mark.parametrize("without", [(), ("PIDR",)])
def test_bursts_of_lost_messages_leave_the_loop_and_widen_its_intervals(tmp_path, without):
    """16 % of all messages are lost in bursts of 20 to 250 ms; PIDR tells what comes back."""
    whole, left = Flown(without=without).fly(10).save(tmp_path), tmp_path / "left.bin"
    lost_samples.cut(whole, left, "bursts", 0.16, 3)
    flown = [flown_loops(path) for path in (whole, left)]
    before, after = (one.margins(draws=100) for one in flown)
    for name in ("crossover", "phase_margin", "DRB"):
        one, all_ = (found.figure(name, "lat", "actuators") for found in (after, before))
        assert one.low <= all_.value <= one.high
        # a draw of 100 knows a width to 7 %, and noise is absent in both
        assert one.high - one.low > 0.8 * (all_.high - all_.low)
    assert any("of RATE's rows are missing" in one for one in flown[1].remarks)


def test_two_logs_give_the_figures_of_all_their_axes(tmp_path):
    logs = [Flown().fly(axis).save(tmp_path, f"{axis}.bin") for axis in (10, 12)]
    found = flown_loops(logs).margins(draws=20)
    fine = ClosedLoop(Plant(), LAW, np.geomspace(2.0, 60.0, 2000))
    for axis in ("lat", "ped"):
        exact = margins(fine.broken(axis))
        one = found.figure("crossover", axis, "actuators")
        assert one.value == pytest.approx(exact.crossover, rel=0.01)
        # moved by its own attitude and rate alone: S of the command is that of the attitude
        left = Curve(fine.frequency, 1.0 / (1.0 + fine.broken(axis).response))
        drb = found.figure("DRB", axis, "actuators").value
        assert drb == pytest.approx(rejection(left).bandwidth, rel=0.03)


def test_the_command_needs_nothing_but_the_log(tmp_path, capsys):
    path = Flown().fly(10).fly(12).save(tmp_path)
    assert main(["margins", str(path), "--quiet"]) == 0
    text = capsys.readouterr().out
    assert "lat: goes on = RATE.ROut" in text
    assert "DRB" in text
    assert "SID_F_STOP_HZ" in text  # the gain margin of yaw lies above 8 Hz
    words = ["--axis", "yaw", "--band", "5", "40", "--quiet"]
    assert main(["margins", str(path), *words]) == 0
    text = capsys.readouterr().out
    assert "ped   actuators" in text
    assert "lat   actuators" not in text


@pytest.mark.parametrize(
    ("axis", "words", "without", "said"),
    [
        (10, ["--time", "t:s"], (), "--time"),
        (13, [], (), "no loop is closed through it"),
        (9, [], (), "SID_AXIS 10 to 12"),
        (10, [], ("RATE",), "no RATE messages beside the sweeps: set LOG_BITMASK"),
    ],
)
def test_what_cannot_be_measured_is_said_in_one_line(tmp_path, capsys, axis, words, without, said):
    path = SidLog(without=without).sweep(axis, length=12.0, low=1.0).save(tmp_path)
    assert said in fails(capsys, "margins", path, *words, "--quiet")
