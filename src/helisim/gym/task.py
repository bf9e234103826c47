"""Tasks of an agent: motions, commands, observations, rewards; `Hover` and `Track`."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import check, is_number, setting
from helisim.physics import motion as frames
from helisim.physics.kernel import fingerprint
from helisim.physics.layout import STATE
from helisim.vehicle.trim import addresses

Columns = NDArray[np.float64]


class Motions(NamedTuple):
    """The motions of n helicopters, all arrays with a column each. SI, field axes.

    Attributes:
        time: (n,) s since the start of the episode.
        position: (3, n) north, east, down of the body's origin, m.
        velocity: (3, n) the same axes, over the ground, m/s.
        body_velocity: (3, n) u, v, w over the ground, body axes, m/s.
        rates: (3, n) p, q, r, rad/s.
        attitude: (3, n) phi, theta, psi, rad; psi from -pi to pi.
        heading: (2, n) cosine and sine of psi.
        flapping: (2, n) rearward and right tilt of the tip-path plane, rad.
    """

    time: Columns
    position: Columns
    velocity: Columns
    body_velocity: Columns
    rates: Columns
    attitude: Columns
    heading: Columns
    flapping: Columns

    def level(self, vectors: Columns) -> Columns:
        """Return vectors in earth axes, (3, n), as ahead, right and below along the heading."""
        (cosine, sine), turned = self.heading, np.empty_like(vectors)
        turned[0] = cosine * vectors[0] + sine * vectors[1]
        turned[1] = cosine * vectors[1] - sine * vectors[0]
        turned[2] = vectors[2]
        return turned


_ROWS = np.cumsum([0, 1, 3, 3, 3, 3, 3, 2, 2]).tolist()
"""Where each of the arrays starts in the memory that they share."""


class StateReader:
    """Reads `Motions` from MuJoCo's full physics states of one vehicle's model."""

    def __init__(self, model: mujoco.MjModel) -> None:
        velocity = 1 + model.nq
        flapping = velocity + model.nv + addresses(model).state + STATE.flap_a
        self._fill = _compiled(velocity, flapping, fingerprint())

    def read(self, states: NDArray[np.float64]) -> Motions:
        """Return the motions of states, (n, n_state).

        Each is read alone, so that a helicopter's numbers are the same to the bit among others.
        """
        rows = np.empty((_ROWS[-1], len(states)))
        self._fill(states, rows)
        time, *others = (rows[first:last] for first, last in pairwise(_ROWS))
        return Motions(time[0], *others)


@cache
def _compiled(velocity: int, flapping: int, sources: int) -> Callable[[Columns, Columns], None]:
    """Return what reads states whose velocities and flapping start at these elements.

    `sources` is a fingerprint of what it calls: a cache on disk knows a function by it too.
    """
    try:
        return _compile(velocity, flapping, sources, cached=True)
    except RuntimeError as error:
        if "cache" not in str(error):
            raise
        return _compile(velocity, flapping, sources, cached=False)


def _compile(
    velocity: int, flapping: int, sources: int, *, cached: bool
) -> Callable[[Columns, Columns], None]:
    @njit("void(float64[:, ::1], float64[:, ::1])", cache=cached, error_model="numpy")
    def fill(states, rows):
        _ = sources
        for n in range(states.shape[0]):
            state = states[n]
            xmat = _rotation(state[4], state[5], state[6], state[7])
            x, y, z = state[velocity], state[velocity + 1], state[velocity + 2]
            rows[0, n] = state[0]
            rows[1, n], rows[2, n], rows[3, n] = frames.flip(state[1], state[2], state[3])
            rows[4, n], rows[5, n], rows[6, n] = frames.flip(x, y, z)
            rows[7, n], rows[8, n], rows[9, n] = frames.to_body(xmat, x, y, z)
            p, q, r = state[velocity + 3], state[velocity + 4], state[velocity + 5]
            rows[10, n], rows[11, n], rows[12, n] = frames.flip(p, q, r)
            rows[13, n], rows[14, n], rows[15, n] = frames.euler_angles(xmat)
            rows[16, n], rows[17, n] = np.cos(rows[15, n]), np.sin(rows[15, n])
            rows[18, n], rows[19, n] = state[flapping], state[flapping + 1]

    return fill


@njit
def _rotation(w, x, y, z):
    """Return MuJoCo's rotation from body to world, row-major, (9,), of a quaternion."""
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


