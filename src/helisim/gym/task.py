"""Tasks of an agent: motions, commands, observations, rewards; `Hover` and `Track`."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import ClassVar, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import Checked, is_number, setting
from helisim.physics import motion as frames
from helisim.physics.kernel import compiled_or_cached, fingerprint

Columns = NDArray[np.float64]


class Motions(NamedTuple):
    """The motions of n helicopters, all arrays with a column each; SI, field axes.

    Velocities are over the ground: `velocity`, (3, n), north, east, down like `position`,
    `body_velocity`, (3, n), u, v, w. `rates`, (3, n), are p, q, r, `attitude`, (3, n), phi, theta,
    psi (-pi to pi), `heading`, (2, n), cosine and sine of psi, `flapping`, (2, n), rearward and
    right tilt of the tip-path plane, rad; `time` is (n,).
    """

    time: Columns
    position: Columns
    velocity: Columns
    body_velocity: Columns
    rates: Columns
    attitude: Columns
    heading: Columns
    flapping: Columns

    @classmethod
    def read(cls, states: Columns, velocity: int, flapping: int) -> "Motions":
        """Return the motions of MuJoCo's full physics states, (n, n_state).

        `velocity` and `flapping` are the columns where a state's velocities and flapping start.
        """
        rows = np.empty((_ROWS[-1], len(states)))
        _reader()(states, rows, velocity, flapping)
        time, *others = (rows[first:last] for first, last in pairwise(_ROWS))
        return cls(time[0], *others)

    def level(self, vectors: Columns) -> Columns:
        """Return vectors in earth axes, (3, n), as ahead, right and below along the heading."""
        (cosine, sine), (north, east, down) = self.heading, vectors
        return np.stack([cosine * north + sine * east, cosine * east - sine * north, down])


_ROWS = np.cumsum([0, 1, 3, 3, 3, 3, 3, 2, 2]).tolist()


@cache
def _reader() -> Callable[[Columns, Columns, int, int], None]:
    """Return a function that fills rows (20, n) from states (n, n_state), each helicopter alone."""
    sources = fingerprint()  # numba's cache on disk knows the function by it too

    def compiled(cached: bool) -> Callable[[Columns, Columns, int, int], None]:
        signature = "void(float64[:, ::1], float64[:, ::1], int64, int64)"

        @njit(signature, cache=cached, error_model="numpy")
        def fill(states, rows, velocity, flapping):
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

    return compiled_or_cached(compiled)


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


BOUND = 10.0  # Scaled observations are cut off at plus and minus this


class Observation(NamedTuple):
    """One number that an agent sees: value / scale, cut off at +-`BOUND`; scale is in its unit."""

    name: str
    unit: str
    scale: float
    meaning: str


class Situation(NamedTuple):
    """What a task judges, n helicopters at one instant: `commands`, (4, n).

    `actions`, (4, n), are the last, -1 to 1, `before`, (4, n), those before.
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
    """Base of an agent's tasks: what is seen, commanded and rewarded; a column for each helicopter.

    Compute element by element, without matrix products or sums along columns, and a helicopter
    alone and one among others see the same bits. `interval`, s, is how long a command holds; None:
    an episode.
    """

    observations: ClassVar[tuple[Observation, ...]]
    interval: float | None = None

    @abstractmethod
    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return four numbers that a helicopter is asked for; the height, m, is the start's."""

    @abstractmethod
    def observe(self, situation: Situation) -> Columns:
        """Return what is seen, in the units of `observations`, (n_observation, n)."""

    @abstractmethod
    def reward(self, situation: Situation, seen: Columns) -> Columns:
        """Return the reward of the last step, (n,), of what `observe` returned."""

    def terms(self, situation: Situation, seen: Columns) -> Mapping[str, Columns]:
        """Return what the reward is made of, by name, (n,) each, for the infos of a step."""
        return {}

    def lost(self, situation: Situation, seen: Columns) -> NDArray[np.bool_]:
        """Return which helicopters, (n_env,), are too far off to go on, of (n_seen, n_env)."""
        return np.zeros_like(situation.motions.time, dtype=np.bool_)


def check_task(task: Task) -> None:
    """Raise InputError unless a task says what is seen, on scales above 0."""
    observations = getattr(task, "observations", ())
    if not observations or not all(
        isinstance(one, Observation) and is_number(one.scale) and 0.0 < one.scale < math.inf
        for one in observations
    ):
        raise InputError(
            f"{type(task).__name__} needs observations, a tuple of Observation(name, unit, scale, "
            f"...), each scale above 0, got {observations!r:.80}"
        )


