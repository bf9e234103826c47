"""The lock step against a played autopilot: whatever the way does, each frame is flown once."""

import math
import threading
import time
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import helisim.sitl.link as link_module
import lock_step
import played_autopilot as played
from helisim.base.errors import DivergedError, InputError
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.sim import Ground, Weather
from helisim.sitl import Link, Sensed, serve
from helisim.sitl.aircraft import Aircraft, _steps
from helisim.sitl.link import answer, read_frame
from helisim.vehicle import load
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import Motion, write_motion

SENSED = Sensed(
    time=12.3456,
    gyro=np.array([0.1, -0.2, 1e-12]),
    force=np.array([1.0, -2.0, -9.81]),
    position=np.array([1234.56789, -2.0, -1e-9]),
    velocity=np.array([3.0, 4.0, 0.0]),
    quaternion=np.array([np.cos(0.25), 0.0, 0.0, np.sin(0.25)]),
)


class Served:
    """A backend that serves an aircraft that counts, in a thread; what it flew, and when anew."""

    def __init__(self, *, slow=()):
        self.aircraft, self.flown, self.resets = lock_step.Counting(), [], 0
        self.aircraft.reset = self._reset
        self.link = Link(0)
        self._slow, self._over, self._autopilots = dict(slow), False, []
        self._thread = threading.Thread(
            target=serve, args=(self.aircraft, self.link), kwargs={"on_frame": self._on_frame}
        )

    def _reset(self):
        self.resets += 1
        self.aircraft.time = 0.0

    def _on_frame(self, frame, _sensed):
        if not self._over:
            self.flown.append(frame.count)
            time.sleep(self._slow.get(frame.count, 0.0))
        return self._over

    def autopilot(self, resend=0.1):
        self._autopilots.append(played.PlayedAutopilot(self.link.port, resend=resend))
        return self._autopilots[-1]

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.told = replace(self.link.served)
        self._over = True
        while self._thread.is_alive():
            for one in self._autopilots:
                one.count += 1
                one.send((1000,))
            self._thread.join(0.05)
        self.link.__exit__()
        for one in self._autopilots:
            one.close()


@pytest.mark.parametrize("channels", [16, 32])
def test_a_packet_is_what_the_protocol_says(channels):
    autopilot = played.PlayedAutopilot(1, channels=channels)
    autopilot.count = 70_000
    autopilot.close()
    frame = read_frame(autopilot.packet((1100, 1900)))
    assert frame.rate_hz == 1200
    assert frame.count == 70_000
    assert frame.pulses == (1100, 1900, *[1500] * (channels - 2))


def test_the_parser_reads_every_number():
    row = answer(SENSED).replace(b"\n", b"\0")
    read = played.read(row, 1)
    assert played.read(row.replace(b'"gyro":', b'"gyro": '), 1) is None
    assert list(read) == [name for _, name, _, _ in played.FIELDS]
    assert read["timestamp"] == pytest.approx(SENSED.time, rel=2e-6)
    names = {"gyro": "gyro", "accel_body": "force", "position": "position", "velocity": "velocity"}
    for name, held in {**names, "quaternion": "quaternion"}.items():
        digits = 1e-11 if name == "position" else 1e-8
        np.testing.assert_allclose(read[name], getattr(SENSED, held), rtol=digits)


@pytest.mark.parametrize("begins", [0, 3_599_000])
def test_a_clock_that_cuts_microseconds_loses_none(begins):
    """ArduPilot's clock goes on by whole microseconds of each difference, cut, not rounded."""
    times = [
        played.read(answer(replace(SENSED, time=1e-3 * k)).replace(b"\n", b"\0"), 1)["timestamp"]
        for k in range(begins, begins + 1000)
    ]
    assert {int(1e6 * (after - before)) for before, after in pairwise(times)} == {1000}


def test_a_frame_that_comes_again_gets_the_same_bytes_and_a_second_autopilot_none():
    with Served() as served:
        autopilot = served.autopilot()
        autopilot.send((1100,))
        first = autopilot.receive()
        autopilot.send((1900,))
        assert autopilot.receive() == first
    assert served.flown == [0]
    assert served.told.repeated == 1
    with Served() as served:
        first, second = served.autopilot(), served.autopilot()
        first.frame((1000,))
        for _ in range(20):
            second.send()
            first.frame((1000,))
    assert served.flown == list(range(21))
    assert served.told.ignored == 20


