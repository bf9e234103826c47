"""Laws as files wherever a controller is taken: commands, records, other flights, hands, agents."""

import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import InputError
from helisim.cli import main
from small_laws import HOLDS

FLY = ["fly", "--excitation", "doublet", "--axis", "ped", "--quiet", "--out", "flown.parquet"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
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


def test_a_law_follows_the_vehicle_that_flies_it(jr700):
    """About the trim of another flight, and at another period of the ticks."""
    flying = jr700.with_controller(HOLDS)
    ahead = flying.trimmed(speed=5.0)
    assert ahead.controller.settings[1:3].tolist() == [ahead.trim.phi, ahead.trim.theta]
    assert ahead.linearize("IN2").system.nstates > sum(ahead.controller.state_counts)
    slower = flying.with_settings({"gyro.period": 0.004})
    assert slower.gyro.system.dt == slower.controller.settings[0] == 0.004
    assert np.abs(slower.linearize("IN2").system.poles()).max() < 1.0 + 1e-9  # neutral heading


def test_a_law_in_a_model_of_mujoco_s_own_needs_a_vehicle(jr700):
    with pytest.raises(InputError, match=r"give law\.on\(vehicle\)"):
        hs.set_controller(jr700.model, HOLDS)
