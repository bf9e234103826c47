"""Gymnasium environments: `helisim/Hover-v0` and `helisim/Track-v0`.

Importing this package registers them; so does `import helisim` behind `import gymnasium`, and a
module before the colon:

    gymnasium.make("helisim.gym:helisim/Hover-v0")
"""

try:
    import gymnasium.envs.registration  # noqa: F401  (helisim.base looks for it)
except ImportError as error:
    raise ImportError(f"helisim.gym needs gymnasium ({error}): pip install helisim[gym]") from None

from helisim.base import register
from helisim.gym.environments import HelicopterEnv, HelicopterVectorEnv
from helisim.gym.episodes import USUAL, Action, Spread
from helisim.gym.settings import Setup, Start, WeatherRange
from helisim.gym.task import Hover, Observation, Situation, Task, Track

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

register()
