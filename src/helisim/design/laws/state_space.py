"""A control law of any order as its sampled matrices, with limits and anti-windup.

    commands = C x + D seen,    x+ = A x + B seen + W (limited - commands)

where seen and commands count from the trim. With W the input matrix of an observer, the observer
sees what the servos got (K. Astrom and R. Murray, Feedback Systems, 2nd edition, 2021, ch. 11).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.linear import LinearSystem
from helisim.base.value import FrozenMap, Value
from helisim.design.laws.law import Law, check_names, register
from helisim.design.laws.state_space_kernel import COMPILED, state_space_settings
from helisim.physics.gyro import Seen
from helisim.records.channels import ACCELERATIONS, IN1

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

Matrix = NDArray[np.float64]
KNOWN = tuple(name for name in Seen._fields if name != "time")
"""What a law may see."""
LIMIT = 0.5
"""Of a command where nothing is said, unitised: the shipped gyro's."""
_MATRICES = ("a", "b", "c", "d", "windup", "start")
_MOST = 400
_FIELDS = ("name", "period", "inputs", "limits", *_MATRICES, "provenance")


@register
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class StateSpaceLaw(Law, Value):
    """A control law as sampled matrices; see the module for its equations. Read-only.

    Attributes:
        period: s, of the ticks that it is made for.
        inputs: what it sees, by the names of `Seen`; counted from the trim.
        a: (n_state, n_state).
        b: (n_state, n_in).
        c: (4, n_state), to col, lon, lat, ped, unitised, counted from the trim's.
        d: (4, n_in).
        windup: (n_state, 4), W: what the states learn of commands beyond their limits; none
            if empty.
        start: (n_state, 4): the state that it starts with over the commands that stand then,
            so that a restart moves no servo; none if empty.
        limits: of the whole commands col, lon, lat, ped, unitised.
        name: for messages and records.
        provenance: how it was made, plain data.

    Raises:
        InputError: shapes don't fit, something isn't finite, or no such thing is seen.
    """

    kind: ClassVar[str] = "state_space"
    period: float
    inputs: tuple[str, ...]
    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    windup: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    start: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    limits: tuple[float, ...] = (LIMIT,) * 4
    name: str = "state_space"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        inputs = _names(self.inputs)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "period", _positive("period", self.period))
        object.__setattr__(self, "limits", _limits(self.limits))
        if not isinstance(self.name, str) or not isinstance(self.provenance, Mapping):
            raise InputError("name must be a text, and provenance a table")
        object.__setattr__(self, "provenance", _frozen(self.provenance))
        n = _states(self.a)
        shapes = {
            "a": (n, n),
            "b": (n, len(inputs)),
            "c": (len(IN1), n),
            "d": (len(IN1), len(inputs)),
            "windup": (n, len(IN1)),
            "start": (n, len(IN1)),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, _matrix(name, getattr(self, name), shape))

    def __repr__(self) -> str:
        seen = ", ".join(self.inputs)
        return f"StateSpaceLaw({self.name!r}: {self.order} states, each {self.period:g} s: {seen})"

    @property
    def order(self) -> int:
        """How many states it has."""
        return len(self.a)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return a law of what stands in its file, kind and version left out.

        Raises:
            InputError: something is missing, unknown or of the wrong kind.
        """
        check_names("the law", content, _FIELDS)
        missing = [name for name in ("period", "inputs", "a", "b", "c", "d") if name not in content]
        if missing:
            raise InputError(f"a {cls.kind} law lacks {', '.join(missing)}")
        return cls(**content)

    def content(self) -> dict[str, Any]:
        """Return what stands in its file, kind and version left out."""
        plain: dict[str, Any] = {
            "name": self.name,
            "period": self.period,
            "inputs": list(self.inputs),
            "limits": list(self.limits),
        }
        plain |= {name: getattr(self, name).tolist() for name in ("a", "b", "c", "d")}
        for name in ("windup", "start"):
            if np.any(getattr(self, name)):
                plain[name] = getattr(self, name).tolist()
        return {**plain, **({"provenance": _plain(self.provenance)} if self.provenance else {})}

    def parameters(self) -> dict[str, float]:
        """Return none: its matrices belong together, and `lqg` makes them of its own numbers."""
        return {}

    def replace(self, changes: Mapping[str, float]) -> Self:
        """Return itself. Raises UnknownNameError: it has no parameters."""
        for name in changes:
            raise UnknownNameError("parameter of the law", name, self.parameters())
        return self

    def linear(self, period: float) -> LinearSystem:
        """Return what it does about a trim. Raises InputError at ticks that aren't its own."""
        self._check_period(period)
        matrices = self.a, self.b, self.c, self.d
        return LinearSystem(*matrices, self.period, self.inputs, IN1)

    def _check_period(self, period: float) -> None:
        if not math.isclose(period, self.period, rel_tol=1e-9):
            raise InputError(
                f"the law {self.name!r} is sampled each {1e3 * self.period:g} ms and can't tick "
                f"each {1e3 * period:g} ms: make it again for that period (gyro.period)"
            )

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle, about its trim.

        Raises:
            InputError: the vehicle's gyro ticks at another period.
        """
        from helisim.vehicle import Controller
        from helisim.vehicle.swashplate import SERVOS
        from helisim.vehicle.trim import collective_stick, steady_force

        self._check_period(vehicle.parameters["gyro.period"])
        trim, plate = vehicle.trim, vehicle.swashplate
        servos = (*plate.mix(trim.col, trim.lon, trim.lat), trim.ped)
        felt = steady_force(vehicle.model, trim).tolist()
        steady = dict.fromkeys(Seen._fields, 0.0) | {"phi": trim.phi, "theta": trim.theta}
        steady |= dict(zip((*ACCELERATIONS, *SERVOS, "tail"), (*felt, *servos)))
        steady["COL"] = collective_stick(vehicle.model, trim)
        settings = state_space_settings(
            [getattr(self, name) for name in _MATRICES],
            [Seen._fields.index(name) for name in self.inputs],
            [steady[name] for name in self.inputs],
            [trim.col, trim.lon, trim.lat, trim.ped],
            self.limits,
            plate.numbers,
        )
        return Controller(
            COMPILED,
            states=self.order,
            settings=settings,
            name=self.name,
            written=self,
        )


def _frozen(data: Any) -> Any:
    """Return plain data that can't be changed."""
    if isinstance(data, Mapping):
        return FrozenMap({str(key): _frozen(item) for key, item in data.items()})
    return tuple(map(_frozen, data)) if isinstance(data, list | tuple) else data


