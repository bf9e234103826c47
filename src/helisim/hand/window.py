"""A window of GLFW with MuJoCo's own renderer: held keys, joystick, and a panel over the picture.

MuJoCo's passive viewer says when a key goes down, never when it goes up, and most letters switch
something in it; sticks need to know how long a key is held. So this is a window of its own.
"""

import warnings
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import DisplayError
from helisim.hand import HandFlight, Inputs
from helisim.hand.camera import Camera
from helisim.hand.draw import draw_panel
from helisim.hand.joysticks import Joystick, read_axes
from helisim.hand.panel import Panel
from helisim.vehicle.motion import root_body

_GEOMS = 4000
"""Room for all that a scene shows."""
_CROWDED_DPI = 1.5
"""Content scale from which on a screen's letters are drawn larger."""


def start_glfw() -> Any:
    """Return the glfw module, ready. Raises DisplayError."""
    try:
        import glfw
    except ImportError as error:
        raise DisplayError(f"can't open a window: {error}; pip install glfw") from None
    with warnings.catch_warnings(record=True) as reasons:
        warnings.simplefilter("always")
        if not glfw.init():
            why = str(reasons[-1].message) if reasons else "GLFW does not start"
            raise DisplayError(f"can't open a window: {why}")
    return glfw


class GlfwWindow:
    """Shows a flight by hand and reads keys and joystick.

    Attributes:
        user_scn: geoms that are drawn beside the model's.
        panel: drawn over the picture; None draws none.
    """

    def __init__(
        self,
        flight: HandFlight,
        joystick: Joystick | None = None,
        *,
        size: tuple[int, int] = (1200, 800),
    ) -> None:
        """Open the window, so many pixels wide and high. Raises DisplayError."""
        self._glfw = glfw = start_glfw()
        self._flight, self._joystick = flight, joystick
        self._held: set[str] = set()
        self._pressed: list[str] = []
        self.panel: Panel | None = None
        self.camera_kind = "behind"
        glfw.default_window_hints()
        glfw.window_hint(glfw.SAMPLES, int(flight.model.vis.quality.offsamples))
        with warnings.catch_warnings(record=True) as reasons:
            warnings.simplefilter("always")
            title = f"helisim: {flight.vehicle.name} by hand"
            self._window = glfw.create_window(*size, title, None, None)
        if not self._window:
            glfw.terminate()
            why = str(reasons[-1].message) if reasons else "no OpenGL"
            raise DisplayError(f"can't open a window: {why}")
        glfw.make_context_current(self._window)
        glfw.swap_interval(1)
        glfw.set_key_callback(self._window, self._on_key)
        glfw.set_window_focus_callback(self._window, self._on_focus)
        glfw.set_scroll_callback(self._window, self._on_scroll)
        model = flight.model
        crowded = glfw.get_window_content_scale(self._window)[0] > _CROWDED_DPI
        font = (
            mujoco.mjtFontScale.mjFONTSCALE_200 if crowded else mujoco.mjtFontScale.mjFONTSCALE_150
        )
        self._context = mujoco.MjrContext(model, font)
        self._scene = mujoco.MjvScene(model, maxgeom=_GEOMS)
        self.user_scn = mujoco.MjvScene(model, maxgeom=10)
        self._option = mujoco.MjvOption()
        self._camera = Camera(flight, root_body(model))
        self._zoom = 1.0

    def __enter__(self) -> "GlfwWindow":
        return self

    def __exit__(self, *_: object) -> None:
        self._context.free()
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def is_running(self) -> bool:
        """Return whether the window is still open."""
        return not self._glfw.window_should_close(self._window)

    def lock(self) -> AbstractContextManager[Any]:
        """Nothing else reads the state."""
        return nullcontext()

    def read(self) -> Inputs:
        """Return what keys and joystick report now."""
        self._glfw.poll_events()
        pressed, self._pressed = tuple(self._pressed), []
        axes = None if self._joystick is None else read_axes(self._glfw, self._joystick)
        return Inputs(frozenset(self._held), pressed, axes)

    def sync(self) -> None:
        """Show the present state."""
        self._camera.look(self.camera_kind)
        view = self._camera.view
        distance, view.distance = view.distance, view.distance * self._zoom
        self._draw(view)
        view.distance = distance
        self._glfw.swap_buffers(self._window)

    def picture(self) -> NDArray[np.uint8]:
        """Return what was shown last, of shape (height, width, 3), its first row on top."""
        width, height = self._glfw.get_framebuffer_size(self._window)
        pixels = np.zeros((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, width, height), self._context)
        return pixels[::-1]

    def _draw(self, view: mujoco.MjvCamera) -> None:
        model, data, scene = self._flight.model, self._flight.data, self._scene
        mujoco.mjv_updateScene(
            model, data, self._option, None, view, mujoco.mjtCatBit.mjCAT_ALL, scene
        )
        for geom in self.user_scn.geoms[: self.user_scn.ngeom]:
            shape = (geom.type, geom.size, geom.pos, geom.mat.flatten(), geom.rgba)
            mujoco.mjv_initGeom(scene.geoms[scene.ngeom], *shape)
            scene.ngeom += 1
        frame = mujoco.MjrRect(0, 0, *self._glfw.get_framebuffer_size(self._window))
        mujoco.mjr_render(frame, scene, self._context)
        if self.panel is not None:
            draw_panel(self.panel, frame, self._context)

    def _on_key(self, _window: Any, key: int, _code: int, action: int, _modifiers: int) -> None:
        name = self._key_name(key)
        if action == self._glfw.PRESS:
            self._held.add(name)
            self._pressed.append(name)
        elif action == self._glfw.RELEASE:
            self._held.discard(name)

    def _on_focus(self, _window: Any, focused: int) -> None:
        if not focused:  # a key that goes up elsewhere is never reported
            self._held.clear()

    def _on_scroll(self, _window: Any, _across: float, upwards: float) -> None:
        self._zoom = min(4.0, max(0.25, self._zoom * 0.9**upwards))

    def _key_name(self, key: int) -> str:
        glfw = self._glfw
        if glfw.KEY_A <= key <= glfw.KEY_Z:
            return chr(key).lower()
        return {
            glfw.KEY_LEFT: "left",
            glfw.KEY_RIGHT: "right",
            glfw.KEY_UP: "up",
            glfw.KEY_DOWN: "down",
            glfw.KEY_LEFT_SHIFT: "shift",
            glfw.KEY_RIGHT_SHIFT: "shift",
            glfw.KEY_BACKSPACE: "backspace",
            glfw.KEY_ESCAPE: "escape",
            glfw.KEY_F1: "f1",
        }.get(key, "")
