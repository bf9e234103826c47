"""A control law of any order as its sampled matrices, with limits and anti-windup.

    commands = C x + D seen,    x+ = A x + B seen + W (limited - commands)

where seen and commands count from the trim. With W the input matrix of an observer, the observer
sees what the servos got (K. Astrom and R. Murray, Feedback Systems, 2nd edition, 2021, ch. 11).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.linear import LinearSystem
from helisim.base.settings import FrozenMap, Value, check, from_plain, setting, to_plain
from helisim.design.laws.law import LIMIT, Law, named, register
from helisim.physics.gyro import Seen, mix, unmix
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.pilot import wrap_to_pi
from helisim.records.record import ACCELERATIONS, IN1

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

Matrix = NDArray[np.float64]
KNOWN = tuple(name for name in Seen._fields if name != "time")
"""What a law may see."""
_MATRICES = ("a", "b", "c", "d", "windup", "start")
_MOST = 400


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
    period: float = setting(above=0.0)
    inputs: tuple[str, ...] = setting(choices=KNOWN)
    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    windup: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    start: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    limits: tuple[float, float, float, float] = setting((LIMIT,) * 4, above=0.0)
    name: str = "state_space"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check(self, self.kind)
        object.__setattr__(self, "provenance", _frozen(self.provenance))
        inputs, n = self.inputs, len(self.a) if self.a.ndim else _MOST + 1
        if not inputs or len(set(inputs)) < len(inputs):
            names = ", ".join(inputs) or "none"
            raise InputError(f"inputs must be names of what is seen, none twice; got {names}")
        if n > _MOST:
            raise InputError(f"a must be a square matrix of up to {_MOST} rows, got {n}")
        shapes = [(n, n), (n, len(inputs)), (4, n), (4, len(inputs)), (n, 4), (n, 4)]
        for name, shape in zip(_MATRICES, shapes):
            matrix = getattr(self, name)
            if matrix.size == 0 and (name in ("windup", "start") or 0 in shape):
                matrix = np.zeros(shape)
                matrix.flags.writeable = False
                object.__setattr__(self, name, matrix)
            if matrix.shape != shape:
                raise InputError(f"{name} must be {shape[0]} by {shape[1]}, got {matrix.shape}")

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
        named(cls, content)
        return from_plain(cls, content, cls.kind)

    def content(self) -> dict[str, Any]:
        """Return what stands in its file, kind and version left out."""
        plain = to_plain(self)
        names = ["name", "period", "inputs", "limits", "a", "b", "c", "d"]
        names += [name for name in ("windup", "start") if np.any(getattr(self, name))]
        names += ["provenance"] if self.provenance else []
        return {name: plain[name] for name in names}

    def parameters(self) -> dict[str, float]:
        """Return none: its matrices belong together, and `lqg` makes them of its own numbers."""
        return {}

    def replace(self, changes: Mapping[str, float]) -> Self:
        """Return itself. Raises UnknownNameError: it has no parameters."""
        for name in changes:
            raise UnknownNameError("parameter of the law", name, ())
        return self

    def linear(self, period: float) -> LinearSystem:
        """Return what it does about a trim. Raises InputError at ticks that aren't its own."""
        self._check_period(period)
        return LinearSystem(self.a, self.b, self.c, self.d, self.period, self.inputs, IN1)

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
            COMPILED, states=self.order, settings=settings, name=self.name, written=self
        )


def _frozen(data: Any) -> Any:
    """Return plain data that can't be changed."""
    if isinstance(data, Mapping):
        return FrozenMap({str(key): _frozen(item) for key, item in data.items()})
    return tuple(map(_frozen, data)) if isinstance(data, list | tuple) else data


_COMMANDS = 4
_PLATE = 21


@known
class Layout(NamedTuple):
    """Where the numbers stand in the settings before the matrices: counts, trim, limits, plate."""

    states: int
    inputs: int
    trim: int
    limit: int
    plate: int
    rest: int


LAYOUT = Layout(0, 1, 2, 2 + _COMMANDS, 2 + 2 * _COMMANDS, 2 + 2 * _COMMANDS + _PLATE)
_HEADING = 6
"""Place of psi in `Seen`."""


def state_space_settings(
    matrices: Sequence[NDArray[np.float64]],
    places: Sequence[int],
    steady: Sequence[float],
    trim: Sequence[float],
    limits: Sequence[float],
    plate: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the settings of the compiled law, (n_settings,); arguments are as of the law, each."""
    counts = [len(matrices[0]), len(places)]
    return np.concatenate(
        [counts, trim, limits, plate, places, steady, *(one.ravel() for one in matrices)],
        dtype=np.float64,
    )


@kernel()
def sensed(seen, settings, k):
    """Return the k-th input, from the trim's."""
    count = int(settings[LAYOUT.inputs])
    place = int(settings[LAYOUT.rest + k])
    off = seen[place] - settings[LAYOUT.rest + count + k]
    return wrap_to_pi(off) if place == _HEADING else off


@kernel()
def row_times(settings, first, count, values):
    """Return the sum of a matrix's row, which begins somewhere in the settings, times values."""
    total = 0.0
    for k in range(count):
        total += settings[first + k] * values[k]
    return total


@register_jitable(error_model="numpy")  # no `kernel`: it keeps arrays of its own
def state_space_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    n, count = int(settings[LAYOUT.states]), int(settings[LAYOUT.inputs])
    inputs, before = np.empty(count), np.empty(n)
    for k in range(count):
        inputs[k] = sensed(seen, settings, k)
    for k in range(n):
        before[k] = state[k]
    a = LAYOUT.rest + 2 * count
    b = a + n * n
    c = b + n * count
    d = c + 4 * n
    windup = d + 4 * count
    given, over = np.empty(4), np.empty(4)
    for k in range(4):
        command = settings[LAYOUT.trim + k]
        command += row_times(settings, c + k * n, n, before)
        command += row_times(settings, d + k * count, count, inputs)
        limit = settings[LAYOUT.limit + k]
        given[k] = min(limit, max(-limit, command))
        over[k] = given[k] - command
    for k in range(n):
        moved = row_times(settings, a + k * n, n, before)
        moved += row_times(settings, b + k * count, count, inputs)
        state[k] = moved + row_times(settings, windup + 4 * k, 4, over)
    front, left, right = mix(settings, given[0], given[1], given[2], LAYOUT.plate)
    return front, left, right, given[3]


@register_jitable(error_model="numpy")
def start_state(seen, state, settings):
    """Begin with the state that commands what stands, as far as the law has states for it."""
    n, count = int(settings[LAYOUT.states]), int(settings[LAYOUT.inputs])
    inputs, missing = np.empty(count), np.empty(4)
    for k in range(count):
        inputs[k] = sensed(seen, settings, k)
    d = LAYOUT.rest + 2 * count + n * n + n * count + 4 * n
    start = d + 4 * count + 4 * n
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, LAYOUT.plate)
    missing[0], missing[1], missing[2], missing[3] = col, lon, lat, seen.tail
    for k in range(4):
        missing[k] -= settings[LAYOUT.trim + k]
        missing[k] -= row_times(settings, d + k * count, count, inputs)
    for k in range(n):
        state[k] = row_times(settings, start + 4 * k, 4, missing)


COMPILED = KnownLaw(state_space_law, start_state)
