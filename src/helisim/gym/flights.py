"""Many helicopters that an agent flies at once, stepped natively; alone it is the same code."""

import copy
import math
import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

import mujoco
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.gym.episodes import Agent, EpisodeStart, Spread
from helisim.gym.settings import Setup
from helisim.gym.task import BOUND, Situation, StateReader, check_task
from helisim.physics.layout import SENSOR
from helisim.physics.native import installed
from helisim.sim import Weather
from helisim.sim.flight import thread_count
from helisim.sim.limits import Limits
from helisim.vehicle.controller import Flying
from helisim.vehicle.trim import addresses

_EARLY = 1e-9
"""s by which a new command may come early: times are rounded."""
OPTIONS = ("motion", "command")
_COPIED = ("states", "_commands", "_until", "_actions", "_before")
"""Arrays that say how far the episodes have come."""


class Episode(NamedTuple):
    """What a helicopter's model was given for its episode.

    Attributes:
        factors: of the spread parameters, (n_parameter,).
        weather: of the episode.
        seed: of its air.
    """

    factors: NDArray[np.float64]
    weather: Weather
    seed: int


class Stepped(NamedTuple):
    """What a step gave, a row or element for each of n helicopters.

    Attributes:
        seen: (n, n_observation) float32, scaled.
        reward: (n,) float64.
        terminated: (n,) bool.
        why: row -> name of the limit, or how the controller failed, of those that are terminated.
    """

    seen: NDArray[np.float32]
    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    why: Mapping[int, str]


