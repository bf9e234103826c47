"""The lock step against a played autopilot: whatever the way does, each frame is flown once."""

import socket
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import helisim.sitl.link as backend_module
import helisim.sitl.link as link_module
from helisim.base.errors import InputError, UnknownNameError
from helisim.sitl import Backend, Link, Sensed
from helisim.sitl.link import answer, read_frame
from script import SCRIPTS

sys.path.insert(0, str(SCRIPTS / "proof"))

import lock_step
import played_autopilot as played

SENSED = Sensed(
    time=12.3456,
    gyro=np.array([0.1, -0.2, 1e-12]),
    force=np.array([1.0, -2.0, -9.81]),
    position=np.array([1234.56789, -2.0, -1e-9]),
    velocity=np.array([3.0, 4.0, 0.0]),
    quaternion=np.array([np.cos(0.25), 0.0, 0.0, np.sin(0.25)]),
    wind=np.array([0.0, 4.0, 0.0]),
    clearance=2.5,
)


class Served:
    """A backend that serves an aircraft that counts, in a thread; what it flew, and when anew."""

    def __init__(self, *, slow=()):
        self.aircraft, self.flown, self.resets = lock_step.Counting(), [], 0
        self.aircraft.reset = self._reset
        self.link = Link(0)
        self.backend = Backend(self.aircraft, self.link, on_frame=self._on_frame)
        self._slow, self._over, self._autopilots = dict(slow), False, []
        self._thread = threading.Thread(target=self.backend.run)

    def _reset(self):
        self.resets += 1
        self.aircraft.time = 0.0

    def _on_frame(self, frame, _sensed):
        if not self._over:
            self.flown.append(frame.count)
            time.sleep(self._slow.get(frame.count, 0.0))
        return self._over

    def autopilot(self, resend=0.1):
        """Return a played autopilot, which waits `resend` s before it sends again."""
        self._autopilots.append(played.PlayedAutopilot(self.link.port, resend=resend))
        return self._autopilots[-1]

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self.told = self.backend.served
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
    """Little-endian: magic number, rate, count, and as many pulses as the magic number tells."""
    autopilot = played.PlayedAutopilot(1, channels=channels)
    autopilot.count = 70_000
    autopilot.close()
    frame = read_frame(autopilot.packet((1100, 1900)))
    assert frame.rate_hz == 1200
    assert frame.count == 70_000
    assert frame.pulses == (1100, 1900, *[1500] * (channels - 2))


def test_the_parser_reads_every_number():
    """All that is sent is found by a parser that walks strings; an unknown clearance isn't sent."""
    also = ("airspeed", "wind", "windvane", "rng", "no_time_sync")
    read = played.read(answer(SENSED, also).replace(b"\n", b"\0"), 1)
    assert list(read) == [name for _, name, _, _ in played.FIELDS]
    assert read["timestamp"] == pytest.approx(SENSED.time, rel=2e-6)
    np.testing.assert_allclose(read["gyro"], SENSED.gyro, rtol=1e-8)
    np.testing.assert_allclose(read["accel_body"], SENSED.force, rtol=1e-8)
    np.testing.assert_allclose(read["position"], SENSED.position, rtol=1e-11)
    np.testing.assert_allclose(read["velocity"], SENSED.velocity)
    np.testing.assert_allclose(read["quaternion"], SENSED.quaternion, rtol=1e-8)
    np.testing.assert_allclose(read["velocity_wind"], SENSED.wind)
    assert read["airspeed"] == pytest.approx(3.0)  # north through air that goes east with it
    assert read["speed"] == pytest.approx(3.0)
    # flying north, nose half a radian to the right: the wind is felt from the left of it
    assert read["direction"] == pytest.approx(2.0 * np.pi - 0.5)
    assert read["rng_1"] == pytest.approx(2.5)
    assert read["no_time_sync"] == 1.0
    unknown = Sensed(*(getattr(SENSED, name) for name in list(SENSED.__dict__)[:6]))
    assert b"rng" not in answer(unknown, also)


