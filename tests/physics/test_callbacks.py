"""The callbacks inside MuJoCo: harmless to others, the same for any number of threads."""

import os
import shutil
import subprocess
import sys
import threading
from contextlib import nullcontext
from itertools import product
from pathlib import Path

import mujoco
import numpy as np
import pytest

import interpreted
from helisim.base.errors import CallbackError
from helisim.physics import memory, native
from helisim.physics.layout import MAGIC
from helisim.physics.native import installed

HOOKS = ("passive", "control", "act_dyn", "sensor")

PENDULUM = """
<mujoco><option integrator="{integrator}"/>{size}<worldbody>
  <body><joint name="a" axis="0 1 0" damping="0.1"/><geom size="0.05" pos="0 0 -0.5"/>
    <body pos="0 0 -0.5"><joint name="b" axis="1 1 0"/><geom size="0.04" pos="0 0 -0.4"/></body>
  </body>
</worldbody>{actuator}{sensor}</mujoco>
"""


def actuators(numbers):
    """Return nine user actuators, as a vehicle has, with their first user numbers."""
    one = '<general joint="a" dyntype="user" actdim="2" user="{0[0]:.1f} {0[1]} 1 1"/>'
    return f"<actuator>{''.join(one.format(numbers(k)) for k in range(9))}</actuator>"


BARE = {"integrator": "RK4", "size": "", "actuator": "", "sensor": ""}
OTHERS = {
    "plain": {},
    "filter": {
        "actuator": '<actuator><general joint="a" dyntype="filter" dynprm="0.1"/></actuator>'
    },
    "user dynamics": {
        "actuator": '<actuator><general joint="a" dyntype="user" actdim="1"/>'
        '<general joint="b" dyntype="user" actdim="3"/></actuator>'
    },
    "as many user numbers as ours": {
        "size": '<size nuser_actuator="240"/>',
        "actuator": '<actuator><general joint="a" dyntype="user" actdim="2"/></actuator>',
    },
    "user numbers near ours": {
        "size": '<size nuser_actuator="240"/>',
        "actuator": f'<actuator><general joint="a" dyntype="user" actdim="2" '
        f'user="{MAGIC + 1.0:.1f} 8 1 1 1"/></actuator>',
    },
    "as many actuators as ours, numbers near ours": {
        "size": '<size nuser_actuator="240"/>',
        "actuator": actuators(lambda k: (MAGIC - 1.0, k)),
    },
    "our actuators in another order": {
        "size": '<size nuser_actuator="240"/>',
        "actuator": actuators(lambda k: (MAGIC, (k + 8) % 9 if k < 8 else k)),
    },
    "user sensor": {
        "size": '<size nuser_actuator="240"/>',
        "actuator": '<actuator><motor joint="a" user="1 2 3"/></actuator>',
        "sensor": '<sensor><user dim="4" objtype="body" objname="world" needstage="acc"/></sensor>',
    },
}
SMALL = ("qpos", "qvel", "act", "qacc", "sensordata", "qfrc_passive", "ctrl")


def history(model, steps=200):
    """Return every number of a short, driven motion."""
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    data.act[:] = 0.3
    rows = []
    for k in range(steps):
        if model.nu:
            data.ctrl[:] = np.sin(0.1 * k)
        mujoco.mj_step(model, data)
        rows.append(np.concatenate([np.array(getattr(data, name)).ravel() for name in SMALL]))
    return np.array(rows)


@pytest.mark.parametrize(("kind", "integrator"), [*product(OTHERS, ["RK4"]), ("plain", "Euler")])
def test_other_models_are_left_alone(kind, integrator):
    """A model that is not ours moves bit for bit as in stock MuJoCo, and nothing is said of it."""
    blank = {"size": "", "actuator": "", "sensor": ""}
    text = PENDULUM.format(integrator=integrator, **{**blank, **OTHERS[kind]})
    model = mujoco.MjModel.from_xml_string(text)
    stock = history(model)
    ours_in_disorder = kind == "our actuators in another order"
    said = pytest.raises(CallbackError, match="don't stand one after the other")
    with said if ours_in_disorder else nullcontext(), installed():
        ours = history(model)
    assert np.array_equal(stock, ours)


