"""Errors, units, values, files and settings, used by every package; imports nothing of helisim."""

import sys

_STEPS = 500
"""Of an episode: ten seconds of frames of 20 ms."""


def register() -> None:
    """Register `helisim/Hover-v0` and `helisim/Track-v0` if gymnasium has been imported.

    Entry points are texts, imported when an environment is made. Where gymnasium comes after
    helisim, `import helisim.gym` registers them.
    """
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
