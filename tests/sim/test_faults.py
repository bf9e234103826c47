"""Faults of servos and gyro in flight: finite, repeatable, and as large as the physics says."""

import copy

import control
import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.records.record import RATES, SERVOS, FlightRecord, channel
from helisim.sim import Doublet, FlightPlan, Sweep
from helisim.sim.faults import (
    ClockDrift,
    GyroDropout,
    GyroRestart,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
    ServoStuck,
    ServoWeak,
    parse_fault,
    write_faults,
)
from helisim.sim.flight import fly, simulate
from helisim.sim.limits import FlightEnvelope
from helisim.sim.plan import Pilot
from helisim.vehicle import load
from helisim.vehicle.trim import addresses
from plates import H3_120

NO_REMNANT = Pilot(remnant=0.0)
QUIET = Doublet(axis="ped", duration=12.0, amplitude=1e-6)
"""As good as no manoeuvre: the pilot keeps the hover."""
AT = 2.0


def hover(vehicle, *faults, pilot=NO_REMNANT, excitation=QUIET):
    """Return the truth of a hover with faults, whatever becomes of it."""
    plan = FlightPlan(
        excitation=excitation, pilot=pilot, faults=faults, envelope=FlightEnvelope.off()
    )
    return next(simulate(vehicle, plan, jobs=1))


def without_gyro(vehicle, seconds, *faults, start=None):
    """Return time, rates and servo positions of a flight without gyro and pilot."""
    model = copy.copy(vehicle.model)
    par = model.actuator_user[addresses(model).rotor]
    par[PARAM.gyro_on] = 0.0
    write_faults(par, faults)
    data = vehicle.hovering()
    if start is not None:
        data.ctrl[addresses(model).control + 4 : addresses(model).control + 8] += start
    rows = []
    with installed():
        for _ in range(round(seconds / model.opt.timestep)):
            mujoco.mj_step(model, data)
            p, q, r = data.sensor("imu_gyro").data * [1.0, -1.0, -1.0]
            rows.append([*data.sensor("clock").data, p, q, r, *data.sensor("servo_position").data])
    return np.array(rows)


def test_nothing_changes_before_a_fault_and_everything_repeats(jr700):
    """To the bit: until it comes, for the same seed, for any number of threads."""
    sweep = Sweep(axis="lat", duration=8.0, trim_time=1.0)
    fault = ServoWeak(servo="servo_left", at=4.0, rate_limit=0.3)
    plain = fly(jr700, sweep, count=2, seed=3, jobs=1)
    weak = fly(jr700, FlightPlan(excitation=sweep, faults=[fault]), count=2, seed=3, jobs=1)
    again = fly(jr700, FlightPlan(excitation=sweep, faults=[fault]), count=2, seed=3, jobs=2)
    for one, other, repeated in zip(plain, weak, again):
        assert np.array_equal(other.values, repeated.values)
        # the anti-alias filter looks back only, the lever arm's derivative ahead by a sample
        before = one.time < 4.0 - 0.01
        assert np.array_equal(one.values[before], other.values[before])
        assert np.abs(one["p"] - other["p"]).max() > 0.05


def test_a_fault_comes_at_the_same_instant_whatever_the_time_step():
    """At a tick of the gyro: also where its time lies between two steps."""
    held = []
    for timestep in (0.002, 0.001):
        vehicle = load(timestep=timestep)
        rows = without_gyro(
            vehicle, 0.1, ServoStuck(servo="servo_tail", at=0.0171), start=[0, 0, 0, 0.1]
        )
        stuck = np.flatnonzero(np.diff(rows[:, 7]) == 0.0)
        held.append((rows[stuck[stuck > 2][0], 0], rows[-1, 7]))
    assert held[0][0] == pytest.approx(0.018, abs=1e-9)  # the first tick after it
    # fourth order at 2 ms x 222 rad/s leaves 1e-5; a tick earlier it stood 6e-3 elsewhere
    assert held[0] == pytest.approx(held[1], abs=1e-5)


