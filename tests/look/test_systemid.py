"""What is inferred from logs of ArduPilot's mode SystemID."""

import re

import numpy as np
import pytest

import helisim as hs
import script
from command import fails
from flown_copter import LAW, Flown, Plant
from helisim.base.errors import InputError, LogError
from helisim.cli import main
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import margins, rejection
from helisim.handling.loop import Curve
from helisim.ident.rational import order as found_order
from helisim.logs import Column
from helisim.logs.dataflash import LogText  # noqa: F401  (rows name it)
from helisim.look import loops, sticks, sweeps, systemid  # noqa: F401  (rows name them)
from helisim.look.loops import flown_loops
from helisim.look.sweeps import SID_AXES, usual_step  # noqa: F401  (rows name it)
from helisim.look.systemid import estimate_fits, followed_band, infer, sent_yaw, tail_servo  # noqa: F401  (rows name them)
from sid_logs import TRUTH, SidLog, flown, four_axes
from tabled import tabled
from told_log import Rows, Told

HZ = 2.0 * np.pi
SHORT = {"length": 12.0, "low": 1.0}


def identified(path, **options):
    found = infer(path, **options)
    fits = [fit for fit in found.fits if fit.structure in hs.structures.BUILT_IN]
    records = [record for log in found.read() for record in log.records]
    return {
        fit.structure: hs.identify(frf, hs.structures.named(fit.structure), band=fit.band)
        for fit, frf in zip(fits, estimate_fits(records, fits))
    }


def one_sweep(folder, axis=12, log=None, **options):
    return (log or SidLog()).sweep(axis, **SHORT | options).save(folder)


@pytest.mark.slow
def test_a_log_alone_recovers_every_derivative(tmp_path):
    path = four_axes(tmp_path / "flight.bin", rate=200.0)
    fits = identified(path)
    assert set(fits) == set(TRUTH)
    for name, truth in TRUTH.items():
        for one in fits[name].parameters.values():
            if one.name.startswith("tau_") and one.name != "tau_f":
                # commands are held for a loop, half of which is a delay; so is what is felt at once
                assert 0.0 <= one.value <= 1.1 * 0.5 / 200.0, one
            else:
                error = abs(one.value - truth[one.name])
                # 3.5 standard errors, or 0.6 %: how a held command differs from its samples, up to
                # (pi f / rate)^2 / 6 at 8 Hz
                assert error <= max(3.5 * one.standard_error, 0.006 * abs(one.value)), one


def test_each_sweep_is_a_record_with_what_was_injected(tmp_path):
    log = SidLog().sweep(10, **SHORT).sweep(12, **SHORT)
    found = infer(log.save(tmp_path))
    first, second = found.logs[0].sweeps
    assert (first.axis, second.axis) == (10, 12)
    assert first.low == pytest.approx(HZ * 1.0)
    assert first.high == pytest.approx(HZ * 8.0 * 8.0 ** (-1.0 / 10.0), rel=1e-2)  # until it fades
    assert first.complete
    assert [fit.structure for fit in found.fits] == ["tf:0/2", "yaw_alone"]
    assert found.fits[1].conditioning == ("lat",)
    assert found.fits[1].reference == ("mixer_roll", "mixer_yaw")
    roll, yaw = (log.record for log in found.read())
    time, injected, _, commands, motion = flown(10, **SHORT)
    expected = np.interp(roll.time - roll.time[0], time, injected)
    np.testing.assert_allclose(roll["mixer_roll"], expected, atol=1e-7)  # single precision
    assert not roll["mixer_yaw"].any()
    assert not yaw["mixer_roll"].any()
    for name, true, single in (("lat", commands, 1e-7), ("p", motion, 1e-6)):
        expected = np.interp(roll.time - roll.time[0], time, true[:, 0])
        np.testing.assert_allclose(roll[name], expected, atol=single)
    assert roll.provenance["sweep"]["name"] == "mixer roll"


