"""Functions of the user as control laws that the callbacks can call.

A Python function is called through ctypes, which takes the interpreter's lock by itself in
whatever thread MuJoCo steps. One that numba has compiled is called natively: `numba.njit` of the
same function, or a `numba.cfunc` with the signature in `laws`.
"""

import _thread
import copy
import ctypes
import inspect
import linecache
import struct
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.compiled_laws import (
    PLACES,
    Place,
    arity,
    compiled,
    is_compiled,
    is_native,
)
from helisim.physics.gyro import Seen
from helisim.physics.laws import COMMANDS, SEEN, Row

_PROTOTYPE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)
_seen_of = partial(tuple.__new__, Seen)
_unpack_seen = struct.Struct(f"{SEEN}d").unpack_from
_SEEN_BYTES = 8 * (SEEN + 1)
_START = 8 * SEEN
_lasting: "dict[Any, Registered]" = {}
_watched: "weakref.WeakSet[Registered]" = weakref.WeakSet()
_watching = threading.Lock()


class Unfit(ValueError):
    """What a law returned is not what its servos need."""


class Failure(NamedTuple):
    """How a law failed.

    Attributes:
        why: in a sentence's end, such as "raised ZeroDivisionError: division by zero".
        traceback: its text, with names of files and no folders; "" if there is none.
    """

    why: str
    traceback: str


@dataclass(frozen=True, eq=False)
class OwnLaw:
    """A function of the user in its place.

    Attributes:
        function: called at each tick with what is seen, the state and the settings, or the first
            one or two of these; of Python, or compiled by numba.
        place: which servos it moves.
        states: how many numbers it keeps from tick to tick.
        settings: (n_settings,), which it only reads.
        reset: called like `function` where the law starts, None for nothing.
        name: for messages.
    """

    function: Any
    place: Place
    states: int
    settings: NDArray[np.float64]
    reset: Any
    name: str

    def registered(self) -> "Registered":
        """Return the law where the callbacks can call it, a copy of it if it is an object.

        Raises:
            InputError: numba can't compile it, or it can't be copied.
        """
        return Registered(self)

    def watched(self) -> "Registered":
        """Return the law likewise; how it fails is said where a block of `installed` ends."""
        one = Registered(self)
        with _watching:
            _watched.add(one)
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


class Called:
    """A law called from Python, a copy of it if it is an object.

    Raises:
        InputError: it can't be copied.
    """

    def __init__(self, law: OwnLaw) -> None:
        self.law = law
        self._function, self._reset = copied(law)

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
        law, function = self.law, self._function
        if is_native(function):
            return self._asked(seen, state, starts=False)
        given = (seen, state, law.settings)[: arity(function)]
        return checked(function(*given), law.place)

    def _asked(self, seen: Seen, state: NDArray[np.float64], *, starts: bool) -> tuple[float, ...]:
        """Return what a native law commands; the state, (n_state,), moves on."""
        law = self.law
        numbers, commands = np.array([*seen, float(starts)]), np.full(COMMANDS, np.nan)
        settings = law.settings if law.settings.size else np.zeros(1)
        self._function.ctypes(*map(_pointer_to, (numbers, state, settings, commands)))
        first = 3 if law.place == "tail" else 0
        return tuple(commands[first : first + len(PLACES[law.place])].tolist())


def watched_failures() -> list[str]:
    """Return how laws failed that stay in models, each in one text; then they count as said."""
    with _watching:
        kept = list(_watched)
    said = []
    for one in kept:
        failure = one.failure()
        if failure is not None:
            said.append(f"controller {one.law.name!r} {failure.why}\n{failure.traceback}".rstrip())
    return said


def _pointer_to(array: NDArray[np.float64]) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def checked(commands: Any, place: Place) -> tuple[float, ...]:
    """Return a law's commands as a tuple of numbers. Raises Unfit."""
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
        raise Unfit(wrong + (hint if place == "all" else ""))
    return numbers