@pytest.mark.parametrize("begins", [0, 3_599_000])
def test_a_clock_that_cuts_microseconds_loses_none(begins):
    """ArduPilot's clock goes on by whole microseconds of each difference, cut, not rounded."""
    times = [
        played.read(answer(replace(SENSED, time=1e-3 * k)).replace(b"\n", b"\0"), 1)["timestamp"]
        for k in range(begins, begins + 1000)
    ]
    assert {int(1e6 * (after - before)) for before, after in pairwise(times)} == {1000}


def test_the_played_parser_has_the_ways_of_the_real_one():
    """It fails on a space behind a name, as the real one was seen to."""
    row = answer(SENSED).replace(b"\n", b"\0")
    assert played.read(row, 1) is not None
    assert played.read(row.replace(b'"gyro":', b'"gyro": '), 1) is None
    assert played.read(row.replace(b"imu", b"inu"), 1) is None


def test_each_frame_is_a_step():
    """Two hundred frames: as many milliseconds, nothing lost."""
    with Served() as served:
        autopilot = served.autopilot(resend=5.0)
        times = [autopilot.frame((1000,))["timestamp"] for _ in range(200)]
    np.testing.assert_allclose(times, 1e-3 * np.arange(1, 201), rtol=2e-6)
    assert served.flown == list(range(200))
    assert "none lost, none repeated" in str(served.told)


def test_a_frame_that_comes_again_gets_the_same_bytes():
    """The same frame twice is one step; other pulses in it change nothing."""
    with Served() as served:
        autopilot = served.autopilot()
        autopilot.send((1100,))
        first = autopilot.receive()
        autopilot.send((1900,))
        assert autopilot.receive() == first
    assert served.flown == [0]
    assert served.told.repeated == 1


def test_a_frame_sent_again_while_it_is_flown_gets_one_answer():
    """A step that takes longer than the autopilot's patience leaves no answer too many behind."""
    with Served(slow={5: 0.25}) as served:
        autopilot = served.autopilot()
        times = [autopilot.frame((1000,))["timestamp"] for _ in range(50)]
    assert autopilot.resent == 2
    np.testing.assert_allclose(times, 1e-3 * np.arange(1, 51), rtol=2e-6)


def test_an_autopilot_that_starts_anew_finds_the_helicopter_on_the_ground(monkeypatch):
    """Its count is 0 again: the vehicle is placed anew, and time begins at 0."""
    monkeypatch.setattr(link_module, "SILENT", 0.1)
    monkeypatch.setattr(backend_module, "_AT_ONCE", 0.1)
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


def test_a_second_autopilot_is_not_served_beside_the_first():
    """Its packets are counted, and the first flies on undisturbed."""
    with Served() as served:
        first, second = served.autopilot(), served.autopilot()
        first.frame((1000,))
        for _ in range(20):
            second.send()
            first.frame((1000,))
    assert served.flown == list(range(21))
    assert served.told.strangers == 20


def test_a_backend_that_starts_later_takes_a_running_autopilot():
    """Its count goes on; time begins at 0, which the autopilot takes as a reset of the physics."""
    with Served() as served:
        autopilot = served.autopilot()
        autopilot.count, autopilot._time = 5000, 12.0
        assert autopilot.frame((1000,))["timestamp"] == pytest.approx(1e-3)
        autopilot.frame((1000,))
    assert autopilot.resets == 1
    assert (served.flown, served.resets) == ([5000, 5001], 0)


def test_counts_begin_again_after_the_last():
    """2^32 frames are 50 days: the count goes on at 0, and nothing starts anew."""
    with Served() as served:
        autopilot = served.autopilot()
        autopilot.count = 2**32 - 1
        autopilot.frame((1000,))
        autopilot.count = 0
        autopilot.frame((1000,))
    assert (served.flown, served.resets) == ([2**32 - 1, 0], 0)