def test_a_sweep_that_was_stopped_or_whose_settings_were_dropped_is_used(tmp_path):
    found = infer(one_sweep(tmp_path, stop=9.0))
    (sweep,) = found.logs[0].sweeps
    _, _, frequency, *_ = flown(12, **SHORT)
    assert not sweep.complete
    assert "SystemID Stopped: lean" in sweep.end
    assert sweep.stop - sweep.start == pytest.approx(9.0, abs=0.02)
    assert found.fits[0].band[1] == pytest.approx(HZ * frequency[900], rel=0.02)
    log = SidLog(without=("SIDS",)).sweep(12, **SHORT)
    (sweep,) = infer(log.save(tmp_path)).logs[0].sweeps
    (told,) = infer(one_sweep(tmp_path)).logs[0].sweeps
    assert (sweep.axis, sweep.complete) == (12, True)
    assert sweep.low == pytest.approx(told.low)
    # how long it fades isn't known: 2 s are usual, its own is 1 s
    assert [sweep.high, told.high] == pytest.approx(HZ * frequency[[1100, 1200]], rel=0.01)
    assert sweep.stop == pytest.approx(told.stop, abs=0.1)
    log = SidLog().sweep(12, **SHORT)
    swept = max(log.messages, key=len)
    rows = np.frombuffer(swept, np.uint8).reshape(1600, -1).copy()
    rows[[400, 500], 19:23] = np.array([[1e9], [0.0]], "<f4").view(np.uint8)  # damage to SIDD's F
    log.messages[log.messages.index(swept)] = rows.tobytes()
    assert infer(log.save(tmp_path)).logs[0].sweeps == (told,)


def test_what_a_fit_holds_besides_the_vehicle_is_said(tmp_path):
    found = infer(one_sweep(tmp_path, axis=10))
    assert "pitch wasn't: its controller's answer is in the fit" in str(found)
    assert not found.diagnostics
    where = {"INS_POS1_X": 0.1, "INS_POS1_Y": 0.0, "INS_POS1_Z": -0.2}
    log = SidLog(parameters=where | {"INS_GYRO_FILTER": 20.0}).sweep(13, **SHORT)
    found = infer(log.save(tmp_path), channels={"r": Column("RATE.Y", "deg/s")})
    assert any("at 0.1, 0, -0.2 m (INS_POS1)" in one for one in found.diagnostics)


def test_sweeps_that_end_at_once_or_move_positions_are_left_out_and_said(tmp_path):
    log = SidLog().sweep(12, stop=3.0, **SHORT).sweep(12, stop=8.0, length=60.0)
    log.sweep(12, **SHORT)
    found = infer(log.save(tmp_path))
    assert len(found.logs[0].used) == 1
    assert "not used: it stays at one frequency" in str(found)
    assert "not used: it lasts 2.99 s, 3 periods take 4 s" in str(found)
    found = infer(SidLog().sweep(16, **SHORT).sweep(12, **SHORT).save(tmp_path))
    assert "disturbance right velocity" in str(found)
    assert [one.name for one in found.injected] == ["mixer_yaw"]
    with pytest.raises(LogError, match=r"identifies the vehicle: SID_AXIS 16 at .* s, 17 at") as no:
        infer(SidLog().sweep(16, **SHORT).sweep(17, **SHORT).save(tmp_path, "b.bin"))
    assert str(no.value).count("too slow for the vehicle") == 1


@tabled("told", "said")
def test_a_sweep_that_sank_is_left_out_and_named(tmp_path, told, said):
    assert infer(SidLog().sweep(10, lands=6.0, told="hover", **SHORT).save(tmp_path)).used
    log = SidLog().sweep(10, lands=6.0, told=told, **SHORT)
    if isinstance(told, tuple):
        log.sweep(11, **SHORT).write(12, log.us - 1, 28)
    found = infer(log.sweep(12, told="height", **SHORT).save(tmp_path))
    assert re.search(rf"mixer roll: .*not flown to its end; not used: .*{said}", str(found))
    assert [(one.axis, one.complete) for one in found.used] == [(12, True)]
    assert [fit.structure for fit in found.fits] == ["yaw_alone"]
    with pytest.raises(LogError, match=f"{said}.* fly the mode SystemID again"):
        infer(SidLog().sweep(10, lands=6.0, told=told, **SHORT).save(tmp_path))


def test_bands_without_a_common_part_refuse_one_fit(tmp_path):
    log = SidLog().sweep(10, low=1.0, high=2.0, length=12.0).sweep(11, low=4.0, length=12.0)
    found = infer(log.save(tmp_path))
    assert [fit.structure for fit in found.fits] == ["tf:0/2", "tf:0/2"]
    assert "rollpitch_speeds isn't fitted: the sweeps of lat, lon have no frequency" in str(found)