class Registered:
    """A law in the table of the process, until `release`.

    Attributes:
        handle: by which a vehicle's numbers name it.
        law: what it is.
    """

    def __init__(self, law: OwnLaw) -> None:
        self.law = law
        self.function, self.reset = copied(law)
        self._raised: list[Failure] = []
        if is_native(law.function):
            self._code: Any = law.function
            address = law.function.address
        elif is_compiled(law.function):
            sizes = law.states, law.settings.size
            self._code = compiled(law.function, law.reset, law.place, *sizes, name=law.name)
            address = self._code.address
        else:
            self._code = _PROTOTYPE(self._thunk())
            address = ctypes.cast(self._code, ctypes.c_void_p).value or 0
        self._row = Row(address, law.settings, law.states)
        self.handle = self._row.handle

    def release(self) -> None:
        """Take the law out of the table."""
        self._row.release()

    def failure(self) -> Failure | None:
        """Return how the law failed since this was last asked; None if it didn't."""
        failed = self._row.failed()
        if self._raised:
            first = self._raised[0]
            self._raised.clear()
            return first
        if failed is None:
            return None
        seen, state, commands = failed
        if is_compiled(self.function):
            again = self._again(seen, state)
            if again is not None:
                return again
        wrong = [
            f"{name} = {value:g}"
            for name, value in zip(PLACES["all"], commands)
            if name in PLACES[self.law.place] and not np.isfinite(value)
        ]
        why = f"returned {', '.join(wrong)}" if wrong else "left a state that is not finite"
        return Failure(why, "")

    def _again(self, seen: Seen, state: NDArray[np.float64]) -> Failure | None:
        """Return what the law raises where it failed, by calling it as Python."""
        given = (seen, state, self.law.settings)[: arity(self.function)]
        try:
            self.function.py_func(*given)
        except Exception as error:  # whatever the user's function raises
            return self._told(error)
        return None

    def _told(self, error: BaseException) -> Failure:
        failure = raised(error)
        if not isinstance(error, IndexError):
            return failure
        room = f"it has {self.law.states} states and {self.law.settings.size} settings"
        return failure._replace(why=f"{failure.why} ({room}; Controller takes states=N)")

    def _thunk(self) -> Callable[[int, int, int, int], None]:
        law, function, reset = self.law, self.function, self.reset
        takes = arity(function)
        starts_with = 0 if reset is None else arity(reset)
        state = np.zeros(law.states)
        settings = law.settings
        room, here = 8 * law.states, state.ctypes.data
        lock = threading.RLock()
        pack = struct.Struct(f"{len(PLACES[law.place])}d").pack
        size = 8 * len(PLACES[law.place])
        offset = 24 if law.place == "tail" else 0
        string_at, memmove = ctypes.string_at, ctypes.memmove
        tail = law.place == "tail"

        def called(seen_at: int, state_at: int, _settings: int, commands_at: int) -> None:
            try:
                numbers = string_at(seen_at, _SEEN_BYTES)
                seen = _seen_of(_unpack_seen(numbers))
                with lock:
                    memmove(here, state_at, room)
                    if reset is not None and numbers[_START:] != _ZERO:
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
                    packed = pack(*checked(commands, law.place))
                memmove(commands_at + offset, packed, size)
            except BaseException as error:  # nothing may be raised into MuJoCo
                self._raised.append(self._told(error))
                if isinstance(error, KeyboardInterrupt):
                    _thread.interrupt_main()

        return called


_ZERO = struct.pack("d", 0.0)


def raised(error: BaseException) -> Failure:
    """Return what a law raised: the kind, its text, and where, from the law's own lines on."""
    if isinstance(error, Unfit):
        return Failure(str(error), "")
    trace: TracebackType | None = error.__traceback__
    here = __file__
    lines = ["Traceback (most recent call last):"]
    while trace is not None:
        code, number = trace.tb_frame.f_code, trace.tb_lineno
        if code.co_filename != here:
            lines.append(
                f'  File "{Path(code.co_filename).name}", line {number}, in {code.co_name}'
            )
            text = linecache.getline(code.co_filename, number).strip()
            lines += [f"    {text}"] if text else []
        trace = trace.tb_next
    words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return Failure(f"raised {words}", "\n".join([*lines, words]))


def copied(law: OwnLaw) -> tuple[Any, Any]:
    """Return function and reset of a law, of an object's own copy if it is one.

    Raises:
        InputError: the object can't be copied.
    """
    function, reset = law.function, law.reset
    if is_native(function) or is_compiled(function):
        return function, reset
    known: dict[int, Any] = {}  # so that a reset of the object is one of its copy
    try:
        return copy.deepcopy(function, known), copy.deepcopy(reset, known)
    except Exception as error:  # whatever the user's object raises
        raise InputError(
            f"controller {law.name!r} can't be copied, and each flight has a copy of its own: "
            f"{type(error).__name__}: {error}"
        ) from None
