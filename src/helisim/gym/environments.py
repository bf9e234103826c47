"""One helicopter, or many stepped natively in threads, as Gymnasium environments."""

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.gym.episodes import Action
from helisim.gym.flights import Flights
from helisim.gym.picture import HEIGHT, MODES, WIDTH, Picture, render_modes
from helisim.gym.settings import Setup
from helisim.gym.task import BOUND, Observation, Task


def observation_space(task: Task) -> Box:
    """Return what one agent may see, (n_observation,)."""
    shape = (len(task.observations),)
    return Box(-BOUND, BOUND, shape, np.float32)


def action_space() -> Box:
    """Return what one agent may do, (4,)."""
    return Box(-1.0, 1.0, (4,), np.float32)


class Flown:
    """What an environment tells of its flights, alone or many at once."""

    _flights: Flights

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Name, unit and scale of each number that is seen."""
        return self._flights.task.observations

    @property
    def actions(self) -> tuple[Action, ...]:
        """What each number of an action moves."""
        return self._flights.agent.actions

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that each episode draws factors for."""
        return self._flights.spread.names


Seen = NDArray[np.float32]


class HelicopterEnv(Flown, gymnasium.Env[Any, Any]):
    """One helicopter to fly: `gymnasium.make("helisim/Hover-v0")`.

    Args:
        render_mode: "rgb_array", "human" or None.
        width: of a picture, pixels.
        height: of a picture, pixels.
        settings: of a `Setup`, such as vehicle="jr700", action="servos".

    Attributes:
        setup: what the environment is made of.
        observations: name, unit and scale of each number that is seen.
        actions: what each number of an action moves.
        parameters: names of the parameters that each episode draws factors for.

    Raises:
        InputError: a setting that can't be, an unknown one, or no such render mode.
        DisplayError: there is no display to open a window on.
    """

    # not a ClassVar, as gymnasium declares it, and instances have their own
    metadata: dict[str, Any] = {"render_modes": list(MODES), "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        **settings: Any,
    ) -> None:
        self.setup = Setup.of(settings)
        self._flights = Flights(self.setup, 1, threads=1)
        self._picture = Picture.of(render_mode, self._flights.vehicle, width, height)
        self.render_mode = render_mode
        fps = round(1.0 / self._flights.frame)
        self.metadata = {"render_modes": render_modes(), "render_fps": fps}
        self.observation_space = observation_space(self._flights.task)
        self.action_space = action_space()

    @property
    def state(self) -> NDArray[np.float64]:
        """MuJoCo's full physics state, (n_state,)."""
        return self._flights.states[0].copy()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Start an episode; arguments as for `Flights.reset`.

        Returns:
            The observation, and "time" (s), "wind" towards north and east (m/s) and "factors" of
            `parameters`.
        """
        super().reset(seed=seed)
        (info,) = self._flights.reset([0], [self.np_random], options)
        self._show()
        return self._flights.look()[0], {"time": 0.0, **info}

    def step(self, action: NDArray[np.floating]) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly on by a frame.

        Args:
            action: (4,) from -1 to 1; beyond, it is cut off.

        Returns:
            Observation, reward, whether a limit was passed, False (`gymnasium.make` truncates),
            and "time" (s) and, at a limit, "ended": its name.
        """
        stepped = self._flights.step(np.asarray(action)[None], [self.np_random])
        info: dict[str, Any] = {"time": float(self._flights.time[0])}
        if stepped.why:
            info["ended"] = stepped.why[0]
        self._show()
        seen, reward = stepped.seen[0], float(stepped.reward[0])
        return seen, reward, bool(stepped.terminated[0]), False, info

    def render(self) -> NDArray[np.uint8] | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return a picture, (n_row, n_column, 3); None if a window shows it, or no mode is set."""
        if self._picture is None:
            gymnasium.logger.warn("no render_mode was given; rgb_array gives pictures")
            return None
        return self._picture.of_state(self._flights.states[0])

    def _show(self) -> None:
        if self.render_mode == "human":
            self.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._picture is not None:
            self._picture.close()
        self._flights.close()


Flags = NDArray[np.bool_]
_MODES = {mode.value: mode for mode in AutoresetMode}


class HelicopterVectorEnv(Flown, VectorEnv[Seen, NDArray[np.float32], NDArray[Any]]):
    """Helicopters to fly at once: `gymnasium.make_vec("helisim/Hover-v0", num_envs=64)`.

    Helicopter k of a seed flies, to the bit, as the single environment of seed + k, whatever the
    number of helicopters and threads.

    Args:
        num_envs: how many.
        max_episode_steps: after which an episode is truncated; None never does.
        autoreset_mode: "NextStep", "SameStep" or "Disabled", or gymnasium's `AutoresetMode`.
        render_mode: "rgb_array" or None.
        width: of a picture, pixels.
        height: of a picture, pixels.
        settings: of a `Setup`, such as vehicle="jr700", action="servos".

    Attributes:
        setup: what the environment is made of.

    Raises:
        InputError: a setting that can't be, or an unknown one.
    """

    # not a ClassVar, as gymnasium declares it, and instances have their own
    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        **settings: Any,
    ) -> None:
        for name, number in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if number is not None and not (isinstance(number, int) and number >= 1):
                raise InputError(f"{name} must be an integer of 1 or more, got {number!r}")
        self.setup = Setup.of(settings)
        self._mode = _mode(autoreset_mode)
        if render_mode == "human":
            raise InputError("a vector environment has no window: render_mode must be 'rgb_array'")
        self.num_envs = num_envs
        self._most = max_episode_steps
        self._flights = Flights(self.setup, num_envs)
        self._picture = Picture.of(render_mode, self._flights.vehicle, width, height)
        self.render_mode = render_mode
        fps = round(1.0 / self._flights.frame)
        self.metadata = {**self.metadata, "render_fps": fps, "autoreset_mode": self._mode}
        self.single_observation_space = observation_space(self._flights.task)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._randoms, self._seeds = map(list, zip(*(np_random() for _ in range(num_envs))))
        self._done = np.zeros(num_envs, dtype=np.bool_)
        self._steps = np.zeros(num_envs, dtype=np.int64)

    @property
    def states(self) -> NDArray[np.float64]:
        """MuJoCo's full physics states, (num_envs, n_state)."""
        return self._flights.states.copy()

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The random numbers of each helicopter."""
        return tuple(self._randoms)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The seed of each helicopter."""
        return tuple(self._seeds)

    def reset(  # pyright: ignore[reportIncompatibleMethodOverride]
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, dict[str, Any]]:
        """Start an episode of every helicopter, or of those in options["reset_mask"].

        Args:
            seed: of helicopter 0, the others count on; or one for each. None goes on drawing.
            options: as for `Flights.reset`, and "reset_mask": (num_envs,) bool.

        Raises:
            InputError: seeds or a mask of another length.
            UnknownNameError: no such option.
        """
        options = dict(options or {})
        rows = np.flatnonzero(self._mask(options.pop("reset_mask", None)))
        for row, one in enumerate(self._seeds_of(seed)):
            if one is not None and row in rows:
                self._randoms[row], self._seeds[row] = np_random(one)
        infos = self._restart(rows, {}, options)
        self._done[rows] = False
        return self._flights.look(), infos

    def step(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, actions: NDArray[np.floating]
    ) -> tuple[Seen, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Fly all on by a frame.

        Args:
            actions: (num_envs, 4) from -1 to 1; beyond, they are cut off.

        Returns:
            Observations (num_envs, n_observation); of each helicopter the reward, whether it
            passed a limit, whether it is out of time; and infos: "time" (s); "ended", of those
            that passed a limit, its name; of new episodes what `reset` says of them.

        Raises:
            InputError: actions of another shape, or not numbers; or an episode has ended and
                nothing resets it.
        """
        infos: dict[str, Any] = {}
        started = None
        if self._done.any():
            self._refuse_ended()
            started = self._done
            self._restart(np.flatnonzero(started), infos)
        stepped = self._flights.step(actions, self._randoms, started)
        self._steps += 1
        if started is not None:
            self._steps[started] = 0
        for row, name in stepped.why.items():
            self._add_info(infos, {"ended": name}, row)
        infos["time"], infos["_time"] = self._flights.time, np.ones(self.num_envs, dtype=np.bool_)
        truncated = np.zeros_like(stepped.terminated)
        if self._most is not None:
            truncated = self._steps >= self._most
        self._done = stepped.terminated | truncated
        seen = stepped.seen
        if self._mode is AutoresetMode.SAME_STEP and self._done.any():
            seen, infos = self._restarted(seen, infos)
        return seen, stepped.reward, stepped.terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each helicopter, (n_row, n_column, 3); None if no mode is set."""
        if self._picture is None:
            return None
        pictures = (self._picture.of_state(state) for state in self._flights.states)
        return tuple(picture for picture in pictures if picture is not None)

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads."""
        del kwargs
        if self._picture is not None:
            self._picture.close()
        self._flights.close()

    def _restart(
        self, rows: NDArray[np.intp], infos: dict[str, Any], options: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """Start episodes in some rows and add to `infos`."""
        facts = self._flights.reset(rows.tolist(), self._randoms, options)
        for row, fact in zip(rows.tolist(), facts):
            self._add_info(infos, {"time": 0.0, **fact}, row)
        self._steps[rows] = 0
        return infos

    def _restarted(self, seen: Seen, infos: dict[str, Any]) -> tuple[Seen, dict[str, Any]]:
        """Return observations and infos after the ended episodes started anew in the same step."""
        rows = np.flatnonzero(self._done)
        ended = {}
        for row in rows.tolist():
            final = {
                name: infos[name][row]
                for name in ("time", "ended")
                if name in infos and infos[f"_{name}"][row]
            }
            self._add_info(ended, {"final_obs": seen[row].copy(), "final_info": final}, row)
        for name in ("ended", "_ended"):  # of those that go on there is none
            infos.pop(name, None)
        infos.update(ended)
        self._restart(rows, infos)
        self._done = np.zeros_like(self._done)
        return self._flights.look(), infos

    def _refuse_ended(self) -> None:
        if self._mode is AutoresetMode.DISABLED:
            rows = np.flatnonzero(self._done).tolist()
            raise InputError(
                f"the episodes in rows {rows} have ended: reset them with "
                "options={'reset_mask': terminated | truncated}"
            )

    def _mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(
                f"reset_mask must be ({self.num_envs},) of bool with one true at least, got "
                f"{mask.dtype} {mask.shape}"
            )
        return mask

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            return [int(seed) + row for row in range(self.num_envs)]
        given = seed if isinstance(seed, Iterable) else ()
        seeds = [int(one) if isinstance(one, np.integer) else one for one in given]
        if len(seeds) != self.num_envs:
            raise InputError(
                f"seed must be an integer, or {self.num_envs}, one each, got {seed!r:.60}"
            )
        return seeds


def _mode(mode: str | AutoresetMode) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    if mode not in _MODES:
        raise UnknownNameError("autoreset_mode", mode, _MODES)
    return _MODES[mode]