def test_a_gap_of_seconds_splits_a_sweep_and_ends_it_not(tmp_path):
    time = np.arange(1600) / 100.0
    found = infer(one_sweep(tmp_path, keep=(time < 9.0) | (time > 10.5)))
    assert found.logs[0].sweeps[0].complete
    (log,) = found.read()
    assert [record.duration for record in log.records] == pytest.approx([8.9, 5.4], abs=0.1)
    short = infer(one_sweep(tmp_path, keep=(time < 1.5) | (time > 3.0)))
    assert [len(log.records) for log in short.read()] == [1]


@pytest.mark.parametrize("axis", [3, 6, 9])
def test_sweeps_anywhere_in_the_loop_identify_the_same(tmp_path, axis):
    found = infer(one_sweep(tmp_path, axis))
    assert found.fits[0].reference == (SID_AXES[axis].name,)
    fit = identified(tmp_path / "a.bin")["yaw_alone"]
    # 2 %: 100 Hz holds a command for 10 ms, (pi f / rate)^2 / 6 at 8 Hz is 1 %
    assert fit["N_ped"].value == pytest.approx(TRUTH["yaw_base"]["N_ped"], rel=0.02)


def test_dropped_messages_count_as_missing_and_are_said(tmp_path):
    random = np.random.default_rng(4)
    keep = random.uniform(size=1600) > 0.2
    keep[0] = True
    found = infer(one_sweep(tmp_path, keep=keep))
    # what is lost at the end can't be told
    assert found.logs[0].dropped == pytest.approx(1.0 - keep.mean(), abs=2 / 1600)
    assert f"the logger dropped {100.0 * (1.0 - keep.mean()):.0f} % of" in found.diagnostics[0]
    (log,) = found.read()
    names = set(log.record.provenance["missing"])
    assert {"ped", "r", "v_dot", "mixer_yaw"} - names == {"v_dot"}
    fit = identified(tmp_path / "a.bin")["yaw_alone"]
    # 2 %: 100 Hz holds a command for 10 ms, (pi f / rate)^2 / 6 at 8 Hz is 1 %
    assert fit["N_ped"].value == pytest.approx(TRUTH["yaw_base"]["N_ped"], rel=0.02)


def test_bursts_of_lost_messages_leave_values_within_grown_errors(tmp_path):
    """16 % lost in bursts of 20 to 250 ms, of up to two periods of what was swept."""
    random, keep = np.random.default_rng(1), np.ones(1600, bool)
    while keep.mean() > 0.84:
        at = int(random.integers(5, 1560))
        keep[at : at + int(random.integers(2, 26))] = False
    noise = {"noise": 0.3, "seed": 1}
    whole = one_sweep(tmp_path, **noise)
    before = identified(whole)["yaw_alone"]
    after = identified(one_sweep(tmp_path, keep=keep, **noise))["yaw_alone"]
    for name in ("N_r", "N_ped"):
        gap = abs(after[name].value - before[name].value)
        assert gap < 3.0 * after[name].standard_error
        assert abs(after[name].value - TRUTH["yaw_base"][name]) < after[name].cramer_rao
    assert after["N_ped"].standard_error > before["N_ped"].standard_error


def test_vehicles_and_logs_choose_the_structures(tmp_path):
    paths = [SidLog().sweep(axis, **SHORT).save(tmp_path, f"{axis}.bin") for axis in (10, 11)]
    found = infer(paths)
    assert [fit.structure for fit in found.fits] == ["rollpitch_speeds"]
    records = [log.record for log in found.read()]
    assert [record.names[-2:] for record in records] == [("mixer_roll", "mixer_pitch")] * 2
    assert records[0]["mixer_roll"].any()
    assert not records[1]["mixer_roll"].any()
    slips = SidLog().sweep(10, slip=True, **SHORT).sweep(12, slip=True, **SHORT)
    assert infer(slips.save(tmp_path)).fits[-1].conditioning == ("v_dot",)
    log = SidLog(parameters={"FRAME_CLASS": 1.0}).sweep(10, **SHORT).sweep(11, **SHORT)
    found = infer(log.save(tmp_path))
    expected = [("tf:0/2", ("lat",)), ("tf:0/2", ("lon",))]
    assert [(fit.structure, fit.inputs) for fit in found.fits] == expected
    assert any("not a helicopter" in one for one in found.diagnostics)


