"""Controllers: which law moves which servos, at the gyro's place and rate."""

import hashlib
import inspect
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Literal, Protocol, runtime_checkable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, ModelError
from helisim.base.settings import Value
from helisim.physics import laws
from helisim.physics.laws import (
    Failure,
    KnownLaw,
    OwnLaw,
    Place,
    Registered,
    arity,
    is_compiled,
    is_native,
)
from helisim.physics.layout import (
    FIRST_LAW_STATE,
    NO_LAW,
    PARAM,
    SHIPPED_LAW,
    STATE,
    SWASH_STATES,
    TAIL_STATES,
    WITHOUT_LAWS,
)
from helisim.physics.native import check_is_model
from helisim.vehicle.trim import addresses

Law = Callable[..., Any]
"""`law(seen, state, settings)` or with the first one or two of these; returns servo commands."""
Slot = Law | Literal["shipped"] | None

STATES: dict[Place, int] = {
    "all": SWASH_STATES + TAIL_STATES,
    "swash": SWASH_STATES,
    "tail": TAIL_STATES,
}
"""States of a law where nothing is said: as the gyro's own, so every MJCF has room."""
_MOST = 1000
SHIPPED = "shipped"


@runtime_checkable
class WrittenLaw(Protocol):
    """A control law as data, which makes a controller for a vehicle; `helisim.laws` has them."""

    def on(self, vehicle: Any) -> "Controller":
        """Return the controller that flies it on a `Vehicle`, about its trim."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Controller(Value):
    """A controller: it turns sticks and sensors into servo commands, at the gyro's place and rate.

    A law is called at each tick with what is `Seen`, its own state and its settings, or the first
    one or two of these, and returns the commands of its servos, unitised. It is a Python function,
    the same compiled by `numba.njit`, a `numba.cfunc`, or an object that is called; of an object
    each flight has a copy of its own, and its `reset`, if it has one, is called where it starts.

    Attributes:
        law: of all four servos: returns front, left, right and tail. None: see the next two.
        swash: of the swashplate's servos: returns front, left and right; "shipped" is the gyro's
            own, None leaves them to the caller.
        tail: of the tail servo: returns one number; likewise.
        states: how many numbers a law keeps from tick to tick, zero where it starts; None for
            the law's own attribute `states`, or 8 (of the swashplate's law 6, of the tail's 2), or
            none if it takes only what is seen.
        settings: (n_settings,) that the laws only read.
        reset: called as a law is, where one starts: at a flight's start, after a fault's restart.
            None for the law's own `reset`, if it has one.
        name: for messages and provenance; None for the law's own.
        written: the law as data that this flies on one vehicle, about one trim; None if it is not
            of such.

    Raises:
        InputError: what is given is no law, or takes other arguments.
    """

    law: Law | None = None
    swash: Slot = field(default=SHIPPED, kw_only=True)
    tail: Slot = field(default=SHIPPED, kw_only=True)
    states: int | None = field(default=None, kw_only=True)
    settings: ArrayLike | Sequence[float] = field(default=(), kw_only=True)
    reset: Law | None = field(default=None, kw_only=True)
    name: str | None = field(default=None, kw_only=True)
    written: WrittenLaw | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        if self.law is not None and (self.swash, self.tail) != (SHIPPED, SHIPPED):
            raise InputError("a controller has a law of all servos, or swash and tail, not both")
        for place, law in self._own():
            check_law(law, place)
        if self.reset is not None:
            check_law(self.reset, "reset")
        try:
            settings = np.array(self.settings, dtype=np.float64)
        except (TypeError, ValueError):
            settings = np.array([np.nan])
        if settings.ndim != 1 or not np.all(np.isfinite(settings)):
            raise InputError(
                f"settings must be a list of finite numbers, got {self.settings!r:.60}"
            )
        settings.setflags(write=False)
        object.__setattr__(self, "settings", settings)
        states = self.states
        if states is not None and (not isinstance(states, int) or not 0 <= states <= _MOST):
            raise InputError(f"states must be an integer from 0 to {_MOST}, got {states!r}")
        if self.name is None:
            names = [law_name(law) for _, law in self._own()]
            none = "shipped" if self.is_shipped else "none"
            object.__setattr__(self, "name", " and ".join(names) or none)

    def __repr__(self) -> str:
        return f"Controller({self.name!r})"

    def __hash__(self) -> int:
        return hash((self.name, self.state_counts))

    def __reduce__(self) -> tuple[Any, ...]:
        for _, law in self._own():
            check_passes(law, str(self.name))
        return super().__reduce__()

    def __deepcopy__(self, memo: dict[int, Any]) -> "Controller":
        """Return it as it is: each flight copies the law's object by itself."""
        return self

    def _own(self) -> list[tuple[Place, Law]]:
        """Return the laws that aren't shipped, by their place."""
        if self.law is not None:
            return [("all", self.law)]
        given: list[tuple[Place, Slot]] = [("swash", self.swash), ("tail", self.tail)]
        return [(place, law) for place, law in given if law is not None and law != SHIPPED]

    @property
    def is_shipped(self) -> bool:
        """Whether it is the gyro that the vehicle comes with."""
        return self.law is None and self.swash == self.tail == SHIPPED

    @cached_property
    def laws(self) -> tuple[OwnLaw, ...]:
        """The laws that aren't shipped."""
        return tuple(self._own_law(place, law) for place, law in self._own())

    def _own_law(self, place: Place, law: Law) -> OwnLaw:
        states = self.states
        if states is None:
            states = getattr(law, "states", None)
        reset = self.reset
        if reset is None and not inspect.isroutine(law) and not is_compiled(law):
            reset = getattr(law, "reset", None)
        if states is None:
            keeps = [one for one in (law, reset) if one is not None]
            keeps = any(is_native(one) or arity(one) > 1 for one in keeps)
            states = STATES[place] if keeps else 0
        if not isinstance(states, int) or not 0 <= states <= _MOST:
            raise InputError(f"controller {law_name(law)!r}: states is {states!r}, no whole number")
        assert isinstance(self.settings, np.ndarray)
        if isinstance(law, KnownLaw):  # it starts by itself
            return OwnLaw(law.native, place, states, self.settings, None, law_name(law))
        return OwnLaw(law, place, states, self.settings, reset, law_name(law))

    def plan_for(self, par: NDArray[np.float64], commands: Sequence[float]) -> None:
        """Let a plan's flight hold the servos that no law moves.

        Args:
            par: a vehicle's numbers, (n_param,), written.
            commands: of the four servos, unitised, (4,).
        """
        par[PARAM.planned] = float(self.law is None and None in (self.swash, self.tail))
        par[PARAM.planned_front : PARAM.planned_tail + 1] = commands

    @property
    def state_counts(self) -> tuple[int, int]:
        """Numbers of states of the swashplate's law and the tail's; of one for both, the first."""
        counts = {one.place: one.states for one in self.laws}
        if "all" in counts:
            return counts["all"], 0
        swash = counts.get("swash", SWASH_STATES if self.swash == SHIPPED else 0)
        return swash, counts.get("tail", TAIL_STATES if self.tail == SHIPPED else 0)

    @property
    def state_names(self) -> tuple[str, ...]:
        """The names of all its states, those of the shipped laws by what they are."""
        names: list[str] = []
        shipped = iter(
            (STATE._fields[FIRST_LAW_STATE:][:SWASH_STATES], STATE._fields[-TAIL_STATES:])
        )
        for count, slot, own in zip(self.state_counts, (self.swash, self.tail), shipped):
            is_own = self.law is not None or slot != SHIPPED
            names += [f"law_{len(names) + k}" for k in range(count)] if is_own else own
        return tuple(names)

    def to_dict(self) -> dict[str, Any]:
        """Return what a record says of it: name, laws with a digest of their source, settings."""
        assert isinstance(self.settings, np.ndarray)
        facts: dict[str, Any] = {"name": self.name}
        for place, slot in (("swash", self.swash), ("tail", self.tail)):
            if self.law is None and (slot is None or slot == SHIPPED):
                facts[place] = "shipped" if slot == SHIPPED else "none"
        for one, (_, law) in zip(self.laws, self._own()):
            reset = law.reset if isinstance(law, KnownLaw) else one.reset
            facts[one.place] = {
                "law": qualified_name(law),
                "states": one.states,
                "source_digest": source_digest(law, reset),
            }
        if self.written is not None:
            facts["written"] = self.written.to_dict()
        elif self.settings.size:
            facts["settings"] = self.settings.tolist()
        return facts

    def on(self, vehicle: Any) -> "Controller":
        """Return it as it flies on a vehicle: as it is, or its law as data on this one."""
        return self if self.written is None else self.written.on(vehicle)

    @contextmanager
    def flying(self, model: mujoco.MjModel, prefix: str = "") -> Iterator["Flying"]:
        """Put it into a model for one flight, with copies of its laws that are its own."""
        with ExitStack() as stack:
            registered = []
            for law in self.laws:
                one = Registered(law)
                stack.callback(one.release)
                registered.append(one)
            self._write(model, prefix, registered)
            yield Flying(str(self.name), registered)

    def put_into(self, model: mujoco.MjModel) -> None:
        """Put it into a vehicle's model, until this is gone; copies of the model don't keep it.

        Raises:
            ModelError: the model has too little room for its states.
            InputError: numba can't compile a law.
        """
        registered = [law.watched() for law in self.laws]
        for one in registered:
            weakref.finalize(model, one.release).atexit = False
        self._write(model, "", registered)

    def keep_in(self, model: mujoco.MjModel, prefix: str = "") -> None:
        """Put it into a model, and into what is copied from it, while the process lasts.

        Raises:
            ModelError: the model has too little room for its states.
            InputError: numba can't compile a law.
        """
        self._write(model, prefix, [law.lasting() for law in self.laws])

    def _write(self, model: mujoco.MjModel, prefix: str, registered: list[Registered]) -> None:
        where = addresses(model, prefix)
        par = model.actuator_user[where.rotor]
        room, needed = law_room(model, prefix), sum(self.state_counts)
        if needed > room:
            raise ModelError(
                f"controller {self.name!r} has {needed} states and the model has room for {room}: "
                f'give the rotor\'s actuator actdim="{WITHOUT_LAWS + 2 * needed}"'
            )
        handles = {one.law.place: one.handle for one in registered}
        for place, slot, index in (
            ("swash", self.swash, PARAM.swash_law),
            ("tail", self.tail, PARAM.tail_law),
        ):
            usual = SHIPPED_LAW if slot == SHIPPED else NO_LAW
            par[index] = handles.get("all", handles.get(place, usual))
        par[PARAM.law_token] = laws.token() if registered else 0.0
        par[PARAM.swash_states], par[PARAM.tail_states] = self.state_counts