@pytest.mark.parametrize("name", SERVOS)
def test_a_stuck_servo_stays_and_its_command_goes_on(jr700, name):
    """Where it is when it sticks, or where it was said to stick; the other three move."""
    k = SERVOS.index(name)
    sweep = Sweep(axis="ped" if k == 3 else "lat", duration=8.0, trim_time=1.0)
    truth = hover(jr700, ServoStuck(servo=name, at=3.0), excitation=sweep, pilot=Pilot())
    after = truth.time > 3.0 + 0.002
    assert np.ptp(truth.servo_positions[after, k]) == 0.0
    assert np.ptp(truth.servo_positions[~after, k]) > 0.001
    assert np.ptp(truth.servo_commands[after, k]) > 0.001
    for other in set(range(4)) - {k}:
        assert np.ptp(truth.servo_positions[after, other]) > 0.0
    there = hover(jr700, ServoStuck(servo=name, at=AT, position=0.01))
    assert there.servo_positions[there.time > AT + 0.1, k] == pytest.approx(0.01, abs=1e-6)


def in_hover(vehicle, name):
    """Return where a servo stands in hover: a little off the middle, against the tail's torque."""
    return float(vehicle.hovering().actuator(name).ctrl[0])


@pytest.mark.parametrize("name", SERVOS[:3])
def test_a_stuck_servo_tilts_as_the_mixing_says(jr700, name):
    """The first turn of the helicopter is that of col, lon and lat of one servo out of place."""
    out = 0.02
    alone = np.where(np.array(SERVOS[:3]) == name, out, 0.0)
    col, lon, lat = H3_120.unmix(*alone)
    stuck = in_hover(jr700, name) + out
    rows = without_gyro(jr700, 0.3, ServoStuck(servo=name, at=0.0, position=stuck))
    base = jr700.linearize("IN1").system
    time = rows[:, 0]
    inputs = np.tile([[col], [lon], [lat], [0.0]], (1, time.size))
    expected = np.asarray(control.forced_response(base, time, inputs).outputs)
    # of 0.1 rad/s: what the linear model leaves out, after 0.3 s of an unstable hover
    for column, rate in ((1, "p"), (2, "q")):
        of_rate = expected[base.output_labels.index(rate)]
        assert rows[:, column] == pytest.approx(of_rate, abs=0.03 * np.abs(expected[:2]).max())
    if name == "servo_front":
        assert lon > 0.0
        assert rows[-1, 2] > 0.05  # nose up
    else:
        assert np.sign(rows[-1, 1]) == np.sign(lat) == (1 if name == "servo_left" else -1)


def test_a_stuck_swashplate_servo_takes_the_collective(jr700):
    """The gyro keeps the swashplate level with the other two, so it stands where one is stuck."""
    out = 0.01
    stuck = in_hover(jr700, "servo_front") + out
    truth = hover(jr700, ServoStuck(servo="servo_front", at=AT, position=stuck))
    late = truth.time > 8.0
    col, lon, lat = H3_120.unmix(*truth.servo_positions[late, :3].T)
    assert np.mean(col) == pytest.approx(out, abs=0.1 * out)
    off = np.mean(lon) - jr700.trim.lon, np.mean(lat) - jr700.trim.lat
    assert np.abs(off).max() < 0.1 * out
    # the pilot pulls the stick the other way, and the helicopter climbs all the same
    assert truth.sticks[-1, 0] < -out
    at = jr700.derivatives
    climb = at["Z_col"] * out / -at["Z_w"]
    assert truth.velocities[-1, 2] == pytest.approx(climb, rel=0.1)  # w, 6 of its time constants
    assert np.abs(truth.attitudes[:, :2]).max() < 0.2


def test_a_stuck_tail_servo_turns_the_helicopter(jr700):
    """It yaws as N_ped and N_r say, and the gyro's command goes to its stop for nothing."""
    out = 0.01
    truth = hover(jr700, ServoStuck(servo="servo_tail", at=AT, position=out))
    at = jr700.derivatives
    since = truth.time - AT - jr700.servo_delay("ped") + 0.001  # of it, the hold of the command
    early = (since > 0.05) & (since < 0.5)
    turn = out * at["N_ped"] / -at["N_r"] * (1.0 - np.exp(at["N_r"] * since[early]))
    assert truth.rates[early, 2] == pytest.approx(turn, rel=0.05)  # sideslip and the wake
    assert np.interp(AT + 3.0, truth.time, truth.servo_commands[:, 3]) == -0.5
    assert np.isfinite(truth.rates).all()
    assert np.abs(truth.rates[:, 2]).max() < 2.0  # N_r and the tail's inflow bound it


