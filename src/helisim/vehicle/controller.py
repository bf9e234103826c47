"""Controllers: which law moves which servos, at the gyro's place and rate."""

import hashlib
import inspect
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.errors import InputError, ModelError
from helisim.base.settings import Value, convert
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
    NO_LAW,
    PARAM,
    SHIPPED_LAW,
    SWASH_STATES,
    TAIL_STATES,
    WITHOUT_LAWS,
)
from helisim.physics.memory import check_is_model
from helisim.vehicle.addresses import addresses, write_named

Law = Callable[..., Any]  # law(seen, state, settings)
Slot = Law | Literal["shipped"] | None

_STATES = {"all": SWASH_STATES + TAIL_STATES, "swash": SWASH_STATES, "tail": TAIL_STATES}
_MOST = 1000
SHIPPED = "shipped"


class WrittenLaw(Protocol):
    """A control law as data, which makes a controller for a vehicle; `helisim.design` has them."""

    def on(self, vehicle: Any) -> "Controller":
        """Return the controller that flies it on a `Vehicle`, about its trim."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Controller(Value):
    """A controller: it turns sticks and sensors into servo commands, at the gyro's place and rate.

    At each tick a law gets `Seen`, its state, its settings (or the first one or two) and returns
    unitised servo commands. A callable object is copied for each flight; InputError if it is no
    law.

    Attributes:
        law: returns the commands of front, left, right and tail; None where the next two do.
        swash: returns the first three; "shipped" is the gyro's own law, None leaves them alone.
        tail: returns the command of the tail servo, one number; "shipped" and None likewise.
        states: how many numbers a law keeps from tick to tick. None takes the law's own `states`;
            without those, a law that takes a state has 8, of `swash` 6, of `tail` 2.
        settings: numbers that the laws are given, (n_settings,), read only.
        reset: called like a law before its first tick, to set its state; None takes the law's own
            `reset`.
        name: None takes the law's own name.
        written: the law as data that this flies on one vehicle, about one trim, or None.
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
        own = self._own()
        for law in (*own.values(), *filter(None, [self.reset])):
            _check_law(law)
        settings = convert(NDArray[np.float64], self.settings, "settings")
        if settings.ndim != 1:
            raise InputError(f"settings must be a list of finite numbers, got {settings}")
        object.__setattr__(self, "settings", settings)
        for count in (self.states, *(getattr(law, "states", None) for law in own.values())):
            if count is not None and not (isinstance(count, int) and 0 <= count <= _MOST):
                raise InputError(f"states must be an integer from 0 to {_MOST}, got {count!r}")
        if self.name is None:
            none = SHIPPED if self.is_shipped else "none"
            name = " and ".join(_described(law).__name__ for law in own.values())
            object.__setattr__(self, "name", name or none)

    def __repr__(self) -> str:
        return f"Controller({self.name!r})"

    def __hash__(self) -> int:
        return hash((self.name, self.state_counts))

    def __deepcopy__(self, memo: dict[int, Any]) -> "Controller":
        """Return it as it is: each flight copies the law's object by itself."""
        return self

    def _own(self) -> dict[Place, Law]:
        given: dict[Place, Slot] = {"all": self.law, "swash": self.swash, "tail": self.tail}
        return {place: law for place, law in given.items() if law is not None and law != SHIPPED}

    @property
    def is_shipped(self) -> bool:
        """Whether it is the gyro that the vehicle comes with."""
        return self.law is None and self.swash == self.tail == SHIPPED

    @cached_property
    def laws(self) -> tuple[OwnLaw, ...]:
        """The laws that aren't shipped."""
        return tuple(self._own_law(place, law) for place, law in self._own().items())

    def _own_law(self, place: Place, law: Law) -> OwnLaw:
        states, reset, function = self.states, self.reset, law
        if states is None:
            states = getattr(law, "states", None)
        if reset is None and not inspect.isroutine(law) and not is_compiled(law):
            reset = getattr(law, "reset", None)
        if states is None:
            keeps = any(arity(one, least=0) > 1 for one in (law, reset) if one is not None)
            states = _STATES[place] if keeps else 0
        if isinstance(law, KnownLaw):  # it starts by itself
            function, reset = law.native, None
        settings = np.asarray(self.settings)
        return OwnLaw(function, place, states, settings, reset, _described(law).__name__)

    def plan_for(self, par: NDArray[np.float64], commands: Sequence[float]) -> None:
        """Let a plan hold servos that no law moves; par: (n_param,), written; commands: (4,)."""
        planned = self.law is None and None in (self.swash, self.tail)
        write_named(par, planned=(float(planned), *commands))

    @property
    def state_counts(self) -> tuple[int, int]:
        """Numbers of states of the swashplate's law and the tail's; of one for both, the first."""
        counts = {one.place: one.states for one in self.laws}
        if "all" in counts:
            return counts["all"], 0
        swash = counts.get("swash", SWASH_STATES if self.swash == SHIPPED else 0)
        return swash, counts.get("tail", TAIL_STATES if self.tail == SHIPPED else 0)

    def to_dict(self) -> dict[str, Any]:
        """Return what a record says of it: name, laws with a digest of their source, settings."""
        facts: dict[str, Any] = {"name": self.name}
        for place, slot in (("swash", self.swash), ("tail", self.tail)):
            if self.law is None and (slot is None or slot == SHIPPED):
                facts[place] = SHIPPED if slot == SHIPPED else "none"
        for one, law in zip(self.laws, self._own().values()):
            written = _described(law)
            facts[one.place] = {
                "law": f"{written.__module__}:{written.__qualname__}",
                "states": one.states,
                "source_digest": _source_digest(law, one.reset or getattr(law, "reset", None)),
            }
        settings = np.asarray(self.settings)
        if self.written is not None:
            facts["written"] = self.written.to_dict()
        elif settings.size:
            facts["settings"] = settings.tolist()
        return facts

    def on(self, vehicle: Any) -> "Controller":
        """Return it as it flies on a vehicle: as it is, or its law as data on this one."""
        return self if self.written is None else self.written.on(vehicle)

    @contextmanager
    def flying(self, model: mujoco.MjModel) -> Iterator[Callable[[], Failure | None]]:
        """Put it into a model for one flight, with copies of its laws that are its own.

        The block is given a function, which returns how one of the laws failed, or None.
        """
        with ExitStack() as stack:
            registered = []
            for law in self.laws:
                registered.append(Registered(law))
                stack.callback(registered[-1].release)
            self._write(model, "", registered)
            yield lambda: next(filter(None, [one.failure() for one in registered]), None)

    def put_into(self, model: mujoco.MjModel) -> None:
        """Put it into a vehicle's model while it exists; raises ModelError (room) or InputError."""
        registered = [Registered(law, watched=True) for law in self.laws]
        for one in registered:
            weakref.finalize(model, one.release).atexit = False
        self._write(model, "", registered)

    def _write(self, model: mujoco.MjModel, prefix: str, registered: list[Registered]) -> None:
        par = model.actuator_user[addresses(model, prefix).rotor]
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
        write_named(
            par,
            law_token=laws.token() if registered else 0.0,
            swash_states=self.state_counts,
        )