BOUND = 10.0
"""Scaled observations are cut off at plus and minus this."""


class Observation(NamedTuple):
    """One number that an agent sees: value / scale, cut off at +-`BOUND`.

    Attributes:
        name: of the number.
        unit: of its value.
        scale: what counts as 1, in that unit.
        meaning: in words.
    """

    name: str
    unit: str
    scale: float
    meaning: str


class Situation(NamedTuple):
    """What a task judges, n helicopters at one instant.

    Attributes:
        motions: where they are and how they move.
        commands: (4, n), what each is asked for at the moment.
        actions: (4, n), the last, from -1 to 1.
        before: (4, n), those before the last.
    """

    motions: Motions
    commands: Columns
    actions: Columns
    before: Columns


_OWN_MOTION = (
    Observation("heading_error_sine", "1", 1.0, "sine of commanded less present heading"),
    Observation("heading_error_cosine", "1", 1.0, "its cosine"),
    Observation("u", "m/s", 1.0, "velocity over the ground, forward, body axes"),
    Observation("v", "m/s", 1.0, "to the right"),
    Observation("w", "m/s", 1.0, "down"),
    Observation("phi", "rad", 0.2, "roll angle"),
    Observation("theta", "rad", 0.2, "pitch angle"),
    Observation("p", "rad/s", 2.0, "roll rate"),
    Observation("q", "rad/s", 2.0, "pitch rate"),
    Observation("r", "rad/s", 2.0, "yaw rate"),
    *(Observation(f"action_{k}", "1", 1.0, f"the last action's number {k}") for k in range(4)),
)


class Task(ABC):
    """What an agent is asked to do. Derive from it for a task of your own.

    Everything is computed for all helicopters at once: arrays have a column each. Compute element
    by element, without matrix products or sums along the columns, and a helicopter alone and one
    among others see the same bits.

    Attributes:
        observations: what an agent sees, in order.
        commands: name and unit of each of the four numbers of a command.
        interval: s for which a command holds; None for the whole episode.
    """

    observations: ClassVar[tuple[Observation, ...]]
    commands: ClassVar[tuple[tuple[str, str], ...]]
    interval: float | None = None

    @abstractmethod
    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return four numbers that a helicopter is asked for.

        Args:
            random: of this helicopter.
            height: m above the ground, at which it starts.
        """

    @abstractmethod
    def observe(self, situation: Situation) -> Columns:
        """Return what is seen, in the units of `observations`, (n_observation, n)."""

    @abstractmethod
    def reward(self, situation: Situation, seen: Columns) -> Columns:
        """Return the reward of the last step, (n,), of what `observe` returned."""

    def lost(self, situation: Situation, seen: Columns) -> NDArray[np.bool_]:
        """Return which helicopters are too far from what is asked to go on, (n,).

        Args:
            situation: of n helicopters.
            seen: (n_observation, n) of `observe`.
        """
        del seen
        return np.zeros_like(situation.motions.time, dtype=np.bool_)


def check_task(task: Task) -> None:
    """Raise InputError unless a task says what is seen, and its settings are numbers above 0."""
    kind, observations = type(task).__name__, getattr(task, "observations", ())
    if not observations or not all(isinstance(one, Observation) for one in observations):
        raise InputError(
            f"{kind} needs observations, a tuple of Observation(name, unit, scale, ...)"
        )
    for one in observations:
        if not (is_number(one.scale) and 0.0 < one.scale < math.inf):
            raise InputError(f"{kind}: the scale of {one.name} must be above 0, got {one.scale!r}")


@dataclass(frozen=True, kw_only=True)
class Hover(Task):
    """Hover at one place and heading.

    The reward of a step is 1 / (1 + J), from 0 to 1, where J is the sum of the squares of the
    distance, speed, heading error (as 2 sin of its half), body rates and change of the action,
    each over what counts as 1 here. All five lengths are of vectors.

    Attributes:
        distance: m.
        speed: m/s.
        heading: rad.
        rate: rad/s.
        change: of the action between two steps.
        limit: m from the place, beyond which an episode is terminated.
    """

    distance: float = setting(1.0, above=0.0)
    speed: float = setting(2.0, above=0.0)
    heading: float = setting(0.5, above=0.0)
    rate: float = setting(2.0, above=0.0)
    change: float = setting(2.0, above=0.0)
    limit: float = setting(10.0, above=0.0)

    commands: ClassVar = (("north", "m"), ("east", "m"), ("down", "m"), ("heading", "rad"))
    observations: ClassVar = (
        Observation("ahead", "m", 1.0, "where the place is, along the heading"),
        Observation("right", "m", 1.0, "to the right of it"),
        Observation("below", "m", 1.0, "below the helicopter"),
        *_OWN_MOTION,
    )

    def __post_init__(self) -> None:
        check(self)

    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return the place above the origin at the height of the start, heading north."""
        del random
        return 0.0, 0.0, -height, 0.0

    def observe(self, situation: Situation) -> Columns:
        """Return where the place is, and the own motion."""
        motions = situation.motions
        return _seen(situation, motions.level(situation.commands[:3] - motions.position))

    def reward(self, situation: Situation, seen: Columns) -> Columns:
        """Return 1 / (1 + J)."""
        missed = _square(seen[:3]) / self.distance**2
        missed += _square(seen[5:8]) / self.speed**2
        return _reward(self, missed, situation, seen)

    def lost(self, situation: Situation, seen: Columns) -> NDArray[np.bool_]:
        """Return which are farther from the place than `limit`, (n,) of (n_observation, n)."""
        return _square(seen[:3]) > self.limit**2


