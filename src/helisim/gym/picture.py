"""Pictures of a helicopter, off screen or in MuJoCo's viewer, in real time."""

import os
import threading
import time
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DisplayError, InputError, UnknownNameError
from helisim.show.viewer import LiveFlight, Rotors, aim, check_display, open_window
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import root_body

_DRAWN = (
    mujoco.mjtState.mjSTATE_TIME
    | mujoco.mjtState.mjSTATE_QPOS
    | mujoco.mjtState.mjSTATE_QVEL
    | mujoco.mjtState.mjSTATE_ACT
)
"""The head of a full physics state, all that a picture needs."""
MODES = ("human", "rgb_array")
WIDTH, HEIGHT = 640, 480
_CLOSING = 5.0
"""s that a window may take to close."""


def render_modes() -> list[str]:
    """Return the render modes that this machine has: without a display there is no window."""
    try:
        check_display()
    except DisplayError:
        return ["rgb_array"]
    return list(MODES)


class Picture:
    """Draws a vehicle in a state: its parts, the pad, and rotors that turn.

    Args:
        mode: "rgb_array" or "human".
        vehicle: to be drawn.
        width: pixels.
        height: pixels.

    Raises:
        UnknownNameError: no such mode.
        InputError: a width or height below one pixel.
        DisplayError: there is nothing to draw on.
    """

    def __init__(self, mode: str, vehicle: Vehicle, width: int, height: int) -> None:
        if mode not in MODES:
            raise UnknownNameError("render_mode", mode, MODES)
        if not (isinstance(width, int) and isinstance(height, int) and min(width, height) > 0):
            raise InputError(f"a picture needs whole pixels, got {width!r} x {height!r}")
        if mode == "human":
            check_display()
        self._made = (mode, vehicle, width, height)
        model = self._model = vehicle.visual_model()
        self._data = mujoco.MjData(model)
        self._size = mujoco.mj_stateSize(model, _DRAWN)
        self._rotors = Rotors(model, vehicle.roles)
        if mode == "human":
            self._canvas: _Window | _Bitmap = _Window(model, self._data)
        else:
            self._canvas = _Bitmap(model, width, height)

    def __reduce__(self) -> tuple[type["Picture"], tuple[str, Vehicle, int, int]]:
        """Return how to make another: a canvas belongs to its process."""
        return Picture, self._made

    @classmethod
    def of(cls, mode: str | None, vehicle: Vehicle, width: int, height: int) -> "Picture | None":
        """Return what draws in a mode; None where there is no mode."""
        return None if mode is None else cls(mode, vehicle, width, height)

    def of_state(self, state: NDArray[np.float64]) -> NDArray[np.uint8] | None:
        """Draw a full physics state, (n_state,).

        Returns:
            Pixels, (n_row, n_column, 3), or None: a window shows them.
        """
        model, data = self._model, self._data
        with self._canvas.lock():
            mujoco.mj_setState(model, data, state[: self._size], _DRAWN)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_camlight(model, data)
            self._rotors.draw(data, None)
        return self._canvas.show(data)

    def close(self) -> None:
        """Close the window or free the bitmap; again does nothing."""
        self._canvas.close()


class _Bitmap:
    """A place in memory to draw on, with a graphics context of its own."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        self._model = model
        model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(height, model.vis.global_.offheight)
        try:
            self._gl: Any = _context_class()(width, height)
            self._gl.make_current()
            self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except Exception as error:  # each graphics stack has its own
            reason = " ".join(str(error).split())
            raise DisplayError(
                f"can't draw off screen: {reason}; set MUJOCO_GL to egl or osmesa, and install its "
                "library (Debian: apt-get install libegl1 libgl1)"
            ) from None
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(model, maxgeom=10_000)
        self._camera, self._option = mujoco.MjvCamera(), mujoco.MjvOption()
        aim(self._camera, model, root_body(model))
        self._pixels = np.empty((height, width, 3), dtype=np.uint8)

    def lock(self) -> AbstractContextManager[Any]:
        return nullcontext()

    def show(self, data: mujoco.MjData) -> NDArray[np.uint8]:
        everything = mujoco.mjtCatBit.mjCAT_ALL
        height, width, _ = self._pixels.shape
        frame = mujoco.MjrRect(0, 0, width, height)
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self._model, data, self._option, None, self._camera, everything, self._scene
        )
        mujoco.mjr_render(frame, self._scene, self._context)
        mujoco.mjr_readPixels(self._pixels, None, frame, self._context)
        return self._pixels[::-1].copy()

    def close(self) -> None:
        if self._gl is not None:
            self._gl.make_current()
            self._context.free()
            self._gl.free()
            self._gl = None


def _context_class() -> Any:
    """Return MuJoCo's graphics context, which needs a display by default; EGL needs none."""
    if "MUJOCO_GL" not in os.environ and "human" not in render_modes():
        from mujoco.egl import GLContext

        return GLContext
    return mujoco.GLContext


class _Window:
    """MuJoCo's viewer; pictures follow one another in real time."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._others = set(threading.enumerate())
        mujoco.mj_forward(model, data)
        self._viewer = open_window(LiveFlight(model, data))
        aim(self._viewer.cam, model, root_body(model))
        self._due, self._time = time.monotonic(), 0.0

    def lock(self) -> AbstractContextManager[Any]:
        return self._viewer.lock() if self._viewer.is_running() else nullcontext()

    def show(self, data: mujoco.MjData) -> None:
        if not self._viewer.is_running():
            return
        self._viewer.sync()
        passed = data.time - self._time
        self._time, now = data.time, time.monotonic()
        self._due = max(self._due + max(passed, 0.0), now)
        time.sleep(self._due - now)

    def close(self) -> None:
        self._viewer.close()
        for thread in set(threading.enumerate()) - self._others:
            thread.join(_CLOSING)