GYRO = Controller()  # the gyro that every vehicle comes with
DIRECT = Controller(swash=None, tail=None)  # none at all: the servos' commands are the caller's

ControllerLike = Controller | WrittenLaw | Law | None
_kept: list[Registered] = []  # laws kept while the process lasts


def as_controller(given: Any, vehicle: Any = None) -> Controller:
    """Return a `Controller` as it is, or of a law, a law as data (with a vehicle) or None."""
    if given is None:
        return DIRECT
    if isinstance(given, type) or not hasattr(given, "on"):
        return Controller(given)
    if vehicle is not None:
        return given.on(vehicle)
    if not isinstance(given, Controller):
        raise InputError("a law as data flies a vehicle: give law.on(vehicle)")
    return given


def set_controller(model: mujoco.MjModel, controller: ControllerLike, *, prefix: str = "") -> None:
    """Give a helicopter in a MuJoCo model another controller, for steps under `installed()`.

    It stays there, and in copies of the model, while this process lasts. With None nothing commands
    the servos: their `ctrl` are the caller's. `prefix` names one helicopter of several in a scene.
    Raises UnknownNameError (no such prefix), ModelError (too little room for states) or InputError
    (no law).
    """
    check_is_model(model)
    if not isinstance(prefix, str):
        raise InputError(f"prefix must be a text such as 'a/', got {prefix!r:.80}")
    chosen = as_controller(controller)
    registered = [Registered(law, watched=True) for law in chosen.laws]
    _kept.extend(registered)
    chosen._write(model, prefix, registered)


def law_room(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return for how many states of control laws there is room in a model."""
    return (int(model.actuator_actnum[addresses(model, prefix).rotor]) - WITHOUT_LAWS) // 2


def _source_digest(*functions: Any) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for written in (_described(one) for one in functions if one is not None):
        try:
            digest.update(inspect.getsource(written).encode())
        except (OSError, TypeError):  # typed in, no file has it
            digest.update(repr(written.__qualname__).encode())
    return digest.hexdigest()


def _described(function: Any) -> Any:
    function = function.function if isinstance(function, KnownLaw) else function
    function = function.py_func if is_compiled(function) else function
    return function if inspect.isroutine(function) else type(function)


def _check_law(law: Any) -> None:
    if is_native(law) or not callable(law) or isinstance(law, type):
        raise InputError(
            "a controller has functions of (seen, state, settings), of Python or compiled by "
            f'numba.njit, objects that are called so, "shipped" or None; got {law!r:.80}'
        )
    arity(law)