@dataclass(frozen=True, kw_only=True)
class _Shipped(Checked, Task):
    speed: float = setting(above=0.0)
    heading: float = setting(0.5, above=0.0)
    rate: float = setting(2.0, above=0.0)
    change: float = setting(2.0, above=0.0)

    @abstractmethod
    def missing(self, situation: Situation) -> Columns:
        """Return what is missing to the command, (3, n), north, east, down."""

    def observe(self, situation: Situation) -> Columns:
        """Return what is missing, along the heading, and the own motion."""
        motions, asked = situation.motions, situation.commands[3]
        cosine, sine = motions.heading
        there, aside = np.cos(asked), np.sin(asked)
        return np.vstack(
            [
                motions.level(self.missing(situation)),
                aside * cosine - there * sine,
                there * cosine + aside * sine,
                motions.body_velocity,
                motions.attitude[:2],
                motions.rates,
                situation.actions,
            ]
        )

    def reward(self, situation: Situation, seen: Columns) -> Columns:
        """Return 1 / (1 + J), J the sum of the `terms`."""
        return 1.0 / (1.0 + np.add.reduce([*self.terms(situation, seen).values()]))

    def terms(self, situation: Situation, seen: Columns) -> dict[str, Columns]:
        """Return the terms of J by name, (n,) each."""
        change = situation.actions - situation.before
        return {
            **self.missed(seen),
            "heading": 2.0 * (1.0 - seen[4]) / self.heading**2,
            "rate": _square(seen[10:13]) / self.rate**2,
            "change": (_square(change[:3]) + change[3] * change[3]) / self.change**2,
        }

    @abstractmethod
    def missed(self, seen: Columns) -> dict[str, Columns]:
        """Return the terms of J, (n,), that are the command's."""


@dataclass(frozen=True, kw_only=True)
class Hover(_Shipped):
    """Hover at one place and heading; an episode is terminated beyond `limit`, m from the place.

    The reward of a step is 1 / (1 + J): J sums the squares of distance, speed, heading error (2 sin
    of its half), body rates and change of the action, each over its setting here, in SI.
    """

    distance: float = setting(1.0, above=0.0)
    speed: float = setting(2.0, above=0.0)
    limit: float = setting(10.0, above=0.0)

    observations: ClassVar = (
        Observation("ahead", "m", 1.0, "where the place is, along the heading"),
        Observation("right", "m", 1.0, "to the right of it"),
        Observation("below", "m", 1.0, "below the helicopter"),
        *_OWN_MOTION,
    )

    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return the place above the origin at the height of the start, heading north."""
        return 0.0, 0.0, -height, 0.0

    def missing(self, situation: Situation) -> Columns:
        """Return the way to the place, m."""
        return situation.commands[:3] - situation.motions.position

    def missed(self, seen: Columns) -> dict[str, Columns]:
        """Return the squares of distance and speed."""
        return {
            "distance": _square(seen[:3]) / self.distance**2,
            "speed": _square(seen[5:8]) / self.speed**2,
        }

    def lost(self, situation: Situation, seen: Columns) -> NDArray[np.bool_]:
        """Return which are farther from the place than `limit`, (n,) of (n_observation, n)."""
        return _square(seen[:3]) > self.limit**2


@dataclass(frozen=True, kw_only=True)
class Track(_Shipped):
    """Fly at commanded velocities and headings, which change every few seconds. SI.

    The reward is `Hover`'s, with the velocity's error in place of distance and speed. `fastest` is
    of north and east commands, `climb` of those up and down.
    """

    interval: float | None = setting(4.0, unit="s", above=0.0)
    fastest: float = setting(3.0, above=0.0)
    climb: float = setting(0.5, above=0.0)
    speed: float = setting(1.0, above=0.0)

    observations: ClassVar = (
        Observation("ahead", "m/s", 1.0, "commanded less present velocity, along the heading"),
        Observation("right", "m/s", 1.0, "to the right of it"),
        Observation("below", "m/s", 1.0, "downwards"),
        *_OWN_MOTION,
    )

    def command(self, random: np.random.Generator, height: float) -> tuple[float, ...]:
        """Return a velocity north, east, down and a heading, each as likely within its range."""
        reach = (self.fastest, self.fastest, self.climb, math.pi)
        return tuple(share * most for share, most in zip(random.uniform(-1.0, 1.0, 4), reach))

    def missing(self, situation: Situation) -> Columns:
        """Return the velocity that is missing, m/s."""
        return situation.commands[:3] - situation.motions.velocity

    def missed(self, seen: Columns) -> dict[str, Columns]:
        """Return the square of the velocity's error."""
        return {"velocity": _square(seen[:3]) / self.speed**2}


def _square(vectors: Columns) -> Columns:
    squares = vectors * vectors
    return squares[0] + squares[1] + squares[2]
