"""The shipped models fly from stock MuJoCo: its own loader, keyframe and mj_step in a block."""

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.vehicle.build import unwritten
from helisim.vehicle.folder import model_folder, vehicle_names

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


def test_three_attached_hover_and_answer_their_own_sticks():
    """Three JR700 in one scene; the middle one's collective lifts the middle one alone."""
    model, data = attached(*["jr700"] * 3)
    assert hs.check_model(model) == ("0/jr700", "1/jr700", "2/jr700")
    assert farthest(model, data) < HOVER
    data.ctrl[model.actuator("1/COL").id] = 0.1
    data.time, before = 0.0, data.qpos[2::7].copy()
    farthest(model, data, 1.0)
    rise = data.qpos[2::7] - before
    assert rise[1] > 0.5  # 13 m/s^2 a unit of collective, damped within a second
    assert np.abs(rise[[0, 2]]).max() < HOVER


@pytest.mark.filterwarnings("ignore:Attach conflict")
def test_two_kinds_attached_hover():
    """Each trim is for its own model's gravity, which differ by 5 mm/s^2; the scene has one."""
    model, data = attached("jr700", "blade360")
    assert farthest(model, data) < 0.1


@pytest.mark.parametrize("name", vehicle_names())
def test_dropped_with_the_rotor_stopped_it_lands_on_its_skids(name):
    """Ground contact is on in the scene: let go half a metre up, it comes to rest upright."""
    model = shipped(name)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("hover").id)
    data.qpos[:7] = [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0]
    data.ctrl[model.actuator("rotor").id] = 0.0
    farthest(model, data, 4.0)
    lowest = model.geom("skid_left_collision")
    skids = data.geom("skid_left_collision").xpos[2] - lowest.size[0]
    assert abs(skids) < 5e-3  # soft contact gives way by some mm
    assert data.body(name).xmat[8] == pytest.approx(1.0, abs=1e-3)
    assert np.abs(data.qvel).max() < 1e-2
    assert not any(warning.number for warning in data.warning)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_it_rides_on_a_deck_that_a_mocap_body_moves(integrator):
    """A heavy body welded to a mocap body carries it along, up and aside; Newton's force does."""
    spec = mujoco.MjSpec.from_file(str(model_folder("jr700") / "jr700.xml"))
    spec.option.integrator = INTEGRATORS[integrator]
    spec.worldbody.add_body(name="told", mocap=True)
    deck = spec.worldbody.add_body(name="deck", gravcomp=1.0)
    deck.mass, deck.inertia, deck.explicitinertial = 1e7, [1e7] * 3, True
    deck.add_freejoint()
    deck.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[3, 3, 0.25], pos=[0, 0, -0.25])
    weld = spec.add_equality(type=mujoco.mjtEq.mjEQ_WELD, name1="told", name2="deck")
    weld.objtype, weld.solref = mujoco.mjtObj.mjOBJ_BODY, [0.05, 1.0]
    for key in list(spec.keys):
        spec.delete(key)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = 0.2
    rows = []
    with hs.installed():
        while data.time < 20.0:
            data.mocap_pos[0] = [0.2 * np.sin(data.time), 0.0, 0.3 * np.sin(data.time)]
            mujoco.mj_step(model, data)
            apart = data.body("jr700").xpos - data.body("deck").xpos
            rows.append([data.time, *apart, *data.sensor("contact").data])
    time, *apart, north, _, down = np.array(rows)[2500:].T
    assert np.ptp(apart, axis=1).max() < 1e-3
    mass, late = 8.01, time - 0.1  # the weld is late by twice its time constant
    # MuJoCo's weld to a mocap body, whose place jumps at each step, shakes the deck under RK4
    assert np.mean(np.abs(-down - mass * (9.8015 - 0.3 * np.sin(late)))) < 0.02 * mass * 9.8
    pull = np.polyfit(-np.sin(late), north, 1)[0]
    assert pull == pytest.approx(0.2 * mass, rel=0.05)
