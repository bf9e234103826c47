"""Code that draws off screen, in a process of its own.

MuJoCo reads MUJOCO_GL once, and an abort in a graphics driver must not take the tests with it.
"""

import os
import subprocess
import sys

import pytest

NONE = 77  # status of a process that has no graphics
_CONTEXT = f"""
import sys
try:
    import mujoco
    mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
except Exception as error:
    print(f"{{type(error).__name__}}: {{error}}")
    sys.exit({NONE})
"""


def draws(code: str, *arguments: str) -> None:
    """Run Python with the first of MuJoCo's off-screen backends that works; skip without one."""
    reasons = []
    for backend in dict.fromkeys([os.environ.get("MUJOCO_GL") or "egl", "egl", "osmesa"]):
        run = subprocess.run(
            [sys.executable, "-c", _CONTEXT + code, *arguments],
            env={**os.environ, "MUJOCO_GL": backend},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        if run.returncode == 0:
            return
        assert run.returncode == NONE, run.stderr
        reasons.append(f"{backend}: {run.stdout.strip()}")
    pytest.skip(f"no off-screen GL (install libegl1 libgl1, or libosmesa6): {'; '.join(reasons)}")


def on_display(folder, *command, more=()):
    """Run a command in a folder on a virtual display; its Python imports from `more`, too."""
    paths = os.pathsep.join([*sys.path, *more])
    return subprocess.run(
        ["xvfb-run", "-a", "-s", "-screen 0 640x480x24", *command],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += max(seconds, 1e-3)