def test_an_autopilot_that_starts_anew_finds_the_helicopter_on_the_ground(monkeypatch):
    monkeypatch.setattr(link_module, "SILENT", 0.1)
    monkeypatch.setattr(link_module, "_AT_ONCE", 0.1)
    with Served() as served:
        first = served.autopilot()
        for _ in range(20):
            first.frame((1000,))
        again = served.autopilot()
        assert again.frame((1000,))["timestamp"] == pytest.approx(1e-3)
        assert again.frame((1000,))["timestamp"] == pytest.approx(2e-3)
    told = served.told
    assert (served.resets, told.starts, told.frames) == (1, 2, 22)
    assert told.seconds == pytest.approx(0.022)
    assert "2 starts of the autopilot" in str(told)


def test_a_late_frame_is_no_start_and_a_strangers_packet_no_end(monkeypatch):
    monkeypatch.setattr(link_module, "_AT_ONCE", 0.05)
    with Served() as served:
        autopilot = served.autopilot()
        autopilot._socket.sendto(b"hello", ("127.0.0.1", served.link.port))
        for _ in range(5):
            autopilot.frame((1000,))
        time.sleep(0.1)
        autopilot.count = 3
        autopilot.send()
        autopilot.count = 5
        assert autopilot.frame((1000,))["timestamp"] == pytest.approx(6e-3)
        time.sleep(0.1)
        autopilot.count = 0
        assert autopilot.frame((1000,))["timestamp"] == pytest.approx(1e-3)
    assert "5 bytes with the magic number 25960" in served.link.stranger
    assert served.flown == [*range(6), 0]
    assert (served.resets, served.told.ignored) == (1, 2)


def test_frames_that_never_come_late_or_again_are_told():
    """A count that jumps is flown and told; one that falls at once is a packet on a detour.

    A step that takes longer than the autopilot's patience leaves no answer too many behind.
    """
    with Served(slow={11: 0.25}) as served:
        autopilot = served.autopilot()
        for count in (3, 4, 9, 10):
            autopilot.count = count
            autopilot.frame((1000,))
        autopilot.count = 8
        autopilot.send()
        autopilot.count = 11
        times = [autopilot.frame((1000,))["timestamp"] for _ in range(5)]
    told = served.told
    assert served.flown == [3, 4, 9, 10, *range(11, 16)]
    assert (told.dropped, told.ignored, autopilot.resent) == (4, 1, 2)
    assert "4 never came, 1 packets were of no use" in str(told)
    np.testing.assert_allclose(times, 1e-3 * np.arange(5, 10), rtol=2e-6)


def test_a_bad_way_stops_nothing():
    proof = lock_step.prove(200, share=0.1, resend=0.01)
    assert len(proof.did) == 6
    assert proof.faults == []


def test_what_the_proof_looks_for_it_finds(monkeypatch):
    way = {"share": 0.05, "kinds": ("doubled",)}
    assert lock_step.prove(300, **way).faults == []

    monkeypatch.setattr(link_module, "_newer", lambda link, frame: None)
    assert lock_step.prove(300, **way).faults == ["the autopilot was left behind"]


# A vehicle that stands on the ground is flown by pulses, and tells what its IMU feels.

LOW = [1234, 1234, 1234, 1500, 0, 0, 0, 1000, *[0] * 8]
"""Blades at their lowest useful pitch, the motor off."""
SPOOLED = [*LOW[:7], 1700, *LOW[8:]]


@pytest.fixture
def falling():
    aircraft = Aircraft("jr700")
    par = aircraft.model.actuator_user[addresses(aircraft.model).rotor]
    par[PARAM.air_density] = 1e-9
    return aircraft


def held(aircraft, seconds, pulses=LOW):
    with installed():  # once: each block that is opened examines the model anew
        for _ in range(round(1000 * seconds)):
            aircraft.step(pulses)
    return aircraft.sensed


@pytest.mark.parametrize(
    "name", ["jr700", *(pytest.param(one, marks=pytest.mark.slow) for one in ("blade360", "lynx"))]
)
def test_at_rest_the_accelerometer_feels_the_ground_hold_it(name):
    """Specific force at rest is -g: 0, 0, -g, down being positive."""
    aircraft = Aircraft(name)
    gravity = -float(aircraft.model.opt.gravity[2])
    sensed = held(aircraft, 0.5)
    assert sensed.force == pytest.approx([0.0, 0.0, -gravity], abs=2e-4 * gravity)
    assert sensed.gyro == pytest.approx(np.zeros(3), abs=1e-6)
    assert sensed.position == pytest.approx(np.zeros(3), abs=1e-6)