@dataclass(frozen=True, kw_only=True)
class Track(Task):
    """Fly at commanded velocities and headings, which change every few seconds.

    The reward is that of `Hover`, with the error of the velocity in place of distance and speed.

    Attributes:
        interval: s for which a command holds.
        fastest: m/s, of the commands towards north, and east.
        climb: m/s, of the commands up and down.
        speed: m/s, an error of the velocity that counts as 1.
        heading: rad.
        rate: rad/s.
        change: of the action between two steps.
    """

    interval: float | None = setting(4.0, unit="s", above=0.0)
    fastest: float = setting(3.0, above=0.0)
    climb: float = setting(0.5, above=0.0)
    speed: float = setting(1.0, above=0.0)
    heading: float = setting(0.5, above=0.0)
    rate: float = setting(2.0, above=0.0)
    change: float = setting(2.0, above=0.0)

    commands: ClassVar = (("north", "m/s"), ("east", "m/s"), ("down", "m/s"), ("heading", "rad"))
    observations: ClassVar = (
        Observation("ahead", "m/s", 1.0, "commanded less present velocity, along the heading"),
        Observation("right", "m/s", 1.0, "to the right of it"),
        Observation("below", "m/s", 1.0, "downwards"),
        *_OWN_MOTION,
    )

    def __post_init__(self) -> None:
        check(self)

    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return a velocity north, east, down and a heading, each as likely within its range."""
        del height
        reach = (self.fastest, self.fastest, self.climb, math.pi)
        return tuple(share * most for share, most in zip(random.uniform(-1.0, 1.0, 4), reach))

    def observe(self, situation: Situation) -> Columns:
        """Return the velocity that is missing, and the own motion."""
        motions = situation.motions
        return _seen(situation, motions.level(situation.commands[:3] - motions.velocity))

    def reward(self, situation: Situation, seen: Columns) -> Columns:
        """Return 1 / (1 + J)."""
        return _reward(self, _square(seen[:3]) / self.speed**2, situation, seen)


def _seen(situation: Situation, wanted: Columns) -> Columns:
    motions = situation.motions
    seen = np.empty((17, wanted.shape[1]))
    seen[:3] = wanted
    asked, (cosine, sine) = situation.commands[3], motions.heading
    there, aside = np.cos(asked), np.sin(asked)
    seen[3] = aside * cosine - there * sine
    seen[4] = there * cosine + aside * sine
    seen[5:8] = motions.body_velocity
    seen[8:10] = motions.attitude[:2]
    seen[10:13] = motions.rates
    seen[13:] = situation.actions
    return seen


def _reward(task: Hover | Track, missed: Columns, situation: Situation, seen: Columns) -> Columns:
    missed = missed + 2.0 * (1.0 - seen[4]) / task.heading**2
    missed += _square(seen[10:13]) / task.rate**2
    change = situation.actions - situation.before
    missed += (_square(change[:3]) + change[3] * change[3]) / task.change**2
    return 1.0 / (1.0 + missed)


def _square(vectors: Columns) -> Columns:
    """Return the squared length of (3, n) vectors, (n,), always summed in the same order."""
    squares = vectors * vectors
    return squares[0] + squares[1] + squares[2]
