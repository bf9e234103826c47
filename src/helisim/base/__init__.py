"""Errors, units, values, files and settings; imports nothing else of helisim."""

import sys

_STEPS = 500  # of an episode: ten seconds of frames of 20 ms


def register() -> None:
    """Register helisim's environments, as `helisim.gym` does, if gymnasium has been imported."""
    known = sys.modules.get("gymnasium.envs.registration")
    if known is None:
        return
    for task in ("hover", "track"):
        name = f"helisim/{task.capitalize()}-v0"
        if name not in known.registry:
            known.register(
                name,
                entry_point="helisim.gym.environments:HelicopterEnv",
                vector_entry_point="helisim.gym.environments:HelicopterVectorEnv",
                max_episode_steps=_STEPS,
                kwargs={"task": task},
            )