class Flying:
    """A controller in one flight.

    Attributes:
        name: of the controller.
    """

    def __init__(self, name: str, registered: list[Registered]) -> None:
        self.name = name
        self._registered = registered

    def failure(self) -> Failure | None:
        """Return how one of its laws failed, None if none did."""
        failures = [one.failure() for one in self._registered]
        return next((one for one in failures if one is not None), None)


GYRO = Controller()
"""The gyro that every vehicle comes with."""
DIRECT = Controller(swash=None, tail=None)
"""None at all: the servos' commands are the caller's."""


ControllerLike = Controller | WrittenLaw | Law | None


def as_controller(given: ControllerLike, vehicle: Any = None) -> Controller:
    """Return a controller as it is, a law as the controller of all servos, None as none.

    given: a controller, a law, a law as data, or None; vehicle: that it flies.

    Raises:
        InputError: it is none of these, or a law as data without a vehicle.
    """
    if given is None:
        return DIRECT
    if isinstance(given, WrittenLaw) and not isinstance(given, type):
        if vehicle is not None:
            return given.on(vehicle)
        if not isinstance(given, Controller):
            raise InputError("a law as data flies a vehicle: give law.on(vehicle)")
    if isinstance(given, Controller):
        return given
    return Controller(given)


def set_controller(model: mujoco.MjModel, controller: ControllerLike, *, prefix: str = "") -> None:
    """Give a helicopter in a MuJoCo model another controller, for steps under `installed()`.

    It stays there, and in copies of the model, while this process lasts. `mj_resetData` starts it
    anew.

    Args:
        model: changed in place.
        controller: a law, a `Controller`, or None: then the servos' `ctrl` are the caller's.
        prefix: of the helicopter's names, where it was attached with one.

    Raises:
        UnknownNameError: there is no such helicopter.
        ModelError: the model has too little room for the law's states.
        InputError: it is no law, numba can't compile it, or there is no such model or prefix.
    """
    check_is_model(model)
    if not isinstance(prefix, str):
        raise InputError(f"prefix must be a text such as 'a/', got {prefix!r:.80}")
    as_controller(controller).keep_in(model, prefix)