def test_channels_rate_and_sweeps_can_be_chosen(tmp_path):
    path = one_sweep(tmp_path)
    found = infer(path, channels={"r": Column("RATE.Y", "deg/s")}, resample_hz=80.0)
    (log,) = found.read()
    assert log.headings["r"] == "RATE.Y"
    assert log.record.sample_time == pytest.approx(1.0 / 80.0)
    assert found.fit("tf:0/1", ("ped",), ("r",)).reference == ("mixer_yaw",)
    with pytest.raises(InputError, match=r"'lat' of rollpitch wasn't swept .*swept: ped$"):
        found.fit("rollpitch", ("lat", "lon"), ("p", "q"))
    path = SidLog().sweep(10, **SHORT).sweep(12, **SHORT).save(tmp_path)
    second = infer(path).logs[0].sweeps[1]
    found = infer(path, start=second.start - 1.0)
    assert [one.axis for one in found.logs[0].sweeps] == [12]
    with pytest.raises(LogError, match="no sweep lies within the limits"):
        infer(path, start=1000.0)


@tabled("without", "said")
def test_a_log_that_lacks_messages_says_what_to_set(tmp_path, without, said):
    log = SidLog() if without is None else SidLog(without=without).sweep(10, **SHORT)
    with pytest.raises(LogError, match=said) as caught:
        infer(log.save(tmp_path))
    assert "\n" not in str(caught.value)


def tail(low, high):
    ends = {"FUNCTION": 36.0, "MIN": low, "TRIM": 1500.0, "MAX": high}
    return {f"SERVO4_{name}": value for name, value in ends.items()}


def test_a_tail_near_its_trim_is_identified_from_what_it_was_sent(tmp_path):
    parameters = tail(1000.0, 2000.0)
    log = SidLog(parameters=parameters).sweep(12, magnitude=0.01, pulses=500.0, **SHORT)
    found = infer(log.save(tmp_path))
    assert "ped = RATE.YOut as sent" in str(found)
    sent = identified(tmp_path / "a.bin")["yaw_alone"]
    asked = identified(tmp_path / "a.bin", channels={"ped": Column("RATE.YOut", "1")})["yaw_alone"]
    truth = TRUTH["yaw_base"]["N_ped"]
    # 2 %: 100 Hz holds a command for 10 ms, (pi f / rate)^2 / 6 at 8 Hz is 1 %
    assert sent["N_ped"].value == pytest.approx(truth, rel=0.02)
    assert abs(asked["N_ped"].value / truth - 1.0) > 0.05


def test_a_band_begins_where_the_structure_follows():
    frequency = np.geomspace(0.5, 50.0, 120)
    s = 1j * frequency
    truth = 50.0 / (s + 3.0) * np.exp(-0.01 * s)

    def frf(values):
        names = {"inputs": ("ped",), "outputs": ("r",)}
        return hs.FrequencyResponse.exact(frequency, values[None, None], **names)

    def low(values):
        known = hs.structures.yaw_base.with_fixed({"N_r": -3.0, "tau_r_base": 0.01})
        lowest, highest = followed_band(frf(values), known, (0.5, 50.0), searches=1)
        assert highest == 50.0
        return lowest

    assert low(truth) == 0.5
    slow = truth * s**2 / (s**2 + 0.4 * s + 1.0)
    assert 2.0 < low(slow) < 6.0
    slower = truth * s**2 / (s**2 + 12.0 * s + 900.0)  # three octaves are left at least
    assert low(slower) <= 1.3 * 50.0 / 2.0**3


def test_look_tells_the_sweeps_and_the_command_without_an_option(tmp_path):
    path = one_sweep(tmp_path)
    found = hs.look(path)
    assert "SID_AXIS 12, mixer yaw" in str(found)
    assert str(found.proposal) == f"identify {path}"
    assert not found.logs[0].excitations


@pytest.mark.slow
def test_side_velocity_is_taken_out_of_yaw_or_the_error_says_so(tmp_path):
    """It makes N_r a quarter too large: known, N_r is right; else two standard errors hold that.

    The accelerometer, ahead of the centre and below it, feels dr/dt and dp/dt: 20 % of N_r.
    """
    log, truth = SidLog(parameters={"INS_POS1_X": 0.1, "INS_POS1_Z": 0.2}), -3.0
    for axis in (10, 12):
        log.sweep(axis, slip=True, noise=0.1, seed=axis)
    (known,) = identified(log.save(tmp_path)).values()
    assert known.data.conditioning == ("v_dot",)
    # three standard errors are 3.6 %: 2.7 % of noise and 2.4 % of what a structure may leave out
    assert abs(known["N_r"].value - truth) < 3.0 * known["N_r"].standard_error < 0.13
    yaw = SidLog().sweep(12, slip=True, noise=0.1)
    assert "INS_POS1 is 0" in "".join(infer(yaw.save(tmp_path)).diagnostics)
    (alone,) = identified(yaw.save(tmp_path)).values()
    assert 1.2 * truth > alone["N_r"].value
    assert abs(alone["N_r"].value - truth) < 2.0 * alone["N_r"].standard_error


