"""A sensor channel more: its line among the channels, and its line in the recorder's table."""

import dataclasses

import numpy as np
import pytest
from rerun.chunk import RrdReader

from helisim.ident import frequency_response
from helisim.records.channels import CHANNELS, SERVO_POSITIONS, Channel
from helisim.records.record import FlightRecord
from helisim.records.storage import read_record, write_record
from helisim.show.recording import write_recording
from helisim.sim import FlightEnvelope, FlightPlan, Recorder, Sweep, Weather, fly, fly_all, recorder
from helisim.sim.flight import simulate

SHORT = Sweep(axis="lon", duration=20.0)
WINDY = Weather(wind=4.0)
QUIET = {"antialias_hz": 400.0, "rate_hz": 1000.0, "latency": {}, "noise": {}, "resolution": {}}
CLOCK = 1e-9
"""MuJoCo's added-up time is 1e-12 s off the recorder's in 20 s, of signals below 100 units/s."""


@pytest.fixture
def pitot(monkeypatch):
    """The two edits of docs/extend/channel.md: a pitot tube that looks ahead."""
    one = Channel("airspeed", "m/s", "OTHER", "forward speed through the air, of a pitot tube")
    monkeypatch.setitem(CHANNELS, "airspeed", one)
    monkeypatch.setitem(
        recorder._MEASURED,
        ("airspeed",),
        lambda flight: flight.velocities[:, :1] - flight.air[:, :1],
    )
    return one


def windy(**settings):
    return FlightPlan(excitation=SHORT, recorder=Recorder(**settings), weather=WINDY)


def test_it_is_recorded_and_leaves_the_others_as_they_are(jr700, pitot, monkeypatch):
    """Every other channel has the same bits, noise included."""
    (with_it,) = fly(jr700, windy(), seed=3)
    monkeypatch.delitem(recorder._MEASURED, ("airspeed",))
    (without,) = fly(jr700, windy(), seed=3)
    assert with_it.names == (*without.names, "airspeed")
    assert np.array_equal(with_it.select(without.names), without.values)
    assert with_it.channels[-1] == pitot
    assert with_it["airspeed"].mean() == pytest.approx(4.0, abs=0.5)  # it sways in the sweep


def test_it_has_its_own_latency_noise_and_resolution(jr700, pitot):
    """Named in the recorder's settings as any other."""
    trajectory = next(simulate(jr700, windy(), seed=3))

    def seen(**settings):
        one = Recorder(**{**QUIET, **settings})
        return one.record(trajectory, np.random.default_rng(1), {})["airspeed"]

    true = (trajectory.velocities - trajectory.air[:, :3])[:, 0]
    assert seen()[::2] == pytest.approx(true, abs=CLOCK)
    late = np.interp(trajectory.time - 0.1, trajectory.time, true)
    assert seen(latency={"airspeed": 0.1})[::2] == pytest.approx(late, abs=CLOCK)
    noise = seen(noise={"airspeed": 0.3}) - seen()
    assert abs(noise.std() / 0.3 - 1.0) < 4.5 / np.sqrt(2.0 * noise.size)  # 4.5 standard errors
    assert set(np.round(seen(resolution={"airspeed": 0.25}) / 0.25, 9) % 1.0) == {0.0}


def test_what_reads_records_takes_it(jr700, pitot, tmp_path):
    """Files, the last second, frequency responses and recordings."""
    (flown,) = fly(jr700, windy(), seed=3)
    for name in ("flown.parquet", "flown.csv"):
        write_record(flown, tmp_path / name)
        assert np.array_equal(read_record(tmp_path / name)["airspeed"], flown["airspeed"])
    asked = {"inputs": "LON", "outputs": "q", "band": (3.0, 20.0)}
    rest = tuple(one for one in flown.channels if one != pitot)
    values = flown.select([one.name for one in rest])
    without = FlightRecord(flown.time, values, rest, flown.provenance)
    found = frequency_response(flown, **asked)
    assert np.array_equal(found.response, frequency_response(without, **asked).response)
    of_it = frequency_response(flown, inputs="LON", outputs="airspeed", band=(3.0, 20.0))
    assert np.isfinite(of_it.response).all()
    path = write_recording(tmp_path / "flown.rrd", {"lon": flown}, model=jr700.model)
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream()]
    labels = [
        one.column("SeriesLines:names")
        for one in batches
        if "SeriesLines:names" in one.schema.names
    ]
    assert "airspeed [m/s]" in str(labels)
    tight = dataclasses.replace(windy(), envelope=FlightEnvelope(tilt=0.1))
    last = next(fly_all(jr700, tight, [0], seed=3)).last_second
    assert "airspeed" in last.names


def test_servo_positions_are_recorded_on_request(jr700):
    """What the servos truly did, late on what they were told; beside the rotor's truth."""
    plan = FlightPlan(excitation=SHORT, recorder=Recorder(**QUIET, rotor=True))
    (flown,) = fly(jr700, plan, seed=3)
    truth = next(simulate(jr700, plan, seed=3))
    assert flown.select(SERVO_POSITIONS)[::2] == pytest.approx(truth.servo_positions, abs=CLOCK)
    assert np.abs(truth.servo_positions - truth.servo_commands).max() > 1e-3
    (usual,) = fly(jr700, SHORT, seed=3)
    assert not set(SERVO_POSITIONS) & set(usual.names)
