"""The compiled force laws as plain Python: what coverage and mutation testing can follow.

With NUMBA_DISABLE_JIT=1 the laws themselves stay Python functions, but numba still compiles what
MuJoCo calls and what follows pointers. `install` replaces those two by ctypes, so that MuJoCo
runs the very same sources, some thousand times slower. Which lines the tests run::

    pip install -e '.[test,proof]'
    coverage run -m pytest
    NUMBA_DISABLE_JIT=1 coverage run -m pytest -W ignore -m "not slow and not study" \
        tests/physics tests/vehicle/test_linearization.py
    coverage combine
    coverage report --fail-under=95
"""

import ctypes
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numba
import numpy as np
from numba import types

from helisim.physics import kernel, laws, memory, native

_C = {types.void: None, types.int32: ctypes.c_int32, types.int64: ctypes.c_int64}
_C[types.float64] = ctypes.c_double

raised: list[BaseException] = []
"""What the force laws raised: a fault of theirs, as compiled code can't."""


def wanted() -> bool:
    """Tell whether this process is to interpret the force laws."""
    return bool(numba.config.DISABLE_JIT)


def install() -> None:
    """Replace the intrinsics in every module of the physics, and how callbacks are made."""
    instead = {
        id(kernel.doubles_at): _pointer(ctypes.c_double),
        id(kernel.ints_at): _pointer(ctypes.c_int32),
        id(kernel.longs_at): _pointer(ctypes.c_int64),
        id(memory._met_address): lambda: ctypes.addressof(memory._met),
        id(memory._report_address): lambda: ctypes.cast(memory._reported, ctypes.c_void_p).value,
        id(laws._address): lambda: laws._table.ctypes.data,
        id(kernel.call): _call,
        id(kernel.buffer): lambda count: (ctypes.c_double * count)(),
        id(kernel.from_element): _from_element,
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


def _call(function: int, arguments: tuple[Any, ...]) -> None:
    given = [int(one) if isinstance(one, int | np.integer) else one for one in arguments]
    kinds = [ctypes.c_int64 if isinstance(one, int) else type(one) for one in given]
    ctypes.CFUNCTYPE(None, *kinds)(function)(*given)


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
