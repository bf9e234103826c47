"""Control laws that numba compiles: which function is one, and the callbacks' form of it."""

import inspect
import threading
import weakref
from typing import Any, Literal

import numba
import numpy as np
from numba import carray, types
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from helisim.base.errors import InputError
from helisim.physics.gyro import Seen

Place = Literal["all", "swash", "tail"]
PLACES: dict[Place, tuple[str, ...]] = {
    "all": ("front", "left", "right", "tail"),
    "swash": ("front", "left", "right"),
    "tail": ("tail",),
}
"""What a law in each place commands, in the order in which it returns it."""

_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER, _POINTER)
_compiled: "weakref.WeakKeyDictionary[Any, dict[Any, Any]]" = weakref.WeakKeyDictionary()
_compiling = threading.Lock()


def is_native(function: Any) -> bool:
    """Return whether a function is a numba.cfunc."""
    return isinstance(function, CFunc)


def is_compiled(function: Any) -> bool:
    """Return whether a function is compiled by numba.njit."""
    return isinstance(function, Dispatcher)


def arity(function: Any) -> int:
    """Return how many of what is seen, the state and the settings a function takes, 0 to 3.

    Raises:
        InputError: it takes other arguments, or doesn't say which.
    """
    described = function.py_func if is_compiled(function) else function
    name = getattr(described, "__name__", type(described).__name__)
    try:
        signature = inspect.signature(described)
    except (TypeError, ValueError):
        raise InputError(
            f"controller {name!r} doesn't say which arguments it takes; write a function of "
            "(seen), (seen, state) or (seen, state, settings)"
        ) from None
    for count in (3, 2, 1, 0):
        try:
            signature.bind(*range(count))
        except TypeError:
            continue
        return count
    raise InputError(
        f"controller {name!r} takes {signature}; it must take (seen), (seen, state) or "
        "(seen, state, settings)"
    )


def compiled(
    function: Any, reset: Any, place: Place, states: int, settings: int, *, name: str
) -> Any:
    """Return a law of numba.njit as a native function, compiled once for its kind.

    An index beyond its state or settings raises there, as in Python, unless the law says
    `boundscheck=False`: behind them is memory of the simulation.

    Args:
        function: of the law.
        reset: called where it starts, compiled or not; None for nothing.
        place: which servos it moves.
        states: how many numbers it keeps.
        settings: how many it has.
        name: for messages.

    Raises:
        InputError: numba can't compile it; the message has numba's reason.
    """
    key = (place, states, settings, reset)
    with _compiling:
        known = _compiled.setdefault(function, {})
        if key not in known:
            try:
                known[key] = _compile(function, *key)
            except NumbaError as error:
                raise InputError(
                    f"numba can't compile controller {name!r} to a law that returns numbers "
                    f"for {', '.join(PLACES[place])}: {_reason(error)}"
                ) from error
        return known[key]


def _reason(error: NumbaError) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During:", "File "))]
    return (telling or lines)[0].removeprefix("('").removesuffix("')").replace("', '", "")


def _guarded(function: Any) -> Any:
    """Return a compiled function that looks at its indices, where nothing is said of that."""
    options = dict(function.targetoptions)
    if options.get("boundscheck") is not None:
        return function
    return numba.jit(**{**options, "boundscheck": True})(function.py_func)


def _compile(function: Any, place: Place, states: int, numbers: int, reset: Any) -> Any:
    count = max(1, numbers)
    call, begin = _with_three(_guarded(function)), _nothing
    if reset is not None:
        begin = _with_three(_guarded(reset if is_compiled(reset) else numba.njit(reset)))
    store = {"all": _store_all, "swash": _store_swash, "tail": _store_tail}[place]
    at_tail = place == "tail"

    @numba.cfunc(_SIGNATURE)
    def native(seen_at, state_at, settings_at, commands):
        seen = Seen(
            seen_at[0],
            seen_at[1],
            seen_at[2],
            seen_at[3],
            seen_at[4],
            seen_at[5],
            seen_at[6],
            seen_at[7],
            seen_at[8],
            seen_at[9],
            seen_at[10],
            seen_at[11],
            seen_at[12],
            seen_at[13],
            seen_at[14],
            seen_at[15],
            seen_at[16],
            seen_at[17],
        )
        state = carray(state_at, (states,))
        settings = carray(settings_at, (count,))[:numbers]
        try:
            if seen_at[18] != 0.0:
                begin(seen, state, settings)
            store(commands, call(seen, state, settings))
        except Exception:  # a command that isn't one ends the law
            commands[3 if at_tail else 0] = np.nan

    return native


def _with_three(function: Any) -> Any:
    """Return a compiled function of seen, state and settings that hands on what is wanted."""
    takes = arity(function)

    @numba.njit
    def three(seen, state, settings):
        return function(seen, state, settings)

    @numba.njit
    def two(seen, state, settings):
        return function(seen, state)

    @numba.njit
    def one(seen, state, settings):
        return function(seen)

    @numba.njit
    def none(seen, state, settings):
        return function()

    return (none, one, two, three)[takes]


@numba.njit
def _nothing(seen, state, settings):
    pass


@numba.njit
def _store_all(commands, given):
    front, left, right, tail = given
    commands[0], commands[1], commands[2], commands[3] = front, left, right, tail


@numba.njit
def _store_swash(commands, given):
    front, left, right = given
    commands[0], commands[1], commands[2] = front, left, right


@numba.njit
def _store_tail(commands, given):
    commands[3] = given