def test_a_log_says_full_travel_and_the_hover_and_whence_its_rotor_speed(tmp_path):
    governed, not_so = ({"H_RSC_MODE": mode, "H_RSC_GOV_RPM": 1500.0} for mode in (4.0, 2.0))
    found = infer(one_sweep(tmp_path, log=SidLog(parameters=governed))).logs[0].conditions
    assert found.rotor_speed == pytest.approx(50.0 * np.pi)
    assert "H_RSC_GOV_RPM, not measured" in str(found)
    log = SidLog(parameters=not_so)
    log.define(16, "ESC", "QBf", "TimeUS,Instance,RPM", units="s#q", multipliers="F--")
    log.write(16, log.us + 5_000_000, 0, 9000.0)
    found = infer(one_sweep(tmp_path, log=log, slip=True)).logs[0].conditions
    assert (found.rotor_speed, found.hover) == (None, pytest.approx(0.5))
    assert found.full == dict.fromkeys(("lat", "lon", "ped", "col"), 1.0)
    assert "9000 rpm, is the motor's" in str(found)
    assert found.known_by["lean"] == "ANG.Roll, median of the sweeps"
    assert "its EKF estimates none" in found.words("wind")
    log.define(17, "XKF2", "QBff", "TimeUS,C,VWN,VWE", units="s#nn", multipliers="F---")
    log.write(17, log.us + 5_000_000, 0, 0.0, -3.0)
    windy = infer(one_sweep(tmp_path, log=log, slip=True)).logs[0].conditions
    assert windy.words("wind") == (
        "wind 3 m/s (the EKF's, XKF2, median of the sweeps, from 90 deg)"
    )
    given = infer(tmp_path / "a.bin", channels={"ped": Column("RATE.YOut", "1", sign=-1)})
    assert "ped" not in given.logs[0].conditions.full


# The order of a transfer function to begin with, told from a response.

OMEGA = np.geomspace(1.0, 25.0, 60)
S = 1j * OMEGA


def named(omega, response, error=0.0):
    zeros, poles = found_order(omega, response, error)
    return f"tf:{zeros}/{poles}"


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@tabled("response", "order")
def test_the_simplest_order_that_follows_is_chosen(response, order, noise):
    """A lag, an oscillation without and with a zero, each with a delay and up to 10 % of noise."""
    random = np.random.default_rng(0)
    spoiled = 1.0 + noise * (random.standard_normal(60) + 1j * random.standard_normal(60))
    assert named(OMEGA, response * spoiled) == order


@tabled("count", "highest", "response", "error", "order")
def test_an_order_is_what_the_data_tell(count, highest, response, error, order):
    s = 1j * np.geomspace(1.0, highest, count)
    assert named(s.imag, response(s), error) == order


# The loops of an ArduCopter-heli's law about a helicopter that is known, from a log of sweeps.

lost_samples = script.loaded("proof/lost_samples")


def off(found, axis):
    """Return by how much a measured loop is off the exact one: dB and deg, (n_freq,)."""
    curve = found.loop.broken(axis)
    exact = ClosedLoop(Plant(), LAW, curve.frequency).broken(axis).response
    ratio = curve.response / exact
    return 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))


def test_the_loop_is_the_laws_and_the_helicopters_and_what_disturbs_it_is_told(tmp_path):
    """0.1 dB and 1 deg are what 24 s of a sweep leave at its lowest end."""
    for pilot in (0.0, 0.3):  # he brings back what drifts off: 8 deg, were it not taken out
        log = Flown(pilot=pilot)
        for number, fields in ((7, 6), (10, 5)):  # numbers that damage took, of ANG and PIDY
            log.write(number, log.us, *[np.nan] * fields)
        found = flown_loops(log.fly(10).save(tmp_path))
        assert np.all(np.abs(off(found.margins(draws=2), "lat")) < [[0.1], [1.0]])
        assert not found.remarks
    log = Flown().fly(10)
    log.write(1, log.us, b"ATC_RAT_RLL_P", 0.3, 0.3)
    found = flown_loops(log.fly(10).save(tmp_path))
    assert found.remarks == ("gains were changed between sweeps: the loop is a mean of both",)


