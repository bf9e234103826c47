"""Draws a panel over a picture with MuJoCo's renderer."""

import mujoco

from helisim.hand.panel import Panel

_BOX = 0.19
"""Side of a gimbal's box, of the smaller side of the window."""
_GAP, _DOT = 0.12, 0.10
"""Between boxes and around them, and side of the dot, of a box's side."""
_LINE = 0.012
"""Thickness of a line, of a box's side."""
_PAPER = (0.05, 0.06, 0.08, 0.55)
_GRID = (0.75, 0.78, 0.80, 0.45)
_INK = (0.9, 0.9, 0.9)
_STICK = (0.98, 0.55, 0.15, 1.0)
_MARK = (0.45, 0.75, 0.95, 0.9)


def draw_panel(panel: Panel, frame: mujoco.MjrRect, context: mujoco.MjrContext) -> None:
    """Draw a panel over a frame, the context being current."""
    _overlay(mujoco.mjtGridPos.mjGRID_TOPLEFT, panel.legend, frame, context)
    readout = panel.readout
    if panel.recorded is not None:
        readout = (("REC", f"{panel.recorded:.1f} s"), *readout)
    _overlay(mujoco.mjtGridPos.mjGRID_TOPRIGHT, readout, frame, context)
    _draw_gimbals(panel, frame, context)
    if panel.message:
        _overlay(mujoco.mjtGridPos.mjGRID_BOTTOMLEFT, ((panel.message, ""),), frame, context)


def _overlay(
    where: mujoco.mjtGridPos,
    rows: tuple[tuple[str, str], ...],
    frame: mujoco.MjrRect,
    context: mujoco.MjrContext,
) -> None:
    left, right = ("\n".join(column) for column in zip(*rows))
    mujoco.mjr_overlay(mujoco.mjtFont.mjFONT_NORMAL, where, frame, left, right, context)


def _draw_gimbals(panel: Panel, frame: mujoco.MjrRect, context: mujoco.MjrContext) -> None:
    side = round(_BOX * min(frame.width, frame.height))
    gap, label = round(_GAP * side), round(0.2 * side)
    first = frame.width - 2 * (side + gap)
    thumbs, names = panel.gimbals, panel.labels
    for k in range(2):
        box = (first + k * (side + gap), gap + label, side)
        _draw_box(box)
        if names[2 * k + 1] == "lift":
            _bar(box, panel.hover_collective)
        _dot(box, thumbs[2 * k], thumbs[2 * k + 1])
        text = f"{names[2 * k + 1]}, {names[2 * k]}"
        _rectangle(box[0], gap, side, label, _PAPER)  # what is written next is placed in it
        font = mujoco.mjtFont.mjFONT_NORMAL
        mujoco.mjr_text(font, text, context, 0.06, 0.25, *_INK)


def _draw_box(box: tuple[int, int, int]) -> None:
    left, bottom, side = box
    line = max(1, round(_LINE * side))
    _rectangle(left, bottom, side, side, _PAPER)
    _rectangle(left, bottom + (side - line) // 2, side, line, _GRID)
    _rectangle(left + (side - line) // 2, bottom, line, side, _GRID)


def _bar(box: tuple[int, int, int], height: float) -> None:
    """Mark where the collective is in the hover."""
    left, bottom, side = box
    dot = _DOT * side
    y = bottom + 0.5 * side + 0.5 * (side - dot) * height
    _rectangle(left, round(y - 0.02 * side), round(0.12 * side), round(0.04 * side), _MARK)


def _dot(box: tuple[int, int, int], across: float, upwards: float) -> None:
    left, bottom, side = box
    dot = round(_DOT * side)
    x, y = (0.5 * (side - dot) * (1.0 + one) for one in (across, upwards))
    _rectangle(left + round(x), bottom + round(y), dot, dot, _STICK)


def _rectangle(
    left: int, bottom: int, width: int, height: int, colour: tuple[float, float, float, float]
) -> None:
    mujoco.mjr_rectangle(mujoco.MjrRect(left, bottom, width, height), *colour)
