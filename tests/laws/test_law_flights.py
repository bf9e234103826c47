"""Laws as files wherever a controller is taken: commands, records, other flights, hands, agents."""

import pickle

import numpy as np
import pytest
from small_laws import FULL, HOLDS

import helisim as hs
from helisim.base.errors import InputError
from helisim.cli import main

FLY = ["fly", "--excitation", "doublet", "--axis", "ped", "--quiet", "--out", "flown.parquet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A current folder with a law of ten lines."""
    (tmp_path / "law.toml").write_text(
        """kind = "attitude_command"
version = 1
phase = 0.365
lat = { stick = 0.6, frequency = 6.0, k_angle = 0.6, k_rate = 0.05, k_integral = 0.3 }
lon = { stick = 0.6, frequency = 6.0, k_angle = 1.0, k_rate = 0.1, k_integral = 0.3 }
ped = { stick = 3.0, frequency = 8.0, k_angle = 1.0, k_rate = 0.2, k_integral = 0.5 }
"""
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_flies_and_its_record_can_be_flown_again(folder, jr700):
    """From the command line; the record alone has the law and the seed, and gives the same bits."""
    assert main([*FLY, "--controller", "law.toml"]) == 0
    record = hs.read_record(folder / "flown.parquet")
    law = hs.law_of(record.provenance["controller"]["written"])
    assert law == HOLDS
    (again,) = hs.fly(jr700, hs.Doublet(axis="ped"), seed=record.provenance["seed"], controller=law)
    np.testing.assert_array_equal(again.values, record.values)


def test_a_file_is_linearised(folder, capsys):
    assert main(["linearize", "--inputs", "IN2", "--controller", "law.toml", "--json"]) == 0
    assert "law_0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "law.toml: a law says its kind, such as"),
        ("kind =", "law.toml: not TOML"),
        ('kind = "attitude_command"\nversion = 1', "needs lat and lon and ped"),
        ('kind = "pid"\nversion = 1', "unknown kind of law 'pid'; available: attitude_command"),
    ],
)
def test_what_is_no_law_ends_in_a_line_and_writes_nothing(folder, capsys, text, message):
    (folder / "law.toml").write_text(text)
    assert main([*FLY, "--controller", "law.toml"]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not (folder / "flown.parquet").exists()


def test_a_law_follows_the_vehicle_that_flies_it(jr700):
    """About the trim of another flight, and at another period of the ticks."""
    flying = jr700.with_controller(HOLDS)
    ahead = flying.trimmed(speed=5.0)
    assert ahead.controller.settings[3:5].tolist() == [ahead.trim.phi, ahead.trim.theta]
    assert ahead.linearize("IN2").system.nstates > sum(ahead.controller.state_counts)
    slower = flying.with_settings({"gyro.period": 0.004})
    assert slower.gyro.system.dt == slower.controller.settings[0] == 0.004
    assert np.abs(slower.linearize("IN2").system.poles()).max() < 1.0 + 1e-9  # neutral heading


def test_it_passes_to_another_process(jr700):
    flying = jr700.with_controller(FULL)
    passed = pickle.loads(pickle.dumps(flying))
    assert passed.controller.written == FULL
    flights = [hs.fly(one, hs.Step(axis="lat", amplitude=0.1), seed=1) for one in (flying, passed)]
    np.testing.assert_array_equal(flights[0][0].values, flights[1][0].values)


def test_hands_fly_by_it(jr700):
    """The attitude that 0.3 of a stick's travel of 0.5 asks for, without any assistance."""
    flight = hs.HandFlight(jr700.with_controller(HOLDS), assist="none", height=20.0)
    flight.start_recording()
    flight.fly(2.0, lat=0.3)
    angle = flight.stop_recording()["phi"][-20:].mean()
    assert angle == pytest.approx(flight.vehicle.trim.phi + 0.6 * 0.15, abs=0.02)  # still moving


def test_a_law_in_a_model_of_mujoco_s_own_needs_a_vehicle(jr700):
    with pytest.raises(InputError, match=r"give law\.on\(vehicle\)"):
        hs.set_controller(jr700.model, HOLDS)


@pytest.mark.slow
def test_a_mission_from_the_ground_to_the_ground(jr700):
    """Take-off, hover and landing by a pilot who moves the sticks of this law."""
    (record,) = hs.fly(jr700, hs.missions.TakeOffHoverLand(), seed=1, controller=HOLDS)
    reached = record.provenance["reached"]
    assert reached["finished"]
    assert reached["touch_down"]["sink"] < 0.5  # m/s; its autopilot asks for 0.3


@pytest.mark.slow
def test_an_agent_moves_its_sticks(jr700):
    """An environment whose agent leaves the sticks alone: the law holds the attitude for 6 s."""
    gymnasium = pytest.importorskip("gymnasium")
    import helisim.gym  # noqa: F401

    env = gymnasium.make("helisim/Hover-v0", vehicle=jr700.with_controller(HOLDS))
    env.reset(seed=3)
    still = np.zeros(env.action_space.shape, dtype=env.action_space.dtype)
    assert not any(env.step(still)[2] for _ in range(300))
