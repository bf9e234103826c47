"""The lock step against a played autopilot: whatever the way does, each frame is flown once."""

import sys
import threading
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import helisim.sitl.link as link_module
from helisim.sitl import Link, Sensed, serve
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
        """Return a played autopilot, which waits `resend` s before it sends again."""
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


@pytest.mark.slow
def test_a_bad_way_to_the_real_autopilot_stops_nothing(ardupilot):
    """It waits a second for each answer that it can't read, and flies on."""
    proof = lock_step.prove_real(2000, ardupilot, share=0.004, seed=3)
    assert proof.faults == []
    assert proof.served.frames == 2000
    assert sum(proof.did.values()) >= 10


def test_what_the_proof_looks_for_it_finds(monkeypatch):
    way = {"share": 0.05, "kinds": ("doubled",)}
    assert lock_step.prove(300, **way).faults == []

    monkeypatch.setattr(link_module, "_newer", lambda link, frame: None)
    assert lock_step.prove(300, **way).faults == ["the autopilot was left behind"]
