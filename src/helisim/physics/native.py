"""Compile the callbacks and lend them to MuJoCo for the length of a `with` block."""

import ctypes
import hashlib
import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any

import mujoco
import numba
import numpy as np
from numba import cfunc, types

from helisim.base.errors import CallbackError, InputError
from helisim.physics import callbacks, notes
from helisim.physics.examination import sentence
from helisim.physics.fields import Offsets, offsets
from helisim.physics.layout import MAGIC, ROTOR
from helisim.physics.own_laws import watched_failures
from helisim.physics.params import PARAM

_HOOKS = ("passive", "control", "act_dyn", "sensor")
_PATIENCE = 2.0
"""s without a word; from the cache the code is there sooner."""
_logger = logging.getLogger(__name__)
_TIMER = "time"
"""MuJoCo's Python package reads the clock some twenty times a step, for `mjData.timer`: a third
of the cost of our step. So the timer stands still meanwhile, unless someone has set one."""


class _Loan:
    """What MuJoCo has been lent, and for how many blocks."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.blocks = 0
        self.functions: dict[str, Any] = {}
        self.own = threading.local()
        self.unsaid: list[notes.Note] = []

    @property
    def depth(self) -> int:
        """How many blocks this thread is in."""
        return getattr(self.own, "depth", 0)

    @depth.setter
    def depth(self, depth: int) -> None:
        self.own.depth = depth


_loan: _Loan = globals().get("_loan") or _Loan()
"""A module that is loaded again, as notebooks do, finds the blocks that are open."""


def fingerprint() -> int:
    """Return a number that changes with the sources of the physics and with the libraries.

    numba's cache on disk knows a function by its own file only; this number is part of
    what it is cached by, so neither an edited force law nor another MuJoCo meets stale code.
    """
    digest = hashlib.sha256(f"{mujoco.__version__} {numba.__version__}".encode())
    for source in sorted(files("helisim.physics").iterdir(), key=lambda file: file.name):
        if source.name.endswith(".py"):
            digest.update(source.read_bytes())
    return int.from_bytes(digest.digest()[:7], "little")


@cache
def compiled() -> dict[str, Any]:
    """Return the compiled callback of each hook.

    The code is cached on disk beside the package or in the user's cache folder; where
    neither can be written it is compiled anew in each process.
    """
    layout = offsets()._replace(fingerprint=fingerprint())
    message = "compiling the force laws; they are kept for the next start"
    patience = threading.Timer(_PATIENCE, _logger.info, [message])
    patience.daemon = True
    patience.start()
    try:
        return _compile(layout, cached=True)
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
        return _compile(layout, cached=False)
    finally:
        patience.cancel()


def _compile(layout: Offsets, *, cached: bool) -> dict[str, Any]:
    address = types.int64

    @cfunc(types.void(address, address), cache=cached)
    def passive(m, d):
        callbacks.passive(m, d, layout)

    @cfunc(types.void(address, address), cache=cached)
    def control(m, d):
        callbacks.control(m, d, layout)

    @cfunc(types.float64(address, address, types.int32), cache=cached)
    def act_dyn(m, d, actuator):
        # as wide as an index elsewhere, or most kernels would be compiled a second time
        return callbacks.activation_rates(m, d, layout, np.int64(actuator))

    @cfunc(types.void(address, address, types.int32), cache=cached)
    def sensor(m, d, stage):
        callbacks.sensor(m, d, layout, stage)

    @cfunc(types.float64(), cache=cached)
    def time():
        return 0.0

    return {
        "passive": passive,
        "control": control,
        "act_dyn": act_dyn,
        "sensor": sensor,
        "time": time,
    }


@contextmanager
def installed() -> Iterator[None]:
    """Lend MuJoCo the helicopter's force laws while the block runs.

    The callbacks are global to the process, so blocks may nest and overlap between threads;
    the last to leave removes them. They leave every model alone that is not ours; only
    MuJoCo's profiling timers, `mjData.timer`, stand still meanwhile. Any number of helicopters
    may share a scene, attached with prefixes. A daemon thread that steps when the interpreter
    ends crashes MuJoCo 4.0.0, with these callbacks as without: join it.

    A model with a vehicle that lacks what the force laws count on is not flown, or flies without
    its gyro; the outermost block of a thread says so when it ends. It warns of user actuators
    that are of no vehicle.

    Raises:
        CallbackError: someone else's callback is installed, or this MuJoCo's memory layout
            is not what it says; when the block ends, a model that was stepped in it lacks
            something, or a controller that was set in one failed. An exception from within the
            block comes first, with that as its note.
    """
    with _loan.lock:
        if _loan.blocks == 0:
            _install(compiled())
            notes.forget_models()
        _loan.blocks += 1
    _loan.depth += 1
    try:
        yield
    except BaseException as error:
        for one in [*map(sentence, _left()), *watched_failures()]:
            error.add_note(one)
        raise
    else:
        _say(_left())
        failures = watched_failures()
        if failures:
            error = CallbackError(failures[0])
            for one in failures[1:]:
                error.add_note(one)
            raise error


def _left() -> list[notes.Note]:
    """Leave a block; return what was noted, if it was the outermost of this thread."""
    with _loan.lock:
        _loan.blocks -= 1
        _loan.depth -= 1
        found: list[notes.Note] = []
        if _loan.depth <= 0:
            found = _loan.unsaid + notes.taken()
            _loan.unsaid = []
        if _loan.blocks == 0:
            _remove(_loan.functions)
    return found


def _say(found: list[notes.Note]) -> None:
    refused = [one for one in found if one.kind == notes.REFUSED]
    for one in found:
        if one not in refused:
            warnings.warn(sentence(one), RuntimeWarning, stacklevel=4)
    if refused:
        raise CallbackError(sentence(refused[0]))


def check_is_model(model: object) -> None:
    """Raise InputError unless it is a compiled model of MuJoCo's."""
    if not isinstance(model, mujoco.MjModel):
        raise InputError(
            f"a mujoco.MjModel is needed, such as from_xml_path(...) gives, got {model!r:.80}"
        )