def law_room(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return for how many states of control laws there is room in a model."""
    kept = int(model.actuator_actnum[addresses(model, prefix).rotor])
    return (kept - WITHOUT_LAWS) // 2


def source_digest(*functions: Any) -> str:
    """Return a digest of what functions or the classes of objects say, or of their bytecode."""
    digest = hashlib.blake2b(digest_size=16)
    for function in functions:
        if function is None:
            continue
        written = described(function)
        try:
            digest.update(inspect.getsource(written).encode())
        except (OSError, TypeError):
            code = getattr(written, "__code__", None)
            digest.update(code.co_code if code is not None else qualified_name(function).encode())
    return digest.hexdigest()


def described(function: Any) -> Any:
    """Return the function or class that a law is written as."""
    if isinstance(function, KnownLaw):
        return function.function
    if is_compiled(function):
        return function.py_func
    if is_native(function):
        return function._pyfunc
    if isinstance(function, partial):
        return described(function.func)
    return function if inspect.isroutine(function) else type(function)


def law_name(law: Any) -> str:
    """Return the name of a law's function or class, for messages."""
    return getattr(described(law), "__name__", repr(law))


def qualified_name(law: Any) -> str:
    """Return where a law is written, as module:name."""
    written = described(law)
    return f"{written.__module__}:{written.__qualname__}"


def check_law(law: Any, place: str) -> None:
    """Raise InputError if something can't be a law in its place, or a law's reset."""
    if is_native(law):
        if len(law._sig.args) != 4:
            raise InputError(
                "a numba.cfunc as a law has the signature void(double*, double*, double*, "
                f"double*), got {law._sig}"
            )
        return
    if not callable(law) or isinstance(law, type):
        what = "a controller" if place == "all" else f"{place} of a controller"
        other = {"swash": '"shipped"', "tail": '"shipped"'}.get(place, "a Controller")
        advice = f"; give an object of it, {law.__name__}(...)" if isinstance(law, type) else ""
        raise InputError(
            f"{what} must be a function of (seen, state, settings), an object that is called so, "
            f"{other} or None; got {law!r:.80}{advice}"
        )
    if arity(law) == 0 and place != "reset":
        raise InputError(
            f"controller {law_name(law)!r} takes nothing; it must take (seen), (seen, state) or "
            "(seen, state, settings)"
        )


def check_passes(law: Any, name: str) -> None:
    """Raise InputError if a law can't be found again by another process."""
    written = described(law)
    found = "<" not in getattr(written, "__qualname__", "") or is_compiled(law)
    if is_native(law) or not found:
        what = "a numba.cfunc" if is_native(law) else "defined inside a function"
        raise InputError(
            f"controller {name!r} can't pass to another process: it is {what}; take a function "
            "at the top of a module that both can import, plain or compiled by numba.njit"
        )
