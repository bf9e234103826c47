"""Control laws beside the shipped gyro's: a user's functions, helisim's own, and their table.

The compiled callbacks call a law by a row in a table of the process. A vehicle's numbers name the
row by its handle and the process by a token, so a model that comes from elsewhere, or outlives its
law, is refused and calls nothing. What is called is

    void law(double *seen, double *state, double *settings, double *commands)

with `Seen` and one number more, 1 at a law's first tick and otherwise 0; it writes the commands of
its servos among front, left, right and tail. One that is not finite ends the law, and is kept with
what the law saw. A Python function is called through ctypes, which takes the interpreter's lock by
itself in whatever thread MuJoCo steps; `numba.njit` of the same function and `numba.cfunc` are
called natively.
"""

import _thread
import copy
import ctypes
import hashlib
import inspect
import linecache
import os
import struct
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, NamedTuple

import numba
import numpy as np
from numba import carray, cfunc, types
from numba.core.ccallback import CFunc
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from helisim.base.errors import InputError
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
PLACES: dict[Place, tuple[str, ...]] = {
    "all": ("front", "left", "right", "tail"),
    "swash": ("front", "left", "right"),
    "tail": ("tail",),
}
"""The commands of a law in each place, in the order in which it returns them."""
SEEN = len(Seen._fields)
"""Count of the numbers that a law sees; behind them stands whether it starts."""
COMMANDS = 4
_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.void(_POINTER, _POINTER, _POINTER, _POINTER)
_PROTOTYPE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)

_ROWS = 1 << 20
_WIDTH = 8
_HANDLE, _FUNCTION, _SETTINGS, _STATES, _FAILED, _KEPT = range(6)
"""Columns of a row: handle, addresses of law and settings, states, whether and where it failed.

Row 0 holds the token in place of a handle.
"""
_table = np.zeros((_ROWS, _WIDTH), dtype=np.int64)  # its memory is taken as it is used
_table[0, _HANDLE] = int.from_bytes(os.urandom(6), "little") | 1
_address = address_of("helisim_laws", _table.ctypes.data)
LOCK = threading.RLock()  # a law may be released while memory is taken for another
_free: list[int] = []
_used = [0, 1]
"""Count of all laws so far, and the first row that never had one."""


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
    known = known and handle == longs_at(row)[_HANDLE]
    if known and states == longs_at(row)[_STATES]:
        return row
    return 0


@kernel()
def ask(row, seen, state, states, commands, first, last):
    """Ask a law for its commands; return whether they and its state are finite.

    row: its address; seen: what it sees, and whether it starts, (19,); state: of the law,
    (states,), moved on to the next tick; commands: of the four servos, (4,), written from the
    first to the last that count.
    """
    about = longs_at(row)
    before = doubles_at(about[_KEPT] + 8 * (SEEN + 1 + COMMANDS))
    failed = about[_FAILED] != 0
    if not failed:
        for k in range(states):
            before[k] = state[k]
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
    if not failed:
        kept = doubles_at(about[_KEPT])
        for k in range(SEEN + 1):
            kept[k] = seen[k]
        for k in range(COMMANDS):
            kept[SEEN + 1 + k] = commands[k]
        about[_FAILED] = 1
    return False


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
    wanted = "(seen), (seen, state) or (seen, state, settings)"
    try:
        signature = inspect.signature(described)
    except (TypeError, ValueError):
        raise InputError(
            f"controller {name!r} doesn't say which arguments it takes; write a function of "
            f"{wanted}"
        ) from None
    for count in (3, 2, 1, 0):
        try:
            signature.bind(*range(count))
        except TypeError:
            continue
        return count
    raise InputError(f"controller {name!r} takes {signature}; it must take {wanted}")


class _UnfitError(ValueError):
    """A law returned something that its servos can't take."""


class Failure(NamedTuple):
    """The failure of a law.

    why: in a sentence's end, such as "raised ZeroDivisionError: division by zero"; traceback: its
    text, with names of files and no folders; "" if there is none.
    """

    why: str
    traceback: str