def test_a_weak_servo_is_slow_and_short(jr700):
    """From then on: no faster than the one limit, no further than the other."""
    weak = ServoWeak(servo="servo_tail", at=0.1, rate_limit=0.5, travel=0.05)
    rows = without_gyro(jr700, 0.4, weak, start=[0.0, 0.0, 0.0, -0.2])
    time, tail = rows[:, 0], rows[:, 7]
    speed = np.abs(np.diff(tail)) / np.diff(time)
    assert speed[time[1:] < 0.1].max() > 5.0
    assert speed[time[1:] > 0.104].max() == pytest.approx(0.5, rel=1e-9)
    # from -0.2 back to -0.05 at 0.5 a second, once its speed has turned round
    assert tail[-1] == pytest.approx(-0.05, abs=0.01)


def test_a_gyro_that_restarts_forgets_and_recovers():
    """Rigged so that the hover needs pedal: 0.3 s without it turn the helicopter by as much."""
    vehicle = load(parameters={"tail_rotor.pitch_trim": 0.12})
    ped = vehicle.trim.ped
    assert abs(ped) > 0.01
    truth = hover(vehicle, GyroRestart(at=AT, lasts=0.3))
    out = (truth.time >= AT - 1e-9) & (truth.time < AT + 0.3 - 1e-9)
    assert np.all(truth.servo_commands[out] == 0.0)
    assert np.all(truth.servo_commands[(truth.time > 1.0) & ~out, 3] != 0.0)
    base = vehicle.linearize("IN1").system
    time = truth.time[out] - AT
    inputs = np.zeros((4, time.size))
    inputs[3] = -ped
    motion = np.asarray(control.forced_response(base, time, inputs).outputs)
    expected = motion[base.output_labels.index("r")]
    assert np.abs(expected[-1]) > 0.2
    # the tail's inflow: 0.3 rad/s change its thrust by a few percent more or less than N_r says
    assert truth.rates[out, 2] == pytest.approx(expected, abs=0.03 * np.abs(expected[-1]))
    assert np.abs(truth.rates[truth.time > AT + 2.0]).max() < 0.02


def test_a_restart_zeroes_the_gyros_states_only(jr700):
    """At its first tick, exactly; those of servos and rotor go on."""
    model = copy.copy(jr700.model)
    where = addresses(model)
    write_faults(model.actuator_user[where.rotor], [GyroRestart(at=0.1, lasts=0.05)])
    data = jr700.hovering()
    gyro = slice(where.state + STATE.gyro_q_filter, where.state + STATE.gyro_r_integral + 1)
    flapping = slice(where.state + STATE.flap_a, where.state + STATE.flap_b + 1)
    sizes = []
    with installed():
        for _ in range(100):
            data.ctrl[where.control + 1 : where.control + 4] = 0.02
            mujoco.mj_step(model, data)
            sizes.append(
                (data.time, np.abs(data.act[gyro]).max(), np.abs(data.act[flapping]).max())
            )
    time, forgotten, tilt = np.array(sizes).T
    restarting = (time > 0.1 + 1e-9) & (time < 0.15 + 1e-9)
    assert np.all(forgotten[restarting] == 0.0)
    assert np.all(forgotten[(time > 0.01) & ~restarting] > 0.0)
    assert np.all(tilt[time > 0.01] > 0.0)


def test_a_restart_can_leave_the_last_commands(jr700):
    """With its output held, the servos stay where the gyro last sent them."""
    sweep = Sweep(axis="lat", duration=6.0, trim_time=1.0)
    truth = hover(jr700, GyroRestart(at=3.0, lasts=0.1, output="held"), excitation=sweep)
    out = (truth.time >= 3.0 - 1e-9) & (truth.time < 3.1 - 1e-9)
    assert np.ptp(truth.servo_commands[out], axis=0) == pytest.approx(np.zeros(4), abs=0.0)
    assert np.abs(truth.servo_commands[out]).max() > 0.001
    assert np.ptp(truth.servo_commands[truth.time >= 3.1, 1]) > 0.001