def test_nothing_is_left_behind():
    """All four hooks are set in the block and free after it, also after an exception."""
    with installed():
        assert all(getattr(mujoco, f"get_mjcb_{hook}")() is not None for hook in HOOKS)
    assert all(getattr(mujoco, f"get_mjcb_{hook}")() is None for hook in HOOKS)
    with pytest.raises(RuntimeError, match="in the block"), installed():
        raise RuntimeError("in the block")
    assert all(getattr(mujoco, f"get_mjcb_{hook}")() is None for hook in HOOKS)


def test_the_timer_stands_still():
    """MuJoCo reads no clock in the block, which is a third of a step's cost, but after it."""
    model = mujoco.MjModel.from_xml_string(PENDULUM.format(**BARE))
    data = mujoco.MjData(model)
    with installed():
        mujoco.mj_step(model, data, 100)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].number == 100
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration == 0.0
    mujoco.mj_step(model, data, 100)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration > 0.0


def test_blocks_overlap_between_threads():
    """The last of two threads to leave removes the callbacks, in whatever order they came."""
    inside, leave = threading.Event(), threading.Event()

    def hold():
        with installed():
            inside.set()
            leave.wait(10.0)

    thread = threading.Thread(target=hold)
    with installed():
        thread.start()
        assert inside.wait(10.0)
    assert mujoco.get_mjcb_control() is not None
    leave.set()
    thread.join()
    assert mujoco.get_mjcb_control() is None


@pytest.mark.parametrize("hook", ["passive", "sensor"])
def test_foreign_callback_is_refused_by_name(hook):
    """Someone else's callback is neither replaced nor removed, and the message names it."""

    def theirs(*_):
        return 0.0

    getattr(mujoco, f"set_mjcb_{hook}")(theirs)
    try:
        with pytest.raises(CallbackError, match=f"mjcb_{hook}"), installed():
            pass
        assert getattr(mujoco, f"get_mjcb_{hook}")() is theirs
        others = [name for name in HOOKS if name != hook]
        assert all(getattr(mujoco, f"get_mjcb_{name}")() is None for name in others)
    finally:
        getattr(mujoco, f"set_mjcb_{hook}")(None)
    with installed():  # and it works again afterwards
        pass


@pytest.mark.parametrize("name", ["nactuator", "timestep", "wind", "actuator_user", "sensordata"])
def test_wrong_offset_is_noticed(name):
    """A field that is four bytes from where it should be never reaches the force laws."""
    found = memory.offsets()
    with pytest.raises(CallbackError, match=name):
        memory._verify(found._replace(**{name: getattr(found, name) + 4}))


def test_missing_field_is_one_clear_line(monkeypatch):
    """A MuJoCo without a field that we need is refused by its version."""
    monkeypatch.setattr(memory, "_ctype", lambda node: type(node.name, (), {"opt": None}))
    with pytest.raises(CallbackError, match=mujoco.__version__):
        memory.offsets.__wrapped__()


FRESH = """
import mujoco, helisim, sys
from helisim.physics.native import installed
with installed():
    assert mujoco.get_mjcb_passive() is not None
print(helisim.__file__)
"""


@pytest.mark.slow
@pytest.mark.skipif(interpreted.wanted(), reason="a process of its own, which compiles")
def test_works_without_a_writable_cache(tmp_path):
    """Where numba can write its cache nowhere, the callbacks are compiled in memory.

    Permissions do not stop root, so every folder that numba would make is a file instead.
    """
    source = Path(native.__file__).resolve().parents[1]
    package = tmp_path / "helisim"
    package.mkdir()
    for name in ("base", "physics"):
        shutil.copytree(source / name, package / name, ignore=shutil.ignore_patterns("*pyc*"))
    (package / "__init__.py").write_text("")
    (package / "physics" / "__pycache__").write_text("not a folder")
    (tmp_path / "home").write_text("not a folder")
    blocked = str(tmp_path / "home" / "cache")
    environment = dict(os.environ)
    environment |= {"PYTHONPATH": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"HOME": blocked, "XDG_CACHE_HOME": blocked, "NUMBA_CACHE_DIR": blocked}
    done = subprocess.run(
        [sys.executable, "-c", FRESH],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert str(tmp_path) in done.stdout
    assert not list(tmp_path.rglob("*.nb[ci]"))


def test_a_replacement_inside_the_block_stays():
    """Whoever replaced our callback within the block finds theirs in place after it."""
    with installed():
        mujoco.set_mjcb_control(_nothing)
    try:
        assert mujoco.get_mjcb_control() is _nothing
    finally:
        mujoco.set_mjcb_control(None)


def _nothing(model, data):
    """Stand for somebody else's callback."""