def test_frames_that_never_come_and_come_late_are_told():
    """A count that jumps is flown and told; one that falls at once is a packet on a detour."""
    with Served() as served:
        autopilot = served.autopilot()
        for count in (3, 4, 9, 10):
            autopilot.count = count
            autopilot.frame((1000,))
        autopilot.count = 8
        autopilot.send()
        autopilot.count = 11
        autopilot.frame((1000,))
    told = served.told
    assert served.flown == [3, 4, 9, 10, 11]
    assert (told.dropped, told.late) == (4, 1)
    assert "4 never came, 1 came late" in str(told)


def test_a_bad_way_stops_nothing():
    """A tenth of all packets lost, doubled or cut: all flown once, in order, one answer each."""
    proof = lock_step.prove(200, share=0.1, resend=0.01)
    assert len(proof.did) == 6
    assert proof.faults == []


@pytest.mark.slow
def test_a_bad_way_stops_nothing_for_long():
    """One in a hundred, ten thousand frames."""
    proof = lock_step.prove(10_000, share=0.01, resend=0.02)
    assert proof.faults == []
    assert sum(proof.did.values()) > 100


@pytest.mark.slow
def test_a_bad_way_to_the_real_autopilot_stops_nothing(ardupilot):
    """It waits a second for each answer that it can't read, and flies on."""
    proof = lock_step.prove_real(2000, ardupilot, share=0.004, seed=3)
    assert proof.faults == []
    assert proof.served.frames == 2000
    assert sum(proof.did.values()) >= 10


def test_what_the_proof_looks_for_it_finds(monkeypatch):
    """An answer too many leaves the autopilot behind for good, unless the backend heals it."""
    way = {"share": 0.05, "kinds": ("doubled",)}
    assert lock_step.prove(300, **way).faults == []
    monkeypatch.setattr(Backend, "_newer", lambda *_: None)
    assert lock_step.prove(300, **way).faults == ["the autopilot was left behind"]


@pytest.mark.parametrize(
    ("packet", "said"),
    [
        (bytes(64), "model gazebo"),
        (b"\xfd" + bytes(20), "MAVLink"),
        (b"hello", "magic number 25960; expected 18458 or 29569"),
    ],
)
def test_another_protocol_is_told(packet, said):
    with Link(0) as link, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(packet, ("127.0.0.1", link.port))
        with pytest.raises(InputError, match=said):
            link.receive()


def test_no_packet_does_harm():
    """Any bytes are a frame, a cut one, or another protocol's."""
    random = np.random.default_rng(1)
    read = 0
    for length in [*range(100), 2000]:
        for magic in (b"", b"\x1a\x48", b"\x81\x73"):
            with suppress(InputError):
                read += read_frame(magic + random.bytes(length)) is not None
    assert read == 2  # one of each length that is whole


def test_no_autopilot_is_told_with_how_to_start_one():
    with Link(0, timeout=0.02) as link, pytest.raises(InputError) as told:
        Backend(lock_step.Counting(), link).run()
    assert f"UDP port {link.port} in 0.02 s; start ArduPilot with" in str(told.value)
    assert f"--sim-port-out {link.port}" in str(told.value)


def test_a_socket_that_is_bound_elsewhere_is_a_link():
    """As one that was made in another network."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bound.bind(("127.0.0.1", 0))
    with Link.over(bound, timeout=5.0) as link:
        autopilot = played.PlayedAutopilot(link.port)
        autopilot.send((1234,))
        assert link.receive().pulses[0] == 1234
        autopilot.close()
    assert bound.fileno() == -1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"port": 70000}, "a UDP port is 1 to 65535"),
        ({"port": 0, "timeout": 0.0}, "timeout"),
        ({"port": 0, "address": "192.0.2.1"}, "of 192.0.2.1 can't be bound"),
    ],
)
def test_a_link_that_can_not_be_is_told(options, said):
    with pytest.raises(InputError, match=said):
        Link(**options)


def test_a_field_that_no_answer_has_is_told():
    with Link(0) as link, pytest.raises(UnknownNameError, match="available: airspeed, wind"):
        Backend(lock_step.Counting(), link, also=("battery",))