@pytest.mark.parametrize("reads", ["zero", "held"])
def test_a_yaw_rate_that_drops_out_reads_zero_or_what_it_was(jr700, reads):
    """While the pedal turns the helicopter, the tail's command climbs at the rate that is read."""
    fault = GyroDropout(at=1.0, lasts=0.1, rates="r", reads=reads)
    model = copy.copy(jr700.model)
    where = addresses(model)
    write_faults(model.actuator_user[where.rotor], [fault])
    data, rows = jr700.hovering(), []
    # a pedal that goes back at the instant of the dropout, after its own latency, or that stays
    pedal = 0.0 if reads == "held" else 0.05
    with installed():
        for _ in range(900):
            data.ctrl[where.control + 3] = 0.05 if data.time < 0.98 else pedal
            mujoco.mj_step(model, data)
            yaw = -data.sensor("imu_gyro").data[2]
            rows.append([*data.sensor("clock").data, yaw, *data.sensor("servo_command").data[3:]])
    time, r, command = np.array(rows).T
    gain = {name: jr700.parameters[f"gyro.{name}"] for name in ("k_i", "k_delta", "k_a")}
    read = {"zero": 0.0, "held": r[np.searchsorted(time, 1.0)]}[reads]
    slope = gain["k_i"] * (gain["k_delta"] * pedal - gain["k_a"] * read)
    within = (time > 1.02) & (time < 1.098)
    assert abs(slope) > 2.0
    # the filter of 2.5 ms held a turn that is steady to 1 %
    assert np.polyfit(time[within], command[within], 1)[0] == pytest.approx(slope, rel=0.01)
    assert np.abs(command[-1]) < 0.1 * np.abs(command[within]).max()  # and then it comes back


def test_only_the_rates_that_drop_out_do(jr700):
    """With q gone the roll and yaw gyros work as ever, and the recorder sees all three."""
    sweep = Sweep(axis="lon", duration=8.0, trim_time=1.0)
    plain = hover(jr700, excitation=sweep)
    lost = hover(jr700, GyroDropout(at=3.0, lasts=1.0, rates=("q",)), excitation=sweep)
    after = plain.time > 3.02
    change = np.abs(lost.servo_commands[after] - plain.servo_commands[after])
    assert change[:200, 0].max() > 0.01
    assert np.abs(lost.rates[after, 1]).max() > 0.1
    assert np.isfinite(lost.rates).all()


def test_provenance_tells_the_faults(jr700):
    """Kind and every number, in the record."""
    faults = [ServoStuck(servo="servo_left", at=2.0), GyroDropout(at=1.0, lasts=0.1)]
    record = fly(jr700, FlightPlan(excitation=QUIET, faults=faults, pilot=NO_REMNANT), jobs=1)[0]
    assert record.provenance["faults"] == [
        {"kind": "ServoStuck", "servo": "servo_left", "at": 2.0, "position": None},
        {"kind": "GyroDropout", "at": 1.0, "lasts": 0.1, "rates": list(RATES), "reads": "zero"},
    ]


def test_faults_that_can_not_be_in_one_flight_are_refused(jr700):
    """Too late, two of one part, or no fault at all."""
    stuck = ServoStuck(servo="servo_tail", at=2.0)
    with pytest.raises(InputError, match="over at 12 s"):
        fly(jr700, FlightPlan(excitation=QUIET, faults=[ServoStuck(servo="servo_tail", at=30.0)]))
    with pytest.raises(InputError, match="one fault of a part"):
        fly(
            jr700,
            FlightPlan(
                excitation=QUIET, faults=[stuck, ServoWeak(servo="servo_tail", at=3.0, travel=0.1)]
            ),
        )
    with pytest.raises(InputError, match="ServoStuck or SampleLoss"):
        fly(jr700, FlightPlan(excitation=QUIET, faults=["servo_tail:stuck@2"]))


@pytest.mark.parametrize(
    "fault",
    [
        ServoStuck(servo="servo_front", at=3.0),
        ServoWeak(servo="servo_left", at=3.0, rate_limit=0.05),
        GyroRestart(at=3.0, lasts=0.2),
        GyroDropout(at=3.0, lasts=0.2, reads="held"),
    ],
    ids=["stuck", "weak", "restart", "dropout"],
)
def test_both_integrators_fly_the_same_fault(fault):
    """Euler's staggered scheme looks ahead along a servo's rate: a slow one's is slow as well."""
    sweep = Sweep(axis="lat", duration=5.0, trim_time=1.0)
    by_integrator = []
    for integrator in ("RK4", "Euler"):
        truth = hover(load(integrator=integrator), fault, excitation=sweep)
        by_integrator.append(truth.rates)
        assert np.isfinite(truth.rates).all()
    one, other = by_integrator
    plain = hover(load(), excitation=sweep).rates
    after = slice(1500, None)
    # second order against fourth at 2 ms: 0.1 % without a fault, and no jump of it here
    gap = np.abs(one[after] - other[after]).max()
    assert gap < 0.005 * np.abs(one[after]).max()
    assert np.abs(one[after] - plain[after]).max() > 10.0 * gap


# What a flight computer does wrong, against the record that it should have written


COUNT = 6001
NAMES = ("p", "r", "LAT")


