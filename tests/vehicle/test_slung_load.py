"""A load on a cable: trim, linearisation, flight and recording, and force laws that ignore it."""

import pickle

import mujoco
import numpy as np
import pytest
from rerun.chunk import RrdReader

import helisim as hs
import script
from helisim.base.errors import InputError, ModelError, TrimError
from helisim.records.record import LOAD
from helisim.show.recording import write_recording
from helisim.vehicle.trim import place

proof = script.loaded("proof/slung_load")
RIGID = proof.LOAD.format(mass=1.0, length=3.0, arm=0.15)
ELASTIC = """<mujoco> <worldbody> <site name="hook" pos="0 0 -0.15"/>
  <body name="load" pos="0 0 -3.15"> <geom size="0.08" mass="1"/> <site name="top"/>
  <joint type="slide" axis="1 0 0"/> <joint type="slide" axis="0 1 0"/> <joint type="slide"/>
  </body> </worldbody> <tendon> <spatial springlength="0 3" stiffness="5000"> <site site="hook"/>
  <site site="top"/> </spatial> </tendon> </mujoco>"""


loaded = pytest.fixture(lambda: hs.load(slung=RIGID), scope="module")


def test_the_force_laws_know_the_vehicles_mass_alone(jr700):
    """Numbers, loads and aerodynamic wrench of a motion are the bare vehicle's."""
    slung, laws, wrenches = hs.load(slung=RIGID.replace('mass="1.0"', 'mass="4.0"')), [], []
    assert dict(slung.parameters) == dict(jr700.parameters)
    np.testing.assert_array_equal(slung.model.actuator_user, jr700.model.actuator_user)
    assert slung.model.body_mass[1] == jr700.model.body_mass[1]
    assert slung.imu_offset == pytest.approx(jr700.imu_offset, abs=1e-14)  # sums of parts round
    for model in (slung.model, jr700.model):
        data = mujoco.MjData(model)
        place(model, data, jr700.trim)
        data.qvel[:6] = 0.3, -0.2, 0.1, 0.4, -0.3, 0.2
        with hs.installed():
            mujoco.mj_forward(model, data)
        laws.append(np.r_[data.sensor("rotor").data, data.sensor("power").data])
        wrenches.append(data.qfrc_passive[:6])
    # MuJoCo counts velocities and moments about the whole's centre of mass: rounding of 3 m
    np.testing.assert_allclose(*laws, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(*wrenches, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize(("cable", "stretch"), [(RIGID, 0.0), (ELASTIC, 9.8015 / 5000.0)])
def test_the_trim_carries_both_weights_and_the_load_hangs_still_below(cable, stretch):
    """Newton: the air's force upwards is the weight of 8.01 kg and 1 kg; the cable is plumb."""
    slung = hs.load(slung=cable)
    data = slung.hovering()
    with hs.installed():
        mujoco.mj_forward(slung.model, data)
        hook, load = data.site("slung/hook").xpos.copy(), data.body("slung/load").xipos.copy()
        assert np.abs(data.qacc).max() < 1e-9  # the trim's own residual
        assert data.qfrc_passive[2] == pytest.approx(9.01 * 9.8015, rel=1e-9)
        mujoco.mj_step(slung.model, data, 500)
    np.testing.assert_allclose(load - hook, [0.0, 0.0, -3.0 - stretch], atol=1e-9)
    np.testing.assert_allclose(data.body("slung/load").xipos, load, atol=1e-6)  # after a second


@pytest.mark.parametrize("arm", [0.0, 0.15, 0.3])
def test_the_linearisations_pendulum_is_the_closed_form(jr700, arm):
    """Without the hub's cross stiffness and the bank of 0.064 rad: 1.5e-4 of the frequency."""
    found = proof.exact(hs.load(slung=proof.LOAD.format(mass=1.0, length=3.0, arm=arm)))
    assert found == pytest.approx(2 * [proof.closed_form(jr700, 1.0, 3.0, arm)], rel=5e-4)


def test_a_records_pendulum_is_within_a_percent_of_the_closed_form(jr700):
    loaded, wanted = hs.load(slung=RIGID, integrator="Euler"), proof.closed_form(jr700, 1, 3, 0.15)
    for axis in proof.AXES:  # a percent is wanted; measured 0.12 and 0.10 %
        assert proof.identified(loaded, axis).frequency == pytest.approx(wanted, rel=0.01)


def test_a_record_says_what_hung_there_and_rerun_draws_it_there(loaded, tmp_path):
    (record,) = hs.fly(loaded, hs.Pulse(axis="lat", amplitude=0.05, duration=4.0), seed=1)
    assert hs.load(slung=record.provenance["slung"]) == loaded == pickle.loads(pickle.dumps(loaded))
    assert np.ptp(record["load_y"]) > 0.1
    path = write_recording(tmp_path / "lat.rrd", {"lat": record}, model=loaded.visual_model())
    chunks = [one.to_record_batch() for one in RrdReader(path).stream() if "/load" in str(one)]
    (drawn,) = [one for one in chunks if "Transform3D:translation" in one.schema.names]
    place = np.array(drawn.column("Transform3D:translation").to_pylist())[:, 0]
    wanted = record.select(LOAD)[::2] + np.array([0.0, 0.0, 0.15])  # the hook
    np.testing.assert_allclose(place, wanted, atol=1e-6)  # single precision


def test_a_load_that_cannot_hang_is_refused(loaded):
    for old, new, error, says in (
        ("hook", "hock", ModelError, "needs a site 'hook'"),
        ("<worldbody>", "<worldbody", ModelError, "the slung load's MJCF"),
        ('"ball" damping="0.6"', '"slide"', TrimError, "no place where it hangs still"),
    ):
        with pytest.raises(error, match=says):
            hs.load(slung=RIGID.replace(old, new))
    plan = hs.FlightPlan(excitation=hs.Pulse(axis="lat"), ground=hs.Ground(parked=True))
    with pytest.raises(InputError, match="starts in the air"):
        hs.fly(loaded, plan)
