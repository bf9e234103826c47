"""Many helicopters that an agent flies at once, stepped natively."""

import copy
import weakref
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from gymnasium.error import ResetNeeded
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.settings import convert, from_plain
from helisim.gym.setup import TASKS, Agent, Setup, Spread
from helisim.gym.task import BOUND, Motions, Situation, Task, check_task
from helisim.physics.layout import SENSOR, STATE
from helisim.physics.motion import flip
from helisim.physics.native import installed
from helisim.sim import Weather
from helisim.sim.flight import thread_count
from helisim.sim.limits import Limits
from helisim.vehicle.addresses import addresses
from helisim.vehicle.trim import Motion, place, write_motion

_EARLY = 1e-9  # s by which a new command may come early: times are rounded
_COMMAND = tuple[float, float, float, float]
_FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of `reset`: distances from the trim, not at random, and the episode's command."""

    motion: Motion | None = None
    command: _COMMAND | None = None


class Stepped(NamedTuple):
    """What a frame of n helicopters gave.

    Attributes:
        seen: scaled, (n, n_observation).
        reward: (n,).
        terms: what the reward is made of, by name, (n,) each.
        terminated: who ended, (n,).
        why: by row the name of the limit, or the controller's failure.
    """

    seen: NDArray[np.float32]
    reward: NDArray[np.float64]
    terms: Mapping[str, NDArray[np.float64]]
    terminated: NDArray[np.bool_]
    why: Mapping[int, str]