def made():
    """Return a minute of three smooth channels at 100 Hz."""
    time = np.arange(COUNT) / 100.0
    values = np.column_stack([np.sin(3.0 * time), np.cos(2.0 * time), 0.1 * np.sin(time)])
    return FlightRecord(time, values, tuple(channel(name) for name in NAMES), {"seed": 1})


def faulty(fault, seed=0):
    return fault.apply(made(), np.random.default_rng(seed))


def test_a_dropout_holds_or_reads_zero_for_as_long_as_said():
    """The named channels for the time said, nothing else."""
    good = made()
    for reads, wanted in (("held", good["p"][1999]), ("zero", 0.0)):
        bad = faulty(SensorDropout(channels="p", at=20.0, lasts=0.5, reads=reads))
        out = (good.time >= 20.0) & (good.time < 20.5)
        assert np.count_nonzero(out) == 50
        assert np.all(bad["p"][out] == wanted)
        assert np.array_equal(bad["p"][~out], good["p"][~out])
        assert np.array_equal(bad.select(("r", "LAT")), good.select(("r", "LAT")))


def test_spikes_have_their_size_and_their_rate():
    """Single samples are off by the size either way; as many a minute as said."""
    bad, good = faulty(SensorSpikes(channels=("p", "r"), size=5.0, per_minute=60.0)), made()
    for name in ("p", "r"):
        off = bad[name] - good[name]
        hit = np.abs(off) > 1e-9
        assert np.abs(off[hit]) == pytest.approx(5.0, abs=1e-12)
        assert {-1.0, 1.0} == set(np.sign(off[hit]))
        assert abs(np.count_nonzero(hit) - 60) < 4.5 * np.sqrt(60.0)  # 4.5 standard errors
    assert np.array_equal(bad["LAT"], good["LAT"])
    assert not np.array_equal(bad["p"] - good["p"], bad["r"] - good["r"])


@pytest.mark.parametrize("burst", [1, 5])
def test_samples_are_lost_by_share_and_burst(burst):
    """What is left has its own stamps and values; losses come as bursts at least so long."""
    bad, good = faulty(SampleLoss(share=0.05, burst=burst)), made()
    lost = np.isin(good.time, bad.time, invert=True)
    bursts = 0.05 * COUNT / burst
    # bursts are nearly Poisson: 4.5 of their standard error
    assert abs(np.count_nonzero(lost) - 0.05 * COUNT) < 4.5 * burst * np.sqrt(bursts)
    assert np.array_equal(bad.values, good.values[~lost])
    edges = np.diff(np.concatenate([[0], lost, [0]]).astype(int))
    runs = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    assert runs[:-1].min() >= burst


def test_a_gap_is_where_it_was_said():
    """From its start until its end, and nowhere else."""
    bad = faulty(RecordGap(at=20.0, lasts=0.5))
    assert len(bad) == COUNT - 50
    steps = np.diff(bad.time)
    assert steps.max() == pytest.approx(0.51, abs=1e-9)
    assert bad.time[np.argmax(steps)] == pytest.approx(19.99, abs=1e-9)


def test_a_fast_clock_counts_more():
    """Of the recorder: every stamp; of a second computer: its channels slip against the others."""
    good = made()
    bad = faulty(ClockDrift(ppm=500.0))
    assert bad.duration == pytest.approx(60.0 * 1.0005, rel=1e-12)
    assert np.array_equal(bad.values, good.values)
    slipped = faulty(ClockDrift(ppm=500.0, channels="p"))
    assert np.array_equal(slipped.time, good.time)
    true = np.sin(3.0 * good.time / 1.0005)
    # a cubic spline through a sine of 3 rad/s at 100 Hz: (w h)^4 / 384 = 2e-9
    assert slipped["p"] == pytest.approx(true, abs=1e-8)
    assert np.array_equal(slipped.select(("r", "LAT")), good.select(("r", "LAT")))


def test_a_seed_repeats_them_and_flights_differ(jr700):
    """In flight: the same seed, the same losses; each flight its own; the truth as ever."""
    faults = [SensorSpikes(channels="r", size=3.0, per_minute=30.0), SampleLoss(share=0.02)]
    doublet = Doublet(axis="ped", duration=12.0)
    plain = fly(jr700, doublet, count=2, seed=4, jobs=1)
    bad = fly(jr700, FlightPlan(excitation=doublet, faults=faults), count=2, seed=4, jobs=1)
    again = fly(jr700, FlightPlan(excitation=doublet, faults=faults), count=2, seed=4, jobs=2)
    for one, other, good in zip(bad, again, plain):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.values, other.values)
        kept = np.isin(good.time, one.time)
        assert 0 < np.count_nonzero(~kept) < 100
        assert np.array_equal(one["p"], good["p"][kept])
        assert np.abs(one["r"] - good["r"][kept]).max() == pytest.approx(3.0)
    assert not np.array_equal(bad[0].time, bad[1].time)
    assert [one["kind"] for one in bad[0].provenance["faults"]] == ["SensorSpikes", "SampleLoss"]


