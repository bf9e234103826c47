"""Gymnasium environments `helisim/Hover-v0` and `helisim/Track-v0`, registered on import.

`gymnasium.make("helisim.gym:helisim/Hover-v0")` imports it by itself.
"""

try:
    import gymnasium.envs.registration  # noqa: F401  (helisim.base looks for it)
except ImportError as error:
    raise ImportError(f"helisim.gym needs gymnasium ({error}): pip install -e '.[gym]'") from None

from helisim.base import register
from helisim.gym.environments import HelicopterEnv, HelicopterVectorEnv
from helisim.gym.setup import USUAL, Setup, Spread, Start, WeatherRange
from helisim.gym.task import Hover, Observation, Situation, Task, Track

__all__ = [
    "USUAL",
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