def test_on_a_slope_it_feels_gravity_turned_into_its_own_axes():
    """Nose up a slope: pitched by its angle, gravity pulls it back along the body."""
    aircraft = Aircraft("jr700", ground=Ground(slope=0.1))
    sensed = aircraft.sensed
    gravity = -float(aircraft.model.opt.gravity[2])
    level = [gravity * math.sin(0.1), 0.0, -gravity * math.cos(0.1)]
    assert sensed.force == pytest.approx(level, abs=1e-3 * gravity)
    turn = Rotation.from_quat(sensed.quaternion, scalar_first=True)
    assert turn.as_euler("ZYX") == pytest.approx([0.0, 0.1, 0.0], abs=1e-4)


def test_falling_freely_it_feels_nothing(falling):
    falling.data.qpos[2] += 20.0
    sensed = held(falling, 1.0)
    assert sensed.force == pytest.approx(np.zeros(3), abs=1e-6)
    assert sensed.velocity == pytest.approx([0.0, 0.0, 9.8015], abs=1e-6)


def test_turning_freely_it_feels_the_way_to_its_centre(falling):
    """Away from the centre of gravity by r, turning at w about a principal axis: w x (w x r)."""
    spin = np.array([0.0, 0.0, 3.0])
    write_motion(falling.model, falling.data, Motion(r=3.0, down=-20.0))
    turned = 3.0 / falling.vehicle.parameters["main_rotor.speed"]  # of the blades, with the body
    falling.data.act[addresses(falling.model).state + STATE.speed] = turned
    sensed = held(falling, 0.001)
    arm = np.array(falling.vehicle.imu_offset)
    assert np.linalg.norm(arm[:2]) > 0.01
    assert sensed.gyro == pytest.approx(spin, abs=1e-4)
    assert sensed.force == pytest.approx(np.cross(spin, np.cross(spin, arm)), abs=2e-3)


def test_rates_velocities_and_attitude_are_of_one_motion(falling):
    write_motion(falling.model, falling.data, Motion(p=1.0, q=-0.7, r=0.5, u=3.0, down=-40.0))
    told = [held(falling, 0.001) for _ in range(201)]
    early, middle, late = told[99], told[100], told[101]
    span = late.time - early.time
    assert (late.position - early.position) / span == pytest.approx(middle.velocity, abs=2e-5)
    before, after = (Rotation.from_quat(s.quaternion, scalar_first=True) for s in (early, late))
    turned = (before.inv() * after).as_rotvec() / span
    assert turned == pytest.approx(middle.gyro, abs=1e-5)


def test_pulses_act_from_the_answer_before_them_on(falling):
    """A servo of second order answers to a step of its command as from the frame's start."""
    falling.data.qpos[2] += 20.0
    falling.data.act[addresses(falling.model).state :][: STATE.tail_rate + 1] = 0.0
    middle = [1500, 1500, 1500, 1500, *LOW[4:]]
    held(falling, 0.002, middle)
    first, found = falling.data.act[addresses(falling.model).state + STATE.front_position], []
    for _ in range(10):
        held(falling, 0.001, [1520, *middle[1:]])
        found.append(falling.data.act[addresses(falling.model).state + STATE.front_position])
    time, frequency, damping = 1e-3 * np.arange(1, 11), 200.0, 0.7
    fast = frequency * math.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * frequency * time)
    slow = damping * frequency / fast
    step = 0.03 * (1.0 - decay * (np.cos(fast * time) + slow * np.sin(fast * time)))
    assert abs(first) < 1e-12
    assert np.abs(found - step).max() < 1e-6


def test_an_ideal_governor_spools_up_within_12_s_and_down_likewise():
    aircraft = Aircraft("jr700", motor=False)
    for pulses, speed in ((SPOOLED, 0.06), (LOW, 0.03)):
        held(aircraft, 0.72 if pulses is SPOOLED else 0.36, pulses)
        assert aircraft.rotor_speed == pytest.approx(speed, rel=1e-6)


@pytest.mark.parametrize("tick", [1000, 1250, 2500, 4000, 400])
@pytest.mark.parametrize("longest", [250, 300, 1000, 2000])
def test_time_steps_are_the_longest_that_fit_a_frame_and_the_gyros_tick(tick, longest):
    vehicle = SimpleNamespace(
        parameters={"gyro.period": 1e-6 * tick},
        model=SimpleNamespace(opt=SimpleNamespace(timestep=1e-6 * longest)),
    )
    fits = (n for n in range(1, 100) if n * tick % 1000 == 0 and n * longest >= 1000)
    assert _steps(vehicle) == next(fits)


