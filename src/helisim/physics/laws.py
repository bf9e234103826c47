"""Table of the process's control laws beside the shipped gyro's; callbacks call one by its handle.

void law(double *seen, double *state, double *settings, double *commands): `seen` is `Seen` and 1 at
the first tick, else 0; commands of front, left, right and tail. A value that is not finite ends it.
"""

import _thread
import copy
import ctypes
import inspect
import os
import threading
import traceback
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numba
import numpy as np
from numba import carray, cfunc, types
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError
from helisim.physics.gyro import Seen
from helisim.physics.kernel import (
    CallbackCompiler,
    address_of,
    call,
    compiled_or_cached,
    doubles_at,
    fingerprint,
    kernel,
    longs_at,
)

Place = Literal["all", "swash", "tail"]
PLACES: dict[Place, tuple[str, ...]] = {  # a law's commands, in order
    "all": ("front", "left", "right", "tail"),
    "swash": ("front", "left", "right"),
    "tail": ("tail",),
}
SEEN = len(Seen._fields)  # behind them stands whether it starts
COMMANDS = 4
_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER, _POINTER)
_PROTOTYPE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)

_ROWS = 1 << 16
_WIDTH = 8
_HANDLE, _FUNCTION, _SETTINGS, _STATES, _FAILED = range(5)  # of a row
_table = np.zeros((_ROWS, _WIDTH), dtype=np.int64)
_table[0, _HANDLE] = int.from_bytes(os.urandom(6), "little") | 1
_address = address_of("helisim_laws", _table.ctypes.data)
LOCK = threading.RLock()  # a law may be released while memory is taken for another
_free = list(range(1, _ROWS))
_numbers = count(1)


def token() -> int:
    """Return the number by which a vehicle's numbers name this process."""
    return int(_table[0, _HANDLE])


def is_registered(handle: float, of_process: float, states: float) -> bool:
    """Return whether there is a law of this handle and so many states in this process."""
    row = _table[int(handle) % _ROWS if abs(handle) < np.inf else 0]
    return of_process == token() and handle == row[_HANDLE] and states == row[_STATES]


@kernel()
def row_of(handle, token, states):
    """Return the address of a law's row; 0 for none, or one of another process, or other states."""
    table = _address()
    row = table + 8 * _WIDTH * (np.int64(handle) % _ROWS)
    known = token == longs_at(table)[_HANDLE] and row != table
    known = known and handle == longs_at(row)[_HANDLE] and states == longs_at(row)[_STATES]
    return row if known else 0


@kernel()
def ask(row, seen, state, states, commands, first, last):
    """Call a law; return whether commands, (4,), and state, (states,), written, are finite."""
    about = longs_at(row)
    for k in range(first, last + 1):
        commands[k] = np.nan
    call(about[_FUNCTION], (seen, state, doubles_at(about[_SETTINGS]), commands))
    total = 0.0
    for k in range(first, last + 1):
        total += abs(commands[k])
    for k in range(states):
        total += abs(state[k])
    if total < np.inf:
        return True
    about[_FAILED] = 1
    return False


def is_native(function: Any) -> bool:
    """Return whether a function is a numba.cfunc."""
    return isinstance(function, CFunc)


def is_compiled(function: Any) -> bool:
    """Return whether a function is compiled by numba.njit."""
    return isinstance(function, Dispatcher)


def arity(function: Any, least: int = 1) -> int:
    """Return how many of seen, state and settings a function takes, `least` to 3; or InputError."""
    described = function.py_func if is_compiled(function) else function
    for number in range(3, least - 1, -1):
        try:
            inspect.signature(described).bind(*range(number))
        except (TypeError, ValueError):
            continue
        return number
    name = getattr(described, "__name__", type(described).__name__)
    raise InputError(
        f"controller {name!r} must take (seen), (seen, state) or (seen, state, settings)"
    )


_NOT_FINITE = (
    "returned a command or left a state that is not finite, or its indices went beyond; without "
    "numba.njit it says more"
)


class _UnfitError(ValueError):
    """A law returned something that its servos can't take."""


class Failure(NamedTuple):
    """The failure of a law; why: end of a sentence; traceback: text without folders, or ""."""

    why: str
    traceback: str


