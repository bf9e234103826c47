"""Gymnasium environments: `helisim/Hover-v0` and `helisim/Track-v0`.

Importing this package registers them; so does a module before the colon:

    gymnasium.make("helisim.gym:helisim/Hover-v0")
"""

try:
    from gymnasium.envs.registration import register, registry
except ImportError as error:
    raise ImportError(f"helisim.gym needs gymnasium ({error}): pip install helisim[gym]") from None

from helisim.gym.agent import Action
from helisim.gym.settings import Setup, Start
from helisim.gym.single import HelicopterEnv
from helisim.gym.spread import USUAL, Spread
from helisim.gym.task import Hover, Observation, Situation, Task, Track
from helisim.gym.vector import HelicopterVectorEnv
from helisim.gym.weather import WeatherRange

__all__ = [
    "USUAL",
    "Action",
    "HelicopterEnv",
    "HelicopterVectorEnv",
    "Hover",
    "Observation",
    "Setup",
    "Situation",
    "Spread",
    "Start",
    "Task",
    "Track",
    "WeatherRange",
]

_STEPS = 500
"""Of an episode: ten seconds of frames of 20 ms."""

for _task in ("hover", "track"):
    if (_name := f"helisim/{_task.capitalize()}-v0") not in registry:
        register(
            _name,
            entry_point="helisim.gym.single:HelicopterEnv",
            vector_entry_point="helisim.gym.vector:HelicopterVectorEnv",
            max_episode_steps=_STEPS,
            kwargs={"task": _task},
        )