class Flights:
    """n helicopters under one agent: models of their own, states side by side, native steps.

    Args:
        setup: of the environment.
        count: how many.
        threads: that step them; as the setup says if None.
    """

    def __init__(self, setup: Setup, count: int, *, threads: int | None = None) -> None:
        self.setup, self.count, self._threads = setup, count, threads
        self.vehicle = setup.loaded()
        self.task = setup.asked
        check_task(self.task)
        model = self.vehicle.model
        self.agent = Agent(setup, self.vehicle)
        self.spread = Spread(self.vehicle, setup.spread)
        self._start = EpisodeStart(setup, self.vehicle)
        self._limits = Limits(setup.envelope, self.vehicle, of_origin=True)
        self._reader = StateReader(model)
        self._scale = 1.0 / np.array([[one.scale] for one in self.task.observations])
        self._models = [copy.copy(model) for _ in range(count)]
        self._controllers = ExitStack()
        weakref.finalize(self, self._controllers.close)
        self._laws = self._own_laws()
        self._rotor = addresses(model).rotor
        self._users = [one.actuator_user[self._rotor].copy() for one in self._models]
        self._data, self._pool = _workers(model, min(count, threads or thread_count(setup.threads)))
        self._chunk = -(-count // len(self._data))  # one a thread: others wait for its caches
        self._episodes: list[Episode | None] = [None] * count
        self._ready, self._closed = False, False
        self._allocate(model)

    def __getstate__(self) -> dict[str, Any]:
        """Return what it is made of and how far its episodes are; threads are no data."""
        return {
            "made": (self.setup, self.count, self._threads),
            "episodes": self._episodes,
            "arrays": {name: getattr(self, name) for name in _COPIED},
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Make another, and put its episodes where they were."""
        setup, count, threads = state["made"]
        self.__init__(setup, count, threads=threads)
        for row, episode in enumerate(state["episodes"]):
            if episode is not None:
                self._give(row, episode)
        self._ready = None not in self._episodes
        vars(self).update(state["arrays"])

    def _own_laws(self) -> list[Flying]:
        """Give each helicopter its copy of the controller's laws that aren't shipped."""
        controller = self.vehicle.controller
        if not controller.laws:
            return []
        flying = self._controllers.enter_context
        return [flying(controller.flying(model)) for model in self._models]

    def _allocate(self, model: mujoco.MjModel) -> None:
        size, steps = self._start.state.size, self.setup.frame_skip
        self.states = np.tile(self._start.state, (self.count, 1))
        self._flown = np.empty((self.count, steps, size))
        self._sensed = np.empty((self.count, steps, model.nsensordata))
        first = model.sensor("air").adr[0]
        self._air = self._sensed[:, -1, first : first + SENSOR.air_w - SENSOR.air_u + 1].T
        self._given = self.agent.controls(self.count)
        self._commands, self._until = np.zeros((4, self.count)), np.full(self.count, np.inf)
        self._actions, self._before = np.zeros((4, self.count)), np.zeros((4, self.count))

    @property
    def time(self) -> NDArray[np.float64]:
        """Time since the start of each episode, s, (n,)."""
        return self.states[:, 0].copy()

    @property
    def frame(self) -> float:
        """Time between two actions, s."""
        return self.setup.frame_skip * float(self.vehicle.model.opt.timestep)

    def close(self) -> None:
        """Stop the threads, and let go of the controller's laws."""
        self._closed = True
        self._pool.close()
        self._controllers.close()

    def reset(
        self,
        rows: Sequence[int],
        randoms: Sequence[np.random.Generator],
        options: Mapping[str, Any] | None = None,
    ) -> list[dict[str, Any]]:
        """Start new episodes in some rows; return what is new about each.

        Args:
            rows: of the helicopters.
            randoms: of all n helicopters; each draws from its own.
            options: "motion" -> name of a field of `Motion` -> how far from the trim, in place of
                a random start; "command" -> four numbers for the whole episode.

        Raises:
            UnknownNameError: no such option, or field of a motion.
            InputError: no such numbers.
            ClosedEnvironmentError: it has been closed.
        """
        options = {} if options is None else options
        if not isinstance(options, Mapping):
            raise InputError(f"options of reset must be a dict, got {options!r:.60}")
        for name in options:
            if name not in OPTIONS:
                raise UnknownNameError("option of reset", name, OPTIONS)
        self._refuse_closed()
        motion, asked = options.get("motion"), options.get("command")
        if not isinstance(motion, Mapping | None):
            raise InputError(f"motion must be a dict, such as {{'north': 2.0}}, got {motion!r:.60}")
        asked = None if asked is None else _four(asked, "a command")
        infos = [self._reset(row, randoms[row], motion, asked) for row in rows]
        self._ready = None not in self._episodes
        return infos

    def _reset(
        self,
        row: int,
        random: np.random.Generator,
        motion: Mapping[str, float] | None,
        asked: tuple[float, ...] | None,
    ) -> dict[str, Any]:
        start = self._start
        offsets, weather, seed = start.draw(random)
        factors = self.spread.draw(random)
        self._give(row, Episode(factors, weather, seed))
        self.states[row] = start.state_of(offsets if motion is None else motion, weather, seed)
        self._commands[:, row] = self._commanded(random) if asked is None else asked
        every = self.task.interval if asked is None else None
        self._until[row] = np.inf if every is None else every
        self._actions[:, row] = self._before[:, row] = 0.0
        north, east, _ = weather.wind_to
        return {"wind": np.array([north, east]), "factors": factors}

    def _give(self, row: int, episode: Episode) -> None:
        """Write an episode into its helicopter's model."""
        model = self._models[row]
        model.actuator_user[self._rotor] = self._users[row]
        self.spread.write(model, episode.factors)
        self.agent.write(model)
        self._start.write_weather(model, episode.weather, episode.seed)
        self._episodes[row] = episode

    def _commanded(self, random: np.random.Generator) -> tuple[float, ...]:
        """Return a command that the task draws."""
        what = f"{type(self.task).__name__}.command"
        return _four(self.task.command(random, self._start.height), what)

    def step(
        self,
        actions: NDArray[np.floating],
        randoms: Sequence[np.random.Generator],
        started: NDArray[np.bool_] | None = None,
    ) -> Stepped:
        """Fly on by a frame.

        Args:
            actions: (n, 4) from -1 to 1; beyond, they are cut off.
            randoms: of all n helicopters.
            started: (n,) which have just been reset and stay there, without reward.

        Returns:
            n observations, rewards and ends, with a row or element each.

        Raises:
            InputError: actions of another shape, or not numbers.
            ResetNeeded: a helicopter has never been reset.
            ClosedEnvironmentError: it has been closed.
        """
        self._refuse_closed()
        if not self._ready:
            raise ResetNeeded("no episode has begun: call reset before step")
        moved = self._checked(actions)
        kept = None if started is None else self.states[started]
        self._before, self._actions = self._actions, moved
        if started is not None:
            self._actions[:, started] = 0.0
        self.agent.give(self._given, self._actions)
        with installed():
            self.roll()
        if kept is not None:
            self.states[started] = kept
        with np.errstate(invalid="ignore", over="ignore"):
            return self._judged(randoms, started)

    def roll(self) -> None:
        """Step a frame with the inputs as they are; the force laws must be installed."""
        self._pool.rollout(
            self._models,
            self._data,
            self.states,
            self._given,
            control_spec=self.agent.spec,
            skip_checks=True,
            nstep=self.setup.frame_skip,
            state=self._flown,
            sensordata=self._sensed,
            chunk_size=self._chunk,
        )
        np.copyto(self.states, self._flown[:, -1])

    def _judged(
        self, randoms: Sequence[np.random.Generator], started: NDArray[np.bool_] | None
    ) -> Stepped:
        situation = self._situation()
        seen = self._observed(situation)
        reward = self._shaped("reward", self.task.reward(situation, seen), (self.count,))
        motions = situation.motions
        through = motions.body_velocity - self._air
        state = (motions.attitude, motions.rates, motions.position, motions.flapping, through)
        limits = self._limits.beyond(*(one.T for one in state))
        beyond: dict[str, NDArray[np.bool_]] = {name: rows for name, _, rows in limits}
        beyond["distance"] = self.task.lost(situation, seen)
        finite = np.isfinite(seen)
        if not finite.all():
            beyond["finite state"] = np.logical_not(finite.all(axis=0))
        failed = self._failures()
        if failed:
            beyond["controller"] = np.isin(np.arange(self.count), list(failed))
        terminated: NDArray[np.bool_] = np.zeros(self.count, dtype=np.bool_)
        for rows in beyond.values():
            terminated |= rows
        if started is not None:
            reward[started], terminated[started] = 0.0, False
        why = {
            int(row): next(name for name, rows in beyond.items() if rows[row])
            for row in np.flatnonzero(terminated)
        }
        why.update({row: text for row, text in failed.items() if row in why})
        if self._renewed(randoms, started):
            seen = self._observed(situation)
        if "finite state" in beyond:
            seen, reward = np.nan_to_num(seen), np.nan_to_num(reward)
        return Stepped(self._scaled(seen), reward, terminated, why)

    def _failures(self) -> dict[int, str]:
        """Return how a law of the controller failed since it was last asked, by row."""
        found = {row: one.failure() for row, one in enumerate(self._laws)}
        name = self.vehicle.controller.name
        return {row: f"controller {name!r} {one.why}" for row, one in found.items() if one}

    def look(self) -> NDArray[np.float32]:
        """Return what each agent sees now, (n, n_observation)."""
        return self._scaled(self._observed(self._situation()))

    def _observed(self, situation: Situation) -> NDArray[np.float64]:
        shape = (len(self.task.observations), self.count)
        return self._shaped("observe", self.task.observe(situation), shape)

    def _shaped(self, what: str, given: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """Return what the task gave. Raises InputError if it has another shape."""
        if np.shape(given) != shape:
            raise InputError(
                f"{type(self.task).__name__}.{what} must return {shape}, a column for each "
                f"helicopter, got {np.shape(given)}"
            )
        return given

    def _situation(self) -> Situation:
        motions = self._reader.read(self.states)
        return Situation(motions, self._commands, self._actions, self._before)

    def _scaled(self, seen: NDArray[np.float64]) -> NDArray[np.float32]:
        scaled = seen * self._scale
        np.minimum(scaled, BOUND, out=scaled)
        np.maximum(scaled, -BOUND, out=scaled)
        return np.ascontiguousarray(scaled.T, dtype=np.float32)

    def _renewed(
        self, randoms: Sequence[np.random.Generator], started: NDArray[np.bool_] | None
    ) -> bool:
        """Give new commands where they are due; return whether there are any."""
        if self.task.interval is None:
            return False
        due = self.states[:, 0] > self._until - _EARLY
        if started is not None:
            due &= ~started
        for row in np.flatnonzero(due).tolist():
            self._commands[:, row] = self._commanded(randoms[row])
            self._until[row] += self.task.interval
        return bool(due.any())

    def _checked(self, actions: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return actions as (4, n) within -1 and 1."""
        given = np.asarray(actions)
        if given.shape != (self.count, 4):
            raise InputError(f"actions must be ({self.count}, 4), got {given.shape}")
        if given.dtype.kind not in "fiub":
            raise InputError(f"actions must be numbers from -1 to 1, got {given.dtype}")
        actions = given.astype(np.float64, copy=False)
        moved = np.maximum(np.ascontiguousarray(actions.T), -1.0)
        np.minimum(moved, 1.0, out=moved)
        if np.isnan(moved).any():
            rows = np.flatnonzero(np.isnan(moved).any(axis=0)).tolist()
            raise InputError(f"actions must be numbers from -1 to 1, got nan in rows {rows}")
        return moved

    def _refuse_closed(self) -> None:
        if self._closed:
            raise ClosedEnvironmentError("the environment has been closed: make another")


def _workers(model: mujoco.MjModel, threads: int) -> tuple[list[mujoco.MjData], Rollout]:
    """Return memory for each thread and a pool of them; one alone is the caller's own."""
    pool = Rollout(nthread=0 if threads == 1 else threads)
    return [mujoco.MjData(model) for _ in range(threads)], pool


def _four(given: Any, what: str) -> tuple[float, ...]:
    """Return four finite numbers. Raises InputError."""
    try:
        numbers = tuple(float(number) for number in given)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise InputError(f"{what} needs four finite numbers, got {given!r:.60}")
    return numbers