class Flights:
    """n helicopters under one agent, each with a model of its own; `frame` is s between actions.

    `states` are MuJoCo's full physics states, (n, n_state).
    """

    def __init__(self, setup: Setup, count: int) -> None:
        self.setup, self.count, self.vehicle = setup, count, setup.loaded()
        self.task = setup.task if isinstance(setup.task, Task) else TASKS[setup.task]()
        check_task(self.task)
        model, steps = self.vehicle.model, setup.frame_skip
        self.agent = Agent(setup, self.vehicle)
        self.spread = Spread(self.vehicle, setup.spread)
        self._limits = Limits(setup.envelope, self.vehicle, of_origin=True)
        self._scale = 1.0 / np.array([[one.scale] for one in self.task.observations])
        where = addresses(model)
        self._rotor, self._rough = where.rotor, where.state + STATE.air_u
        self._motion_at = 1 + model.nq, 1 + model.nq + model.nv + where.state + STATE.flap_a
        self._models = [copy.copy(model) for _ in range(count)]
        self._controllers = ExitStack()
        weakref.finalize(self, self._controllers.close)
        controller = self.vehicle.controller
        self._laws = [
            self._controllers.enter_context(controller.flying(one))
            for one in (self._models if controller.laws else ())
        ]
        self._users = [one.actuator_user[self._rotor].copy() for one in self._models]
        threads = min(count, thread_count(setup.threads))
        self._data = [mujoco.MjData(model) for _ in range(threads)]
        self._pool = Rollout(nthread=0 if threads == 1 else threads)  # one is the caller's own
        self._chunk = -(-count // threads)  # one a thread: others wait for its caches
        self._start = mujoco.MjData(model)
        place(model, self._start, self.vehicle.trim, height=setup.weather.height)
        size = mujoco.mj_stateSize(model, _FULL)
        self.states = np.zeros((count, size))
        self._flown = np.empty((count, steps, size))
        self._sensed = np.empty((count, steps, model.nsensordata))
        first = model.sensor("air").adr[0]
        self._air = self._sensed[:, -1, first : first + SENSOR.air_w - SENSOR.air_u + 1].T
        self._given = np.tile(self.agent.resting, (count, steps, 1))
        self._commands, self._until = np.zeros((4, count)), np.full(count, np.nan)
        self._actions, self._before = np.zeros((4, count)), np.zeros((4, count))
        self.frame = steps * float(model.opt.timestep)

    def close(self) -> None:
        """Stop the threads, and let go of the controller's laws."""
        self._pool.close()
        self._controllers.close()

    def reset(
        self,
        rows: Sequence[int],
        randoms: Sequence[np.random.Generator],
        options: Mapping[str, Any] | None = None,
    ) -> list[dict[str, Any]]:
        """Start new episodes in some rows; return infos of each; `randoms` are of all helicopters.

        The options are those of `Options`, by name. Raises UnknownNameError or InputError.
        """
        given = from_plain(Options, options or {}, "reset")
        return [self._reset(row, randoms[row], given) for row in rows]

    def _reset(self, row: int, random: np.random.Generator, given: Options) -> dict[str, Any]:
        near, seed = self.setup.start.draw(random), int(random.integers(2**31))
        weather = self.setup.weather
        weather = weather if isinstance(weather, Weather) else weather.draw(random)
        factors, model = self.spread.draw(random), self._models[row]
        par = model.actuator_user[self._rotor]
        par[:] = self._users[row]
        self.spread.write(model, factors)
        self.agent.write(model)
        model.opt.wind[:] = flip(*weather.wind_to)
        weather.write(par, self.vehicle, seed=seed)
        trim = replace(self.vehicle.trim.motion, down=-weather.height)
        near = near if given.motion is None else asdict(given.motion)
        moved = {name: getattr(trim, name) + value for name, value in near.items()}
        write_motion(self.vehicle.model, self._start, replace(trim, **moved))
        rough = weather.start(self.vehicle, np.random.default_rng(seed))
        self._start.act[self._rough : self._rough + rough.size] = rough
        mujoco.mj_getState(self.vehicle.model, self._start, self.states[row], _FULL)
        self._commands[:, row] = given.command or self._commanded(random)
        self._until[row] = np.inf if given.command else self.task.interval or np.inf
        self._actions[:, row] = self._before[:, row] = 0.0
        return {"wind": np.array(weather.wind_to[:2]), "factors": factors}

    def _commanded(self, random: np.random.Generator) -> tuple[float, ...]:
        given = self.task.command(random, self.setup.weather.height)
        return convert(_COMMAND, given, f"{type(self.task).__name__}.command")

    def step(
        self,
        actions: NDArray[np.floating],
        randoms: Sequence[np.random.Generator],
        started: NDArray[np.bool_] | None = None,
    ) -> Stepped:
        """Fly on by a frame, with actions, (n_env, 4), cut off at -1 and 1.

        `randoms` are of all; those `started`, (n_env,), have just been reset and stay, without
        reward. Raises InputError, or ResetNeeded for one that has never been reset.
        """
        given = np.asarray(actions, dtype=np.float64)
        if given.shape != (self.count, 4) or np.isnan(given).any():
            raise InputError(
                f"actions must be ({self.count}, 4) numbers from -1 to 1, got {given.shape}"
                f"{', some of them nan' if np.isnan(given).any() else ''}"
            )
        if np.isnan(self._until).any():
            raise ResetNeeded("no episode has begun: call reset before step")
        started = np.zeros(self.count, dtype=np.bool_) if started is None else started
        kept = self.states[started]
        self._before, self._actions = self._actions, np.clip(given.T, -1.0, 1.0)
        self._actions[:, started] = 0.0
        self.agent.give(self._given, self._actions)
        with installed():
            self.roll()
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
        self, randoms: Sequence[np.random.Generator], started: NDArray[np.bool_]
    ) -> Stepped:
        seen, situation = self._observed()
        reward = self._shaped("reward", self.task.reward(situation, seen), (self.count,))
        terms = self.task.terms(situation, seen)
        motions = situation.motions
        through = motions.body_velocity - self._air
        state = (motions.attitude, motions.rates, motions.position, motions.flapping, through)
        found = self._limits.beyond(*(one.T for one in state))
        failures = ((row, law()) for row, law in enumerate(self._laws))
        name = self.vehicle.controller.name
        failed = {row: f"controller {name!r} {one.why}" for row, one in failures if one}
        beyond: dict[str, Any] = {
            **{name: rows for name, _, rows in found},
            "distance": self._shaped("lost", self.task.lost(situation, seen), (self.count,)),
            "finite state": ~np.isfinite(seen).all(axis=0),
            "controller": np.isin(np.arange(self.count), list(failed)),
        }
        terminated = np.any(list(beyond.values()), axis=0) & ~started
        reward[started] = 0.0
        why = {
            row: failed.get(row) or next(name for name, rows in beyond.items() if rows[row])
            for row in np.flatnonzero(terminated).tolist()
        }
        if self.task.interval is not None:
            due = (self.states[:, 0] > self._until - _EARLY) & ~started
            for row in np.flatnonzero(due).tolist():
                self._commands[:, row] = self._commanded(randoms[row])
                self._until[row] += self.task.interval
            seen = self._observed()[0] if due.any() else seen
        return Stepped(self._scaled(seen), np.nan_to_num(reward), terms, terminated, why)

    def look(self) -> NDArray[np.float32]:
        """Return what each agent sees now, (n, n_observation)."""
        return self._scaled(self._observed()[0])

    def _observed(self) -> tuple[NDArray[np.float64], Situation]:
        motions = Motions.read(self.states, *self._motion_at)
        situation = Situation(motions, self._commands, self._actions, self._before)
        return self._shaped(
            "observe", self.task.observe(situation), (len(self.task.observations), self.count)
        ), situation

    def _shaped(self, what: str, given: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
        if np.shape(given) != shape:
            raise InputError(
                f"{type(self.task).__name__}.{what} must return {shape}, a column for each "
                f"helicopter, got {np.shape(given)}"
            )
        return given

    def _scaled(self, seen: NDArray[np.float64]) -> NDArray[np.float32]:
        scaled = np.clip(np.nan_to_num(seen * self._scale), -BOUND, BOUND)
        return np.ascontiguousarray(scaled.T, dtype=np.float32)