@dataclass(frozen=True, eq=False)
class OwnLaw:
    """A user's law of seen, state and settings, (n_settings,); reset: where it starts, or None."""

    function: Any
    place: Place
    states: int
    settings: NDArray[np.float64]
    reset: Any
    name: str

    def copied(self) -> tuple[Any, Any]:
        """Return function and reset, of a copy if an object; InputError if it can't be copied."""
        if is_native(self.function) or is_compiled(self.function):
            return self.function, self.reset
        known: dict[int, Any] = {}  # so that a reset of the object is one of its copy
        try:
            return copy.deepcopy(self.function, known), copy.deepcopy(self.reset, known)
        except Exception as error:  # whatever the user's object raises
            raise InputError(
                f"controller {self.name!r} can't be copied, and each flight has a copy of its own: "
                f"{type(error).__name__}: {error}"
            ) from None


WATCHED: "weakref.WeakSet[Registered]" = weakref.WeakSet()


def _checked(commands: Any, place: Place) -> tuple[float, ...]:
    several = isinstance(commands, tuple | list | np.ndarray)
    try:
        numbers = tuple(map(float, commands if several or place != "tail" else (commands,)))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(PLACES[place]) or not np.isfinite(numbers).all():
        wanted = ", ".join(PLACES[place])
        raise _UnfitError(f"returned {commands!r:.80} where finite numbers for {wanted} are wanted")
    return numbers


class Called:
    """A law, copied if an object, as the code that a flight calls; or InputError."""

    def __init__(self, law: OwnLaw) -> None:
        self.law = law
        self._function, self._reset = law.copied()
        self._raised: list[Failure] = []
        self._settings = np.ascontiguousarray(law.settings, dtype=np.float64)
        if is_native(law.function):
            self._code: Any = law.function.ctypes
        elif is_compiled(law.function):
            self._code = _compiled(law).ctypes
        else:
            self._code = _PROTOTYPE(self._thunk())
        self.address = ctypes.cast(self._code, ctypes.c_void_p).value or 0

    def __call__(self, seen: Seen, state: NDArray[np.float64], *, starts: bool) -> list[float]:
        """Return what the law commands; the state, (n_state,), moves on. Raises ModelError."""
        numbers, commands = np.array([*seen, float(starts)]), np.full(COMMANDS, np.nan)
        given = (numbers, state, self._settings, commands)
        _PROTOTYPE(self.address)(*(one.ctypes.data for one in given))
        for failure in self._raised:
            error = ModelError(f"controller {self.law.name!r} {failure.why}")
            error.add_note(failure.traceback)
            raise error
        return commands.tolist()

    def _thunk(self) -> Callable[[int, int, int, int], None]:
        law, function, reset = self.law, self._function, self._reset
        takes, starts_with = arity(function), 0 if reset is None else arity(reset, least=0)
        state, lock = np.zeros(law.states), threading.RLock()
        here, given_at = state.ctypes.data, 24 if law.place == "tail" else 0
        inputs, outputs = (ctypes.c_double * n for n in (SEEN + 1, len(PLACES[law.place])))

        def called(seen_at: int, state_at: int, _settings: int, commands_at: int) -> None:
            try:
                *numbers, starts = inputs.from_address(seen_at)
                with lock:
                    ctypes.memmove(here, state_at, state.nbytes)
                    given = Seen(*numbers), state, law.settings
                    if reset is not None and starts:
                        reset(*given[:starts_with])
                    commands = _checked(function(*given[:takes]), law.place)
                    if not np.isfinite(state).all():
                        raise _UnfitError("left a state that is not finite")
                    ctypes.memmove(state_at, here, state.nbytes)
                outputs.from_address(commands_at + given_at)[:] = commands
            except BaseException as error:  # nothing may be raised into MuJoCo
                self._raised.append(raised(error))
                if isinstance(error, KeyboardInterrupt):
                    _thread.interrupt_main()

        return called


class Registered(Called):
    """A law in the process's table until `release`; or InputError.

    How a `watched` one fails is said where a block of `installed` ends.
    """

    def __init__(self, law: OwnLaw, *, watched: bool = False) -> None:
        super().__init__(law)
        with LOCK:
            if not _free:
                raise InputError(f"this process has {_ROWS - 1} control laws; there can't be more")
            self._index = _free.pop()
            self.handle = next(_numbers) * _ROWS + self._index
            row = _table[self._index]
            row[_FUNCTION], row[_SETTINGS] = self.address, self._settings.ctypes.data
            row[_STATES], row[_FAILED] = law.states, 0
            row[_HANDLE] = self.handle
            if watched:
                WATCHED.add(self)

    def release(self) -> None:
        """Take the law out of the table; whoever still names it is refused."""
        with LOCK:
            if _table[self._index, _HANDLE] == self.handle:
                _table[self._index, _HANDLE] = 0
                _free.append(self._index)

    def failure(self) -> Failure | None:
        """Return how the law failed since this was last asked; None if it didn't."""
        row, failures = _table[self._index], [*self._raised]
        self._raised.clear()
        if row[_HANDLE] == self.handle and row[_FAILED]:
            row[_FAILED] = 0
            failures.append(Failure(_NOT_FINITE, ""))
        return failures[0] if failures else None