@pytest.mark.slow
def test_it_spools_up_without_turning_and_runs_down_and_without_a_motor_follows_slowly():
    aircraft = Aircraft("jr700")
    sensed = held(aircraft, 12.0, SPOOLED)
    assert aircraft.rotor_speed == pytest.approx(1.0, abs=2e-3)
    turned = 2.0 * math.atan2(sensed.quaternion[3], sensed.quaternion[0])
    assert abs(turned) < math.radians(0.1)
    assert np.abs(sensed.position).max() < 1e-3
    held(aircraft, 5.0)
    assert aircraft.rotor_speed < 0.45
    assert aircraft.stands
    assert not aircraft.crashed
    aircraft = Aircraft(load("lynx", parameters={"drive.inertia": 0.0}))  # without a motor
    held(aircraft, 6.0, SPOOLED)
    assert aircraft.rotor_speed == pytest.approx(0.5, abs=1e-3)


@pytest.mark.slow
def test_a_hard_landing_ends_the_flight_and_tipping_over_strikes_the_rotor():
    aircraft = Aircraft("jr700", recorded=True)
    aircraft.data.qpos[2] += 1.0
    sensed = held(aircraft, 3.0)
    assert aircraft.crashed == "the helicopter hit the ground at 4.4 m/s"  # sqrt(2 g h)
    assert np.abs(sensed.velocity).max() < 0.05
    assert aircraft.record().ended.startswith("the helicopter hit the ground at 4.4 m/s at 0.4")
    aircraft.reset()
    assert not aircraft.crashed
    assert aircraft.time == 0.0
    aircraft = Aircraft("jr700")
    write_motion(aircraft.model, aircraft.data, Motion(phi=1.2, down=-0.8))
    held(aircraft, 1.0, SPOOLED)
    assert aircraft.crashed == "the main rotor struck the ground"
    assert aircraft.rotor_speed == pytest.approx(
        0.0, abs=1e-3
    )  # it turns with the body, at 0.1 rad/s


def told(aircraft):
    pulses = np.array(SPOOLED)
    rng = np.random.default_rng(5)
    with installed():
        for _ in range(300):
            pulses[:4] = 1300 + rng.integers(0, 400, 4)
            sensed = aircraft.step(pulses.tolist())
    return np.concatenate([sensed.force, sensed.gyro, sensed.position, sensed.quaternion])


def test_the_same_pulses_make_the_same_flight_again_and_after_a_reset():
    weather = Weather(wind=3.0, turbulence="light")
    first, second = (Aircraft("jr700", weather=weather, recorded=True) for _ in range(2))
    assert told(first).tobytes() == told(second).tobytes()
    assert first.record() == second.record()
    kept = first.record()
    first.reset()
    second.reset()
    assert told(first).tobytes() == told(second).tobytes()
    assert first.record() == kept


def test_a_record_says_what_flew():
    aircraft = Aircraft("jr700", recorded=True)
    held(aircraft, 1.0, SPOOLED)
    record = aircraft.record()
    assert record.duration == pytest.approx(1.0)
    # which the recorder's filter has 10 ms later
    assert record["rotor_speed"][-1] == pytest.approx(178.02 * aircraft.rotor_speed, rel=0.03)
    assert record["servo_front"][-1] == pytest.approx(0.75 * (1234 - 1500) / 500, abs=1e-6)
    assert record.provenance["autopilot"] == {"rate_hz": 1000.0}
    assert record.ended == ""
    aircraft.reset()
    held(aircraft, 0.115, SPOOLED)
    with pytest.raises(InputError, match=r"0\.116 s is no record: fly 0\.12 s"):
        aircraft.record()
    held(aircraft, 0.001, SPOOLED)
    assert len(aircraft.record()) == 12  # from 0 to 0.11 s
    with pytest.raises(InputError, match="recorded=True"):
        Aircraft("jr700").record()


def test_numbers_that_break_are_never_answered_nor_recorded():
    aircraft = Aircraft("jr700", recorded=True)
    held(aircraft, 0.5)
    aircraft.data.qvel[0] = np.nan
    with pytest.raises(DivergedError, match="no finite state"):
        aircraft.step(LOW)
    assert aircraft.record().ended == "the flight has no finite state at 0.50 s"
    with pytest.raises(InputError, match="0 or more"):
        Aircraft("jr700", seed=-1)