def _plain(data: Any) -> Any:
    """Return what `_frozen` made as plain data."""
    if isinstance(data, Mapping):
        return {key: _plain(item) for key, item in data.items()}
    return list(map(_plain, data)) if isinstance(data, tuple) else data


def _names(given: Any) -> tuple[str, ...]:
    if isinstance(given, str) or not all(isinstance(name, str) for name in given) or not given:
        raise InputError(f"inputs must be names of what is seen, got {given!r:.80}")
    for name in given:
        if name not in KNOWN:
            raise UnknownNameError("input of the law", name, KNOWN)
    if len(set(given)) < len(given):
        raise InputError(f"inputs name something twice: {', '.join(given)}")
    return tuple(given)


def _positive(name: str, value: Any) -> float:
    real = isinstance(value, int | float) and not isinstance(value, bool)
    if not (real and math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be a number above 0, got {value!r:.60}")
    return float(value)


def _limits(given: Any) -> tuple[float, ...]:
    if not isinstance(given, list | tuple) or len(given) != len(IN1):
        raise InputError(f"limits must be four numbers, of {', '.join(IN1)}; got {given!r:.60}")
    return tuple(_positive("a limit", one) for one in given)


def _states(a: Any) -> int:
    try:
        count = len(a)
    except TypeError:
        count = -1
    if not 0 <= count <= _MOST:
        raise InputError(f"a must be a square matrix of up to {_MOST} rows, got {a!r:.60}")
    return count


def _matrix(name: str, given: Any, shape: tuple[int, int]) -> Matrix:
    """Return a matrix read-only, one of no entries as zeros. Raises InputError."""
    try:
        matrix = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be rows of numbers, got {given!r:.60}") from None
    if matrix.size == 0 and (name in ("windup", "start") or 0 in shape):
        matrix = np.zeros(shape)
    if matrix.shape != shape:
        raise InputError(f"{name} must be {shape[0]} by {shape[1]}, got {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise InputError(f"{name} holds numbers that are not finite")
    matrix.flags.writeable = False
    return matrix
