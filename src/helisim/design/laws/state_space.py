"""A control law of any order as its sampled matrices, with limits and anti-windup.

    commands = C x + D seen,    x+ = A x + B seen + W (limited - commands)

Seen and commands count from the trim. W: K. Astrom and R. Murray, Feedback Systems, 2nd edition,
2021, ch. 11.
"""

import math
from collections import namedtuple
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import Value, setting
from helisim.design.laws.attitude_kernel import PLATE_NUMBERS
from helisim.design.laws.law import LIMIT, Law, register
from helisim.physics.gyro import Seen, mix, unmix
from helisim.physics.kernel import kernel, known
from helisim.physics.laws import KnownLaw
from helisim.physics.pilot import wrap_to_pi
from helisim.records.record import ACCELERATIONS, IN1

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

Matrix = NDArray[np.float64]
KNOWN = tuple(name for name in Seen._fields if name != "time")  # inputs that a law may have
_MATRICES = ("a", "b", "c", "d", "windup", "start")


@register
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class StateSpaceLaw(Law, Value):
    """A control law as sampled matrices; see the module for its equations. Read-only.

    a, b, c, d are (n_state, n_state), (n_state, n_in), (4, n_state), (4, n_in), at a `period`, s;
    `windup`, W, and `start`, the first state over the commands that stand then, are (n_state, 4) or
    empty; `inputs` are names of `Seen`; `limits` are of the whole col, lon, lat, ped, unitised.

    Raises InputError if shapes don't fit, something isn't finite, or an input is unknown.
    """

    kind: ClassVar[str] = "state_space"
    not_tuned: ClassVar[tuple[str, ...]] = ("period",)
    period: float = setting(above=0.0)
    inputs: tuple[str, ...] = setting(choices=KNOWN)
    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    windup: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    start: Matrix = field(default_factory=lambda: np.zeros((0, 4)))
    limits: tuple[float, float, float, float] = setting((LIMIT,) * 4, above=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        inputs, n = self.inputs, len(np.atleast_1d(self.a))
        if not inputs or len(set(inputs)) < len(inputs):
            names = ", ".join(inputs) or "none"
            raise InputError(f"inputs must be names of what is seen, none twice; got {names}")
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
        seen, order = ", ".join(self.inputs), len(self.a)
        return f"StateSpaceLaw({self.name!r}: {order} states, each {self.period:g} s: {seen})"

    def linear(self, period: float) -> LinearSystem:
        """Return the law about a trim. Raises InputError at ticks that aren't its own."""
        self._check_period(period)
        return LinearSystem(self.a, self.b, self.c, self.d, self.period, self.inputs, IN1)

    def _check_period(self, period: float) -> None:
        if not math.isclose(period, self.period, rel_tol=1e-9):
            raise InputError(
                f"the law {self.name!r} is sampled each {1e3 * self.period:g} ms and can't tick "
                f"each {1e3 * period:g} ms: make it again for that period (gyro.period)"
            )

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it; InputError if the vehicle's gyro ticks otherwise."""
        from helisim.vehicle.swashplate import SERVOS
        from helisim.vehicle.trim import collective_stick, steady_force

        self._check_period(vehicle.parameters["gyro.period"])
        trim, plate = vehicle.trim, vehicle.swashplate
        servos = (*plate.mix(trim.col, trim.lon, trim.lat), trim.ped)
        felt = steady_force(vehicle.model, trim).tolist()
        steady = dict.fromkeys(Seen._fields, 0.0) | {"phi": trim.phi, "theta": trim.theta}
        steady |= dict(zip((*ACCELERATIONS, *SERVOS, "tail"), (*felt, *servos)))
        steady["COL"] = collective_stick(vehicle.model, trim)
        matrices = [getattr(self, name) for name in _MATRICES]
        settings = np.concatenate(
            [
                [len(self.a), len(self.inputs)],
                [trim.col, trim.lon, trim.lat, trim.ped],
                self.limits,
                plate.numbers,
                [Seen._fields.index(name) for name in self.inputs],
                [steady[name] for name in self.inputs],
                *(one.ravel() for one in matrices),
            ],
            dtype=np.float64,
        )
        return self._flown(COMPILED, len(self.a), settings)


Layout = namedtuple("Layout", "states inputs trim limit plate rest")
"""Addresses in the settings before the matrices: counts, trim, limits, plate."""
known(Layout)

LAYOUT = Layout(0, 1, 2, 6, 10, 10 + PLATE_NUMBERS)
_HEADING = 6  # place of psi in `Seen`


@kernel()
def sensed(seen, settings, k):
    """Return the k-th input, from the trim's."""
    count = int(settings[LAYOUT.inputs])
    place = int(settings[LAYOUT.rest + k])
    off = seen[place] - settings[LAYOUT.rest + count + k]
    return wrap_to_pi(off) if place == _HEADING else off


@kernel()
def row_times(settings, first, count, values):
    """Return the sum of a matrix's row, from address `first`, times values."""
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
