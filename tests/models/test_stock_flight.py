"""The shipped models fly from stock MuJoCo: its own loader, keyframe and mj_step in a block."""

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.vehicle.build import unwritten
from helisim.vehicle.parameters import model_folder, vehicle_names

INTEGRATORS = {"RK4": mujoco.mjtIntegrator.mjINT_RK4, "Euler": mujoco.mjtIntegrator.mjINT_EULER}
HOVER = 1e-7
"""m in 10 s: the keyframe's ten digits are 1e-10 rad, times half of g and 100 s^2."""


def shipped(name, file="scene"):
    path = model_folder(name) / f"{name if file == 'alone' else file}.xml"
    return mujoco.MjModel.from_xml_path(str(path))


def farthest(model, data, seconds=10.0):
    """Step, and return how far anything that is free got from where it was, m."""
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    rows = (model.jnt_qposadr[free][:, None] + np.arange(3)).ravel()
    start, far = data.qpos[rows].copy(), 0.0
    with hs.installed():
        while data.time < seconds:
            mujoco.mj_step(model, data)
            far = max(far, np.abs(data.qpos[rows] - start).max())
    return far


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("file", ["scene", "alone"])
@pytest.mark.parametrize("name", vehicle_names())
def test_hover_from_the_keyframe(name, file, integrator):
    """Ten seconds with the gyro on and nobody at the sticks: it stays where it is."""
    model = shipped(name, file)
    model.opt.integrator = INTEGRATORS[integrator]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    assert farthest(model, data) < HOVER


@pytest.mark.parametrize("name", vehicle_names())
def test_the_numbers_are_what_the_parameters_give(name):
    """`helisim vehicle build` would change nothing; after a change of parameters, run it."""
    assert [change.element.place for change in unwritten(name)] == []


def attached(*vehicles, gravity=None):
    """Return a world with vehicles side by side, 5 m apart, and data with all of them hovering."""
    world = mujoco.MjSpec()
    for k, name in enumerate(vehicles):
        child = mujoco.MjSpec.from_file(str(model_folder(name) / f"{name}.xml"))
        world.option.integrator, world.option.timestep = (
            child.option.integrator,
            child.option.timestep,
        )
        world.option.cone, world.option.impratio = child.option.cone, child.option.impratio
        world.option.gravity = child.option.gravity if gravity is None else gravity
        world.attach(child, prefix=f"{k}/", frame=world.worldbody.add_frame())
    model = world.compile()
    data = mujoco.MjData(model)
    for k in range(len(vehicles)):  # each keyframe leaves the other vehicles where they start
        key = model.key(f"{k}/hover")
        data.qpos += key.qpos - model.qpos0
        data.act += key.act
        data.ctrl += key.ctrl
        data.qpos[7 * k + 1] += 5.0 * k
    return model, data


@pytest.mark.parametrize("name", vehicle_names())
def test_one_attached_hovers(name, recwarn):
    """`MjSpec.attach` brings numbers, delays, sensors and keyframe along, under a prefix."""
    model, data = attached(name)
    assert hs.check_model(model) == (f"0/{name}",)
    assert farthest(model, data) < HOVER
    # the options are the world's own, which attach says; it doesn't mind the number of numbers
    assert not [one for one in recwarn if "nuser_actuator" in str(one.message)]
