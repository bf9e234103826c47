"""Compile the callbacks and lend them to MuJoCo for the length of a `with` block."""

import ctypes
import hashlib
import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any

import mujoco
import numba
import numpy as np
from numba import cfunc, types

from helisim.errors import CallbackError
from helisim.physics import callbacks
from helisim.physics.fields import Offsets, offsets

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

    Raises:
        CallbackError: someone else's callback is installed, or this MuJoCo's memory layout
            is not what it says.
    """
    with _loan.lock:
        if _loan.blocks == 0:
            _install(compiled())
        _loan.blocks += 1
    try:
        yield
    finally:
        with _loan.lock:
            _loan.blocks -= 1
            if _loan.blocks == 0:
                _remove(_loan.functions)


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