def check_model(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the bodies of helisim's vehicles in a model, each with all it needs.

    What `installed` would say at the end of a block, said at once and without a step.

    Raises:
        CallbackError: a vehicle lacks something, or there is none; the message names the element
            and what to do.
        InputError: it is no mujoco.MjModel.
    """
    check_is_model(model)
    data = mujoco.MjData(model)
    with installed(), _loan.lock:
        _loan.unsaid += notes.taken()
        notes.forget_models()
        for _ in range(2):  # at the first it may still be compiling
            mujoco.mj_forward(model, data)
        found = notes.taken()
    for one in found:
        if one.kind == notes.REFUSED:
            raise CallbackError(sentence(one))
    bodies = tuple(_bodies(model))
    if not bodies:
        name = model.names.split(b"\0")[0].decode()
        raise CallbackError(
            f"model {name!r} has no helicopter of helisim: no actuator has its user numbers. Write "
            "them into a vehicle's MJCF with `helisim vehicle build FOLDER`"
        )
    return bodies


def _bodies(model: mujoco.MjModel) -> Iterator[str]:
    if model.nuser_actuator < len(PARAM):
        return
    for actuator, user in enumerate(model.actuator_user):
        if user[PARAM.magic] == MAGIC and user[PARAM.ordinal] == ROTOR:
            yield model.body(model.jnt_bodyid[model.actuator_trnid[actuator, 0]]).name


def _install(functions: dict[str, Any]) -> None:
    taken = [hook for hook in _HOOKS if getattr(mujoco, f"get_mjcb_{hook}")() is not None]
    if taken:
        names = ", ".join(f"mjcb_{hook}" for hook in taken)
        raise CallbackError(
            f"MuJoCo already has a callback of another owner: {names}. MuJoCo keeps one for "
            f"the whole process; remove it first, with mujoco.set_{names.split(', ')[0]}(None)"
        )
    _loan.functions = functions  # which must live as long as MuJoCo calls them
    unset = (_TIMER,) if mujoco.get_mjcb_time() is None else ()
    for hook in (*_HOOKS, *unset):
        getattr(mujoco, f"set_mjcb_{hook}")(functions[hook].ctypes)


def _remove(functions: dict[str, Any]) -> None:
    """Take our callbacks out again, and leave one that someone put in their place."""
    for hook in (*_HOOKS, _TIMER):
        if _address(getattr(mujoco, f"get_mjcb_{hook}")()) == functions[hook].address:
            getattr(mujoco, f"set_mjcb_{hook}")(None)


def _address(callback: Any) -> int | None:
    """Return the address of a native callback; a Python function has none."""
    try:
        return ctypes.cast(callback, ctypes.c_void_p).value
    except ctypes.ArgumentError:
        return None
