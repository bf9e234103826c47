"""The compiled force laws as plain Python: what coverage and mutation testing can follow.

With NUMBA_DISABLE_JIT=1 the laws themselves stay Python functions, but numba still compiles what
MuJoCo calls and what follows pointers. `install` replaces those two by ctypes, so that MuJoCo
runs the very same sources, some thousand times slower. Which lines the tests run::

    pip install -e '.[test,proof]'
    coverage run -m pytest
    NUMBA_DISABLE_JIT=1 coverage run -m pytest -W ignore -m "not slow and not study" \
        tests/physics tests/vehicle/test_trim.py tests/vehicle/test_hover.py
    coverage combine
    coverage report --fail-under=95
"""

import ctypes
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numba
from numba import types

from helisim.physics import laws, memory, native, notes

_C = {
    types.void: None,
    types.int32: ctypes.c_int32,
    types.int64: ctypes.c_int64,
    types.float64: ctypes.c_double,
}

raised: list[BaseException] = []
"""What the force laws raised: a fault of theirs, as compiled code can't."""


def wanted() -> bool:
    """Tell whether this process is to interpret the force laws."""
    return bool(numba.config.DISABLE_JIT)


def install() -> None:
    """Replace the intrinsics in every module of the physics, and how callbacks are made."""
    instead = {
        id(memory.doubles_at): _pointer(ctypes.c_double),
        id(memory._ints_at): _pointer(ctypes.c_int32),
        id(memory.longs_at): _pointer(ctypes.c_int64),
        id(memory.bytes_at): _pointer(ctypes.c_uint8),
        id(notes._address): lambda: ctypes.addressof(notes._memory),
        id(notes._claimed): _claimed,
        id(laws._address): lambda: laws._table.ctypes.data,
        id(laws._call): _call,
        id(memory.fence): lambda: None,
        id(memory.buffer): lambda count: (ctypes.c_double * count)(),
        id(memory.from_element): _from_element,
    }
    physics = [one for name, one in sys.modules.items() if name.startswith("helisim.physics.")]
    for module in physics:
        for name, held in list(vars(module).items()):
            if id(held) in instead:
                setattr(module, name, instead[id(held)])
    native.cfunc = _cfunc


def _pointer(element: Any) -> Callable[[int], Any]:
    kind = ctypes.POINTER(element)
    return lambda address: ctypes.cast(int(address), kind)


def _claimed(state: Any) -> bool:
    free = state[0] == 0
    state[0] = 1 if free else state[0]
    return free


def _call(function: int, *arguments: Any) -> None:
    numbers = ctypes.POINTER(ctypes.c_double)
    ctypes.CFUNCTYPE(None, *[numbers] * len(arguments))(function)(
        *(ctypes.cast(one, numbers) for one in arguments)
    )


def _from_element(array: Any, first: int) -> Any:
    return _pointer(ctypes.c_double)(ctypes.addressof(array.contents) + 8 * first)


def _cfunc(signature: Any, **_: Any) -> Callable[[Callable], SimpleNamespace]:
    prototype = ctypes.CFUNCTYPE(_C[signature.return_type], *(_C[one] for one in signature.args))

    def decorate(function: Callable) -> SimpleNamespace:
        def guarded(*arguments: Any) -> Any:
            try:
                return function(*arguments)
            except BaseException as error:  # ctypes would print it and go on
                raised.append(error)
                return 0

        pointer = prototype(guarded)
        return SimpleNamespace(ctypes=pointer, address=ctypes.cast(pointer, ctypes.c_void_p).value)

    return decorate