@dataclass(frozen=True, eq=False)
class OwnLaw:
    """A function of the user in its place.

    function: called at each tick with what is seen, the state and the settings, or the first one or
    two of these; of Python, or compiled by numba; place: which servos it moves; states: how many
    numbers it keeps from tick to tick; settings: (n_settings,), which it only reads; reset: called
    like `function` where the law starts, None for nothing; name: for messages.
    """

    function: Any
    place: Place
    states: int
    settings: NDArray[np.float64]
    reset: Any
    name: str

    def watched(self) -> "Registered":
        """Return the law in the table; how it fails is said where a block of `installed` ends."""
        one = Registered(self)
        with LOCK:
            WATCHED.add(one)
        return one

    def lasting(self) -> "Registered":
        """Return the law likewise, until the process ends; of a function always the same."""
        one = self.function
        shared = inspect.isfunction(one) or is_compiled(one) or is_native(one)
        of = (id(one), id(self.reset)) if shared else object()
        key = (of, self.place, self.states, self.settings.tobytes())
        if key not in _lasting:
            _lasting.setdefault(key, self.watched())
        return _lasting[key]

    def copied(self) -> tuple[Any, Any]:
        """Return function and reset, of an object's own copy if it is one.

        Raises:
            InputError: the object can't be copied.
        """
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


_lasting: "dict[Any, Registered]" = {}
WATCHED: "weakref.WeakSet[Registered]" = weakref.WeakSet()


class Called:
    """A law called from Python, a copy of it if it is an object.

    Raises:
        InputError: it can't be copied.
    """

    def __init__(self, law: OwnLaw) -> None:
        self.law = law
        self._function, self._reset = law.copied()

    def start(self, seen: Seen, state: NDArray[np.float64]) -> None:
        """Let the law give itself a state to start with, (n_state,), as far as it has a reset.

        A native one is asked for the commands of its first tick.
        """
        if is_native(self._function):
            self._asked(seen, state, starts=True)
        elif self._reset is not None:
            self._reset(*(seen, state, self.law.settings)[: arity(self._reset)])

    def __call__(self, seen: Seen, state: NDArray[np.float64]) -> tuple[float, ...]:
        """Return what the law commands; the state, (n_state,), moves on."""
        if is_native(self._function):
            return self._asked(seen, state, starts=False)
        given = (seen, state, self.law.settings)[: arity(self._function)]
        return _checked(self._function(*given), self.law.place)

    def _asked(self, seen: Seen, state: NDArray[np.float64], *, starts: bool) -> tuple[float, ...]:
        law = self.law
        numbers, commands = np.array([*seen, float(starts)]), np.full(COMMANDS, np.nan)
        settings = law.settings if law.settings.size else np.zeros(1)
        double = ctypes.POINTER(ctypes.c_double)
        given = (numbers, state, settings, commands)
        self._function.ctypes(*(one.ctypes.data_as(double) for one in given))
        first = 3 if law.place == "tail" else 0
        return tuple(commands[first : first + len(PLACES[law.place])].tolist())


def _checked(commands: Any, place: Place) -> tuple[float, ...]:
    """Return a law's commands as a tuple of numbers."""
    if place == "tail" and not isinstance(commands, tuple | list | np.ndarray):
        commands = (commands,)
    try:
        numbers = tuple(map(float, commands))
    except (TypeError, ValueError):
        numbers = ()
    wanted = PLACES[place]
    if len(numbers) != len(wanted):
        alone = {1: "tail", 3: "swash"}.get(1 if np.isscalar(commands) else len(numbers))
        hint = f"; as a part of the gyro it is Controller({alone}=law)" if alone else ""
        wrong = f"returned {commands!r:.80} where numbers for {', '.join(wanted)} are wanted"
        raise _UnfitError(wrong + (hint if place == "all" else ""))
    return numbers