def test_a_fault_needs_its_channels_and_some_samples():
    """A channel that isn't recorded, and a recorder that writes nothing."""
    with pytest.raises(UnknownNameError, match="p, r, LAT"):
        faulty(SensorDropout(channels="q", at=1.0, lasts=1.0))
    with pytest.raises(InputError, match="lose less"):
        faulty(RecordGap(at=0.0, lasts=100.0))


# Faults as text


EXAMPLES = {
    "servo_front:stuck@30": ServoStuck(servo="servo_front", at=30.0),
    "servo_left:stuck@3.5,position=-0.1": ServoStuck(servo="servo_left", at=3.5, position=-0.1),
    "servo_tail:weak@2,rate_limit=1,travel=0.2": ServoWeak(
        servo="servo_tail", at=2.0, rate_limit=1.0, travel=0.2
    ),
    "gyro:restart@30,lasts=0.5,output=held": GyroRestart(at=30.0, lasts=0.5, output="held"),
    "gyro:dropout@30,lasts=0.2,rates=p+q,reads=held": GyroDropout(
        at=30.0, lasts=0.2, rates=("p", "q"), reads="held"
    ),
    "p:spikes,size=5": SensorSpikes(channels="p", size=5.0),
    "servo_tail:spikes,size=0.2,per_minute=2": SensorSpikes(
        channels="servo_tail", size=0.2, per_minute=2.0
    ),
    "u+v+w:dropout@30,lasts=1": SensorDropout(channels=("u", "v", "w"), at=30.0, lasts=1.0),
    "recorder:loss,share=0.01,burst=3": SampleLoss(share=0.01, burst=3),
    "recorder:gap@30,lasts=0.5": RecordGap(at=30.0, lasts=0.5),
    "recorder:drift,ppm=-200": ClockDrift(ppm=-200.0),
    " recorder : drift , ppm = 50 , channels = p + q": ClockDrift(ppm=50.0, channels=("p", "q")),
}


@pytest.mark.parametrize("text", EXAMPLES)
def test_a_text_is_the_fault_it_says(text):
    """Each form of the notation, and back and forth through the plain data of a plan."""
    fault = parse_fault(text)
    assert fault == EXAMPLES[text]
    plan = FlightPlan(excitation=Sweep(axis="lat"), faults=(fault,))
    assert FlightPlan.from_dict(plan.to_dict()) == plan


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a fault is PART:KIND"),
        ("servo_front", "such as servo_front:stuck@30"),
        ("servo_front:", "a fault is PART:KIND"),
        ("servo_rear:stuck@3", "did you mean servo_"),
        ("servo_front:broken@3", "available: stuck, weak, spikes, dropout"),
        ("gyro:stuck@3", "available: restart, dropout"),
        ("p:stuck@3", "available: spikes, dropout"),
        ("recorder:spikes,size=1", "available: loss, gap, drift"),
        ("servo_front:stuck@soon", "at must be a number .*got 'soon'"),
        ("servo_front:stuck", "needs at"),
        ("gyro:dropout@3", "needs lasts"),
        ("p:spikes@3,size=1", "available: channels, size, per_minute"),
        ("gyro:restart@3,for=1", "unknown setting .* 'for'; available: at, lasts, output"),
        ("gyro:restart@3,lasts", "NAME=VALUE"),
        ("gyro:restart@3,lasts=long", "lasts must be a number"),
        ("servo_front:stuck@3,servo=servo_left", "servo is 'servo_front' already"),
        ("servo_front:stuck@3,at=4", "at is given twice"),
        ("recorder:loss,share=0.1,burst=1.5", "burst must be an integer"),
        ("gyro:restart@inf", "got inf"),
    ],
)
def test_a_text_that_is_no_fault_is_refused(text, says):
    """In one line that says which there are."""
    with pytest.raises(InputError, match=says) as caught:
        parse_fault(text)
    assert "\n" not in str(caught.value)