@pytest.mark.parametrize("without", [pytest.param((), marks=pytest.mark.slow), ("PIDR",)])
def test_bursts_of_lost_messages_leave_the_loop_and_widen_its_intervals(tmp_path, without):
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
        one = found.figure("crossover", axis, "actuators")
        assert one.value == pytest.approx(margins(fine.broken(axis)).crossover, rel=0.01)
        # moved by its own attitude and rate alone: S of the command is that of the attitude
        left = Curve(fine.frequency, 1.0 / (1.0 + fine.broken(axis).response))
        drb = found.figure("DRB", axis, "actuators").value
        assert drb == pytest.approx(rejection(left).bandwidth, rel=0.03)


def test_the_command_needs_nothing_but_the_log(tmp_path, capsys):
    path = Flown().fly(10).fly(12).save(tmp_path)
    assert main(["margins", str(path), "--quiet"]) == 0
    text = capsys.readouterr().out
    # the gain margin of yaw lies above 8 Hz
    assert all(one in text for one in ("lat: goes on = RATE.ROut", "DRB", "SID_F_STOP_HZ"))
    words = ["--axis", "yaw", "--band", "5", "40", "--quiet"]
    assert main(["margins", str(path), *words]) == 0
    text = capsys.readouterr().out
    assert [f"{one}   actuators" in text for one in ("ped", "lat")] == [True, False]


@tabled("axis", "words", "without", "said")
def test_what_cannot_be_measured_is_said_in_one_line(tmp_path, capsys, axis, words, without, said):
    path = SidLog(without=without).sweep(axis, length=12.0, low=1.0).save(tmp_path)
    assert said in fails(capsys, "margins", path, *words, "--quiet")


# What single messages say, by hand; a log begins a second after power-on.


def one_flown(axis=10, start=0.0, stop=30.0, low=HZ, high=5.0 * HZ, grounded=""):
    return sweeps.FlownSweep(axis, start, stop, 0.05, low, high, True, "complete", grounded)


def told_sweep(ended=(), logged=35.95, alt=(10.0, 10.0), **row):
    """Return a sweep of 20 s from 10 s on, which fades for 1 and 2 s, from 0.5 Hz by 0.1 Hz/s."""
    time, row = np.arange(10.0, logged, 0.1), {"Ax": 10.0, "Mag": -0.05, "FSt": 0.5, **row}
    log = Told(CTUN=Rows([12.0, 34.0], Alt=alt))
    row |= {"TFin": 1.0, "TR": 20.0, "TFout": 2.0}
    return sweeps._sweep(log, 10.0, row, time, 0.5 + 0.1 * (time - 10.0), ended)


def spans(one):
    numbers = one.start, one.stop, one.low / HZ, one.high / HZ, one.magnitude
    return [round(each, 6) for each in numbers]


def swung(rate=10.0, until=6.0, size=0.2, field="Gx"):
    """Return a table of SIDD whose one field goes to and fro, and then rests."""
    time = np.arange(0.0, 10.0, 1.0 / rate)
    rows = Rows(time, **dict.fromkeys(("Gx", "Gy", "Gz", "Ax", "Ay", "Az"), 0.0 * time))
    rows[field] = np.where(time < until, size * (-1.0) ** np.arange(time.size), 0.0)
    return Told(SIDD=rows)


def hover(own=None, **tables):
    """Return rotor speed, hover, lean and wind, and how they are known."""
    found = systemid._conditions(Told(own, **tables), (), [(0.0, 2.0), (4.0, 6.0)])
    known = [found.known_by.get(name, "").partition(",")[0] for name in ("rotor_speed", "lean")]
    values = (found.rotor_speed, found.hover, found.lean, found.wind)
    return [None if one is None else pytest.approx(one) for one in values], *known


def inferred(*flown, rate=100.0, names=("lat", "lon", "ped", "p", "q", "r"), **changes):
    taken = tuple(systemid.TakenChannel(name, Column(name), 100.0, "") for name in names)
    log = systemid.InferredLog("a", "", True, flown, taken, changes.pop("own", {}), 0.0)
    log = systemid.replace(log, **changes)
    return systemid.Inferred((log,), systemid.Options(rate))


@tabled("made", "wanted")
def test_what_single_messages_say(made, wanted):
    assert made() == wanted