class Registered:
    """A law in the table of the process, until `release`; a copy of it if it is an object.

    handle: by which a vehicle's numbers name it; law: what it is.

    Raises:
        InputError: numba can't compile it, it can't be copied, or there are too many laws.
    """

    def __init__(self, law: OwnLaw) -> None:
        self.law = law
        self.function, self.reset = law.copied()
        self._raised: list[Failure] = []
        if is_native(law.function):
            self._code: Any = law.function
        elif is_compiled(law.function):
            self._code = _compiled(law)
        else:
            self._code = _PROTOTYPE(self._thunk())
        address = getattr(self._code, "address", None)
        if address is None:
            address = ctypes.cast(self._code, ctypes.c_void_p).value or 0
        self._settings = np.ascontiguousarray(law.settings, dtype=np.float64)
        self._kept = np.zeros(SEEN + 1 + COMMANDS + law.states)
        with LOCK:
            if not _free and _used[1] == _ROWS:
                raise InputError(
                    f"this process has {_ROWS} control laws; there is room for no more"
                )
            if not _free:
                _free.append(_used[1])
                _used[1] += 1
            self._index = _free.pop()
            _used[0] += 1
            self.handle = _used[0] * _ROWS + self._index
            row = _table[self._index]
            row[_FUNCTION], row[_SETTINGS] = address, self._settings.ctypes.data
            row[_STATES], row[_FAILED], row[_KEPT] = law.states, 0, self._kept.ctypes.data
            row[_HANDLE] = self.handle

    def release(self) -> None:
        """Take the law out of the table; whoever still names it is refused."""
        with LOCK:
            if _table[self._index, _HANDLE] == self.handle:
                _table[self._index, _HANDLE] = 0
                _free.append(self._index)

    def failure(self) -> Failure | None:
        """Return how the law failed since this was last asked; None if it didn't."""
        row, law = _table[self._index], self.law
        failed = row[_HANDLE] == self.handle and row[_FAILED]
        numbers = self._kept.copy()
        if failed:
            row[_FAILED] = 0
        if self._raised:
            first = self._raised[0]
            self._raised.clear()
            return first
        if not failed:
            return None
        seen, commands = Seen(*numbers[:SEEN].tolist()), numbers[SEEN + 1 : SEEN + 1 + COMMANDS]
        if is_compiled(self.function):  # called again as Python, it raises what it raised there
            given = (seen, numbers[SEEN + 1 + COMMANDS :], law.settings)
            try:
                self.function.py_func(*given[: arity(self.function)])
            except Exception as error:  # whatever the user's function raises
                return self._described(error)
        wrong = [
            f"{name} = {value:g}"
            for name, value in zip(PLACES["all"], commands)
            if name in PLACES[law.place] and not np.isfinite(value)
        ]
        why = f"returned {', '.join(wrong)}" if wrong else "left a state that is not finite"
        return Failure(why, "")

    def _described(self, error: BaseException) -> Failure:
        failure = raised(error)
        if not isinstance(error, IndexError):
            return failure
        room = f"it has {self.law.states} states and {self.law.settings.size} settings"
        return failure._replace(why=f"{failure.why} ({room}; Controller takes states=N)")

    def _thunk(self) -> Callable[[int, int, int, int], None]:
        law, function, reset = self.law, self.function, self.reset
        takes, starts_with = arity(function), 0 if reset is None else arity(reset)
        state, settings = np.zeros(law.states), law.settings
        room, here = 8 * law.states, state.ctypes.data
        lock, tail = threading.RLock(), law.place == "tail"
        pack = struct.Struct(f"{len(PLACES[law.place])}d").pack
        size, offset = 8 * len(PLACES[law.place]), 24 if tail else 0
        seen_of, unpack = partial(tuple.__new__, Seen), struct.Struct(f"{SEEN}d").unpack_from
        start, zero = 8 * SEEN, struct.pack("d", 0.0)
        string_at, memmove = ctypes.string_at, ctypes.memmove

        def called(seen_at: int, state_at: int, _settings: int, commands_at: int) -> None:
            try:
                numbers = string_at(seen_at, start + 8)
                seen = seen_of(unpack(numbers))
                with lock:
                    memmove(here, state_at, room)
                    if reset is not None and numbers[start:] != zero:
                        reset(*(seen, state, settings)[:starts_with])
                    if takes == 2:
                        commands = function(seen, state)
                    elif takes == 1:
                        commands = function(seen)
                    else:
                        commands = function(seen, state, settings)
                    memmove(state_at, here, room)
                try:
                    packed = pack(commands) if tail else pack(*commands)
                except (TypeError, struct.error):
                    packed = pack(*_checked(commands, law.place))
                memmove(commands_at + offset, packed, size)
            except BaseException as error:  # nothing may be raised into MuJoCo
                self._raised.append(self._described(error))
                if isinstance(error, KeyboardInterrupt):
                    _thread.interrupt_main()

        return called


