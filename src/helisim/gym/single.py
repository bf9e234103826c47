"""One helicopter as a Gymnasium environment."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from helisim.gym.flights import Flights
from helisim.gym.picture import HEIGHT, MODES, WIDTH, Picture, render_modes
from helisim.gym.settings import Setup
from helisim.gym.spaces import Flown, action_space, observation_space

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
