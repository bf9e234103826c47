"""Beside others: their models, threads, processes and notebooks, whatever happens in a block."""

import gc
import hashlib
import os
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import mujoco
import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import ModelError
from helisim.physics.layout import PARAM
from helisim.vehicle.addresses import addresses
from helisim.vehicle.parameters import model_folder
from helisim.vehicle.trim import place
from own_laws import attitude_controllers
from tabled import section

HOP = hs.Doublet(axis="lat", duration=8.0)
HOOKS = ("passive", "control", "act_dyn", "sensor", "time")

HUMANOID = Path(__file__).with_name("humanoid.xml").read_text(encoding="utf-8")
"""Somebody else's model: contacts, a motor and sensors."""


def callbacks():
    return [getattr(mujoco, f"get_mjcb_{hook}")() for hook in HOOKS]


def walk(steps=300):
    model = mujoco.MjModel.from_xml_string(HUMANOID)
    data = mujoco.MjData(model)
    rows = []
    for k in range(steps):
        data.ctrl[0] = np.sin(0.05 * k)
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([data.qpos, data.qvel, data.sensordata]))
    return np.array(rows)


def fingerprint(record):
    return hashlib.sha256(record.values.tobytes()).hexdigest()


@pytest.fixture(scope="module")
def expected(jr700):
    return [fingerprint(hs.fly(jr700, HOP, seed=seed, jobs=1)[0]) for seed in range(2)]


def test_another_model_steps_in_a_thread_while_helicopters_fly(jr700, expected):
    stock = walk()
    found, stop = [], threading.Event()

    def others():
        while not stop.is_set():
            found.append(walk())

    thread = threading.Thread(target=others)
    thread.start()
    prints = [fingerprint(hs.fly(jr700, HOP, seed=seed, jobs=2)[0]) for seed in range(2)]
    stop.set()
    thread.join()
    assert prints == expected
    assert len(found) > 2
    assert all(np.array_equal(one, stock) for one in found)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_forked_child_flies_on_within_the_block(jr700, expected):
    reader, writer = os.pipe()
    with hs.installed():
        child = os.fork()
        if child == 0:
            try:
                outcome = fingerprint(hs.fly(jr700, HOP, seed=0, jobs=2)[0])
            except BaseException as error:
                outcome = repr(error)
            os.write(writer, outcome.encode())
            os._exit(0)
        os.close(writer)
        with os.fdopen(reader) as pipe:
            assert pipe.read() == expected[0]
        assert os.waitpid(child, 0)[1] == 0
        assert mujoco.get_mjcb_passive() is not None
        assert fingerprint(hs.fly(jr700, HOP, seed=1, jobs=1)[0]) == expected[1]
    assert callbacks() == [None] * len(HOOKS)


def test_a_cell_that_is_run_again(jr700, expected):
    before = walk()
    for _ in range(3):
        block = hs.installed()  # the one before is dropped, still inside
        block.__enter__()
        vehicle = hs.load("jr700")
        assert fingerprint(hs.fly(vehicle, HOP, jobs=1)[0]) == expected[0]
    assert np.array_equal(walk(), before)
    block.__exit__(None, None, None)
    del block
    gc.collect()
    assert callbacks() == [None] * len(HOOKS)


LEFT = section(globals(), "LEFT")


@pytest.mark.slow
@pytest.mark.parametrize(("how", "status"), [("quietly", 0), ("error", 1), ("thread", 0)])
def test_the_interpreter_ends_in_an_open_block(how, status):
    """Also while a thread still steps: no crash, and no word that isn't the program's own.

    A daemon thread that steps on then crashes MuJoCo 4.0.0 without helisim, too.
    """
    done = subprocess.run(
        [sys.executable, "-c", LEFT, how], capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stdout) == (status, "leaves\n"), done.stderr
    own = "RuntimeError: in the open block" if how == "error" else ""
    assert done.stderr.strip().endswith(own)
    assert bool(done.stderr) == bool(own)


@pytest.mark.slow
def test_nothing_is_kept_of_what_was_loaded(jr700):

    def resident():
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    vehicle = weakref.ref(hs.load())
    record = weakref.ref(hs.fly(jr700, HOP, jobs=1)[0])
    gc.collect()
    assert (vehicle(), record()) == (None, None)
    if not Path("/proc/self/statm").exists():
        return
    for _ in range(20):
        hs.load()
    grown = []
    for before in (resident() for _ in range(3)):  # what stays grows each time, an allocator once
        for _ in range(100):
            hs.load()
            with hs.installed():
                pass
        gc.collect()
        grown.append(resident() - before)
    # a model that stays would be 26 kB each time; the allocator's own rounding is 0.2 MB once
    assert min(grown) < 0.5 * 100 * mujoco.mj_sizeModel(jr700.model)


def scene(*names, size=320):
    world = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.002" integrator="RK4" density="0" viscosity="0"
        gravity="0 0 -9.8015"/><size nuser_actuator="{size}"/></mujoco>"""
    )
    for k, name in enumerate(names):
        spec = mujoco.MjSpec.from_file(str(model_folder(name) / f"{name}.xml"))
        world.attach(spec, prefix=f"{k}/", frame=world.worldbody.add_frame())
    return world


@pytest.mark.slow
def test_helicopters_in_one_scene_fly_as_if_alone(jr700):
    """Two kinds, in one place so that no rounding differs, each with a controller of its own.

    By prefix: in Python, compiled, none, so that the servos' `ctrl` counts, and the shipped one.
    """
    names, controllers = ("jr700", "jr700", "jr700", "blade360"), attitude_controllers(jr700)
    with pytest.warns(UserWarning, match="gravity"):
        model = scene(*names).compile()
    data, ends = mujoco.MjData(model), []
    for k, name in enumerate(names):
        alone = mujoco.MjModel.from_xml_path(str(model_folder(name) / f"{name}.xml"))
        alone.opt.gravity = model.opt.gravity  # the Blade's own has another g
        if k < 3:
            for one, prefix in ((alone, ""), (model, f"{k}/")):
                hs.set_controller(one, (*controllers, None)[k], prefix=prefix)
        own, where, end = addresses(alone), addresses(model, f"{k}/"), mujoco.MjData(alone)
        place(alone, end, hs.load(name).trim)
        end.ctrl[own.control + 1 : own.control + 4] = [0.05, -0.03, 0.02]
        data.qpos[7 * k : 7 * k + 7] = end.qpos
        data.act[where.state : where.state + alone.na] = end.act
        data.ctrl[where.control : where.control + 9] = end.ctrl
        with hs.installed():
            mujoco.mj_step(alone, end, 300)
        ends.append(end)
    with hs.installed():
        mujoco.mj_step(model, data, 300)
    for k, end in enumerate(ends):
        first = addresses(model, f"{k}/").state
        assert np.array_equal(data.qpos[7 * k : 7 * k + 7], end.qpos)
        assert np.array_equal(data.qvel[6 * k : 6 * k + 6], end.qvel)
        assert np.array_equal(data.act[first : first + end.act.size], end.act)
    assert len({end.qpos.tobytes() for end in ends}) == 3  # python and njit are the same


def test_a_scene_that_has_no_room_for_a_vehicles_numbers_is_refused():
    with pytest.raises(ValueError, match="more values than nuser_actuator"):
        scene("jr700", size=len(PARAM) - 10).compile()
    world = scene("jr700", size=-1)
    for actuator in world.actuators:
        actuator.userdata = []
    model = world.compile()
    with pytest.raises(ModelError, match=r"room for 0 numbers .* nuser_actuator .* vehicle build"):
        addresses(model, "0/")