def raised(error: BaseException) -> Failure:
    """Return what a law raised: the kind, its text, and where, from the law's own lines on."""
    if isinstance(error, _UnfitError):
        return Failure(str(error), "")
    trace: TracebackType | None = error.__traceback__
    lines = ["Traceback (most recent call last):"]
    while trace is not None:
        code, number = trace.tb_frame.f_code, trace.tb_lineno
        if code.co_filename != __file__:
            lines.append(
                f'  File "{Path(code.co_filename).name}", line {number}, in {code.co_name}'
            )
            text = linecache.getline(code.co_filename, number).strip()
            lines += [f"    {text}"] if text else []
        trace = trace.tb_next
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return Failure(f"raised {words}", "\n".join([*lines, words]))


@kernel()
def _seen_at(at):
    """Return what stands at the pointer of a law, `Seen`."""
    early = at[0], at[1], at[2], at[3], at[4], at[5], at[6], at[7], at[8]
    late = at[9], at[10], at[11], at[12], at[13], at[14], at[15], at[16], at[17]
    return Seen(*(early + late))


_natives: "weakref.WeakKeyDictionary[Any, dict[Any, Any]]" = weakref.WeakKeyDictionary()


def _compiled(law: OwnLaw) -> Any:
    """Return a law of numba.njit as a native function, compiled once for its kind.

    An index beyond its state or settings raises there, as in Python, unless the law says
    `boundscheck=False`: behind them is memory of the simulation.
    """
    key = (law.place, law.states, law.settings.size, law.reset)
    with LOCK:
        known = _natives.setdefault(law.function, {})
        if key not in known:
            try:
                known[key] = _native_of(law.function, *key)
            except NumbaError as error:
                lines = [line.strip() for line in str(error).splitlines() if line.strip()]
                skipped = ("Failed in", "During:", "File ")
                telling = [line for line in lines if not line.startswith(skipped)]
                reason = (telling or lines)[0].removeprefix("('").removesuffix("')")
                reason = reason.replace("', '", "")
                raise InputError(
                    f"numba can't compile controller {law.name!r} to a law that returns numbers "
                    f"for {', '.join(PLACES[law.place])}: {reason}"
                ) from error
        return known[key]


def _native_of(function: Any, place: Place, states: int, numbers: int, reset: Any) -> Any:
    count, tail = max(1, numbers), place == "tail"
    law = _of_three(function)
    begin = _nothing if reset is None else _of_three(reset)
    store = {"all": _store_all, "swash": _store_swash, "tail": _store_tail}[place]

    @cfunc(_SIGNATURE)
    def native(seen_at, state_at, settings_at, commands):
        seen = _seen_at(seen_at)
        state = carray(state_at, (states,))
        settings = carray(settings_at, (count,))[:numbers]
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
        lambda seen, state, settings: function(),
        lambda seen, state, settings: function(seen),
        lambda seen, state, settings: function(seen, state),
        lambda seen, state, settings: function(seen, state, settings),
    )
    return numba.njit(forms[arity(function)])


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
    """A law of helisim's, of all servos, whose functions are kernels at the top of modules.

    It is compiled once for all its settings, and kept on disk.

    function: of (seen, state, settings); returns front, left, right and tail; reset: called
    likewise where the law starts; it returns nothing.
    """

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
    """Return a law compiled, by the code on disk where that is of the same sources."""
    digest = hashlib.sha256(str(fingerprint()).encode())
    for one in (function, reset):
        digest.update(Path(inspect.getfile(one)).read_bytes())
    mark = int.from_bytes(digest.digest()[:7], "little")

    def compiled(cached: bool) -> Any:
        @cfunc(_SIGNATURE, cache=cached, pipeline_class=CallbackCompiler)
        def native(at, state, settings, commands):
            seen = _seen_at(at)
            if at[18] != 0.0 and mark != 0:
                reset(seen, state, settings)
            commands[0], commands[1], commands[2], commands[3] = function(seen, state, settings)

        return native

    return compiled_or_cached(compiled)
