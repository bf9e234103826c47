"""One helicopter, or many stepped natively in threads, as Gymnasium environments."""

import math
from collections.abc import Mapping, Sequence
from operator import index
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from helisim.base.errors import DisplayError, InputError
from helisim.base.settings import from_plain
from helisim.gym.flights import Flights
from helisim.gym.setup import Setup
from helisim.gym.task import BOUND
from helisim.show.viewer import Rotors, aim
from helisim.sim.flight import at_least
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import root_body

Seen = NDArray[np.float32]
Flags = NDArray[np.bool_]
ACTIONS = Box(-1.0, 1.0, (4,), np.float32)
_STATE = mujoco.mjtState
# The head of a full physics state, all that a picture needs.
_DRAWN = _STATE.mjSTATE_TIME | _STATE.mjSTATE_QPOS | _STATE.mjSTATE_QVEL | _STATE.mjSTATE_ACT


class _Flown:
    metadata: dict[str, Any] = {  # noqa: RUF012  (gymnasium's own; instances may have another)
        "render_modes": ["rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def _make(self, settings: Mapping[str, Any], num_envs: int = 1) -> Box:
        self.setup = from_plain(Setup, settings, "environment")
        self.render_mode = self.setup.render_mode
        self._flights = flights = Flights(self.setup, at_least("num_envs", num_envs, 1))
        self._picture = None  # an environment that is never drawn needs no graphics
        self.metadata = {**self.metadata, "render_fps": round(1.0 / flights.frame)}
        self.observations, self.parameters = flights.task.observations, flights.spread.names
        return Box(-BOUND, BOUND, (len(self.observations),), np.float32)

    def _drawn(self) -> list[NDArray[np.uint8]]:
        if self.render_mode is None:
            raise InputError("no render_mode was given: 'rgb_array' gives pictures")
        if self._picture is None:
            self._picture = _Picture(self._flights.vehicle, self.setup.width, self.setup.height)
        return [self._picture.of_state(state) for state in self._flights.states]

    def close_extras(self, **_: Any) -> None:
        """Let go of threads and pictures."""
        if self._picture:
            self._picture.renderer.close()
        self._flights.close()


class HelicopterEnv(_Flown, gymnasium.Env[Any, Any]):
    """One helicopter to fly: `gymnasium.make("helisim/Hover-v0")`, with a `Setup`'s settings.

    Each episode draws factors of `parameters`.
    Raises InputError.
    """

    def __init__(self, **settings: Any) -> None:
        self.observation_space = self._make(settings)
        self.action_space = ACTIONS

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Start an episode as `Flights.reset`; return observation and infos.

        Infos are "time" (s), "wind" north and east (m/s), and "factors" of `parameters`.
        """
        super().reset(seed=seed)
        (info,) = self._flights.reset([0], [self.np_random], options)
        return self._flights.look()[0], {"time": 0.0, **info}

    def step(self, action: NDArray[np.floating]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly on by a frame, with an action, (4,), cut off at -1 and 1; truncation is Gymnasium's.

        Infos are "time" (s), "terms" of the reward by name and, at a limit, its name as "ended".
        """
        flown = self._flights.step(np.asarray(action)[None], [self.np_random])
        info: dict[str, Any] = {
            "time": float(self._flights.states[0, 0]),
            "terms": {name: float(one[0]) for name, one in flown.terms.items()},
        }
        if flown.why:
            info["ended"] = flown.why[0]
        return flown.seen[0], float(flown.reward[0]), bool(flown.terminated[0]), False, info

    def render(self) -> NDArray[np.uint8]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture, (n_row, n_column, 3). Raises InputError (no mode) or DisplayError."""
        return self._drawn()[0]

    def close(self) -> None:
        """Let go of threads and pictures."""
        self.close_extras()


class HelicopterVectorEnv(_Flown, VectorEnv[Seen, NDArray[np.float32], NDArray[Any]]):
    """Helicopters to fly at once: `gymnasium.make_vec("helisim/Hover-v0", num_envs=64)`.

    Helicopter k of a seed flies, to the bit, as the single environment of seed + k. An ended
    episode starts anew in the next step. Episodes are truncated after `max_episode_steps` unless
    None; the rest is `HelicopterEnv`'s. Raises InputError.
    """

    def __init__(
        self, num_envs: int = 1, *, max_episode_steps: int | None = None, **settings: Any
    ) -> None:
        self.num_envs, self._most = num_envs, math.inf
        if max_episode_steps is not None:
            self._most = at_least("max_episode_steps", max_episode_steps, 1)
        self.single_observation_space = self._make(settings, num_envs)
        self.single_action_space = ACTIONS
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms = [np_random()[0] for _ in range(num_envs)]
        self._done = np.zeros(num_envs, dtype=np.bool_)
        self._steps = np.zeros(num_envs, dtype=np.int64)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, dict[str, Any]]:
        """Start an episode of all, or of those in options["reset_mask"], (num_envs,) bool.

        A seed is of helicopter 0, and the others count on, or one for each; None goes on drawing.
        Other options are those of `Flights.reset`. Raises InputError or UnknownNameError.
        """
        options, count = dict(options or {}), self.num_envs
        mask = np.asarray(options.pop("reset_mask", np.ones(count, dtype=np.bool_)))
        if isinstance(seed, Sequence | np.ndarray):
            seeds = [None if one is None else index(one) for one in seed]
        else:
            seeds = [None if seed is None else index(seed) + row for row in range(count)]
        if mask.shape != (count,) or mask.dtype != np.bool_ or len(seeds) != count:
            raise InputError(
                f"reset needs {count} seeds and a reset_mask of {count} bool, got {len(seeds)} and "
                f"{mask.dtype} {mask.shape}"
            )
        for row in np.flatnonzero(mask).tolist():
            if seeds[row] is not None:
                self._randoms[row] = np_random(seeds[row])[0]
        infos = self._restart(mask, options)
        self._done[mask] = False
        return self._flights.look(), infos

    def step(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, actions: NDArray[np.floating]
    ) -> tuple[Seen, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Fly all on by a frame, with actions, (num_envs, 4), cut off at -1 and 1.

        Returns observations, (num_envs, n_observation), and for each helicopter reward, limit
        passed, out of time; infos are "time" (s), "terms" of the reward by name, "ended" (limits'
        names), and `reset`'s for new episodes. Raises InputError.
        """
        started = self._done
        infos = self._restart(started, None)
        flown = self._flights.step(actions, self._randoms, started)
        self._steps[~started] += 1
        for row, name in flown.why.items():
            self._add_info(infos, {"ended": name}, row)
        terms = {name: np.where(started, 0.0, term) for name, term in flown.terms.items()}
        terms |= {f"_{name}": ~started for name in flown.terms}
        infos |= {"time": self._flights.states[:, 0].copy(), "terms": terms}
        infos |= {"_time": np.ones(self.num_envs, dtype=np.bool_), "_terms": ~started}
        truncated = self._steps >= self._most
        self._done = flown.terminated | truncated
        return flown.seen, flown.reward, flown.terminated, truncated, infos

    def _restart(self, mask: Flags, options: dict[str, Any] | None) -> dict[str, Any]:
        rows, infos = np.flatnonzero(mask).tolist(), {}
        for row, fact in zip(rows, self._flights.reset(rows, self._randoms, options)):
            self._add_info(infos, {"time": 0.0, **fact}, row)
        self._steps[rows] = 0
        return infos

    def render(self) -> tuple[NDArray[np.uint8], ...]:
        """Return a picture of each, (n_row, n_column, 3). Raises as `HelicopterEnv.render`."""
        return tuple(self._drawn())


class _Picture:
    def __init__(self, vehicle: Vehicle, width: Any, height: Any) -> None:
        model = self._model = vehicle.visual_model()
        frame = model.vis.global_
        frame.offwidth, frame.offheight = max(width, frame.offwidth), max(height, frame.offheight)
        try:
            self.renderer = mujoco.Renderer(model, height, width)
        except Exception as error:  # each graphics stack has its own
            raise DisplayError(
                f"can't draw off screen: {' '.join(str(error).split())}; set MUJOCO_GL to egl or "
                "osmesa, and install its library (Debian: apt-get install libegl1 libgl1)"
            ) from None
        self._data, self._camera = mujoco.MjData(model), mujoco.MjvCamera()
        self._rotors = Rotors(model)
        aim(self._camera, model, root_body(model))

    def of_state(self, state: NDArray[np.float64]) -> NDArray[np.uint8]:
        model, data = self._model, self._data
        mujoco.mj_setState(model, data, state[: mujoco.mj_stateSize(model, _DRAWN)], _DRAWN)
        mujoco.mj_fwdPosition(model, data)
        self._rotors.draw(data)
        self.renderer.update_scene(data, self._camera)
        return self.renderer.render()