def raised(error: BaseException) -> Failure:
    """Return what a law raised: kind, text, and place in the law's own lines."""
    if isinstance(error, _UnfitError):
        return Failure(str(error), "")
    lines = [
        f'  File "{Path(one.filename).name}", line {one.lineno}, in {one.name}\n    {one.line}'
        for one in traceback.extract_tb(error.__traceback__)
        if one.filename != __file__
    ]
    words = f"{type(error).__name__}: {error}".removesuffix(": ")
    said = "\n".join(["Traceback (most recent call last):", *lines, words])
    return Failure(f"raised {words}", said)


@kernel()
def _seen_at(at):
    """Return what stands at the pointer of a law, `Seen`."""
    early = at[0], at[1], at[2], at[3], at[4], at[5], at[6], at[7], at[8]
    late = at[9], at[10], at[11], at[12], at[13], at[14], at[15], at[16], at[17]
    return Seen(*(early + late))


def _compiled(law: OwnLaw) -> Any:
    try:
        with LOCK:
            return _native_of(law.function, law.place, law.states, law.settings.size, law.reset)
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        skipped = ("Failed in", "During:", "File ")
        reason = next((line for line in lines if not line.startswith(skipped)), lines[0])
        raise InputError(
            f"numba can't compile controller {law.name!r} to a law that returns numbers for "
            f"{', '.join(PLACES[law.place])}: {reason}"
        ) from error


@cache
def _native_of(function: Any, place: Place, states: int, numbers: int, reset: Any) -> Any:
    many, tail = max(1, numbers), place == "tail"
    law = _of_three(function)
    begin = _nothing if reset is None else _of_three(reset)
    store = {"all": _store_all, "swash": _store_swash, "tail": _store_tail}[place]

    @cfunc(_SIGNATURE)
    def native(seen_at, state_at, settings_at, commands):
        seen = _seen_at(seen_at)
        state = carray(state_at, (states,))
        settings = carray(settings_at, (many,))[:numbers]
        try:
            if seen_at[18] != 0.0:
                begin(seen, state, settings)
            store(commands, law(seen, state, settings))
        except Exception:  # a command that isn't one ends the law
            commands[3 if tail else 0] = np.nan

    return native


def _of_three(function: Any) -> Any:
    """Return a compiled function of seen, state and settings, which checks indices by default."""
    function = function if is_compiled(function) else numba.njit(function)
    options = dict(function.targetoptions)
    if options.get("boundscheck") is None:
        function = numba.jit(**{**options, "boundscheck": True})(function.py_func)
    forms = (
        lambda seen, state, settings: function(seen),
        lambda seen, state, settings: function(seen, state),
        lambda seen, state, settings: function(seen, state, settings),
    )
    return numba.njit(forms[arity(function) - 1])


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


@dataclass(frozen=True)
class KnownLaw:
    """A law of helisim's for all servos, of kernels of (seen, state, settings)."""

    function: Callable[..., Any]
    reset: Callable[..., Any]

    def __call__(self, seen: Seen, state: Any, settings: Any) -> Any:
        """Return the commands; the state, (n_state,), moves on. In Python."""
        return self.function(seen, state, settings)

    @property
    def native(self) -> Any:
        """The law as a numba.cfunc, which doesn't look at its indices."""
        return _known(self.function, self.reset)


@cache
def _known(function: Any, reset: Any) -> Any:
    mark = fingerprint(*(Path(inspect.getfile(one)) for one in (function, reset)))

    def compiled(cached: bool) -> Any:
        @cfunc(_SIGNATURE, cache=cached, pipeline_class=CallbackCompiler)
        def native(at, state, settings, commands):
            seen = _seen_at(at)
            if at[18] != 0.0 and mark != 0:
                reset(seen, state, settings)
            commands[0], commands[1], commands[2], commands[3] = function(seen, state, settings)

        return native

    return compiled_or_cached(compiled)
