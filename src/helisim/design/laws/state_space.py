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
        matrices = [getattr(self, name).ravel() for name in _MATRICES]
        before = LAYOUT.rest + 2 * len(self.inputs)
        settings = np.concatenate(
            [
                [len(self.a), len(self.inputs)],
                before + np.cumsum([0, *(one.size for one in matrices[:-1])]),
                [trim.col, trim.lon, trim.lat, trim.ped],
                self.limits,
                plate.numbers,
                [Seen._fields.index(name) for name in self.inputs],
                [steady[name] for name in self.inputs],
                *matrices,
            ],
            dtype=np.float64,
        )
        return self._flown(COMPILED, len(self.a), settings)


Layout = namedtuple("Layout", "states inputs a b c d windup start trim limit plate rest")
"""Addresses in the settings: counts, where matrices begin, trim, limits, plate, inputs."""
known(Layout)

LAYOUT = Layout(0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 16 + PLATE_NUMBERS)
_HEADING = 6  # place of psi in `Seen`


@register_jitable(error_model="numpy")  # no `kernel`: it keeps an array of its own
def sensed(seen, settings):
    """Return the inputs from the trim's, (n_in,)."""
    count = int(settings[LAYOUT.inputs])
    inputs = np.empty(count)
    for k in range(count):
        place = int(settings[LAYOUT.rest + k])
        off = seen[place] - settings[LAYOUT.rest + count + k]
        inputs[k] = wrap_to_pi(off) if place == _HEADING else off
    return inputs


@kernel()
def row_times(settings, matrix, row, values):
    """Return the sum of a matrix's row times values; `matrix` is where its address stands."""
    first, total = int(settings[matrix]) + row * len(values), 0.0
    for k in range(len(values)):
        total += settings[first + k] * values[k]
    return total


@register_jitable(error_model="numpy")
def state_space_law(seen, state, settings):
    """Return the commands of the front, left, right and tail servo."""
    n, inputs = int(settings[LAYOUT.states]), sensed(seen, settings)
    before, given, over = np.empty(n), np.empty(4), np.empty(4)
    for k in range(n):
        before[k] = state[k]
    for k in range(4):
        moved = row_times(settings, LAYOUT.c, k, before)
        command = settings[LAYOUT.trim + k] + moved + row_times(settings, LAYOUT.d, k, inputs)
        limit = settings[LAYOUT.limit + k]
        given[k] = min(limit, max(-limit, command))
        over[k] = given[k] - command
    for k in range(n):
        moved = row_times(settings, LAYOUT.a, k, before) + row_times(settings, LAYOUT.b, k, inputs)
        state[k] = moved + row_times(settings, LAYOUT.windup, k, over)
    front, left, right = mix(settings, given[0], given[1], given[2], LAYOUT.plate)
    return front, left, right, given[3]


@register_jitable(error_model="numpy")
def start_state(seen, state, settings):
    """Begin with the state that commands what stands, as far as the law has states for it."""
    inputs = sensed(seen, settings)
    col, lon, lat = unmix(settings, seen.front, seen.left, seen.right, LAYOUT.plate)
    missing = np.array([col, lon, lat, seen.tail])
    for k in range(4):
        direct = row_times(settings, LAYOUT.d, k, inputs)
        missing[k] = missing[k] - settings[LAYOUT.trim + k] - direct
    for k in range(int(settings[LAYOUT.states])):
        state[k] = row_times(settings, LAYOUT.start, k, missing)


COMPILED = KnownLaw(state_space_law, start_state)
