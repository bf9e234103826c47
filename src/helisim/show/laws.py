"""What a control law is, in words, and the margins of a loop, as a table."""

import math

import numpy as np

from helisim.design.laws import Law
from helisim.handling.axis import axis_of
from helisim.handling.figures.margins import margins
from helisim.handling.figures.rejection import rejection
from helisim.handling.loop import Loop, NoResponse
from helisim.show.table import Cell, Column, Table, filled, number, words

_SLOWEST = 1e-6
"""rad/s: a pole slower than that is an integral."""


def law_text(law: Law, period: float) -> str:
    """Return what a law sees, commands and keeps, its poles at its ticks, and what is tuned.

    Args:
        law: of any kind.
        period: s, of its ticks.

    Raises:
        InputError: it can't tick so.
    """
    linear = law.linear(period).sampled
    lines = [
        f"{law.kind}: {', '.join(linear.inputs)} -> {', '.join(linear.outputs)}",
        f"{len(linear.a)} states, each {1e3 * period:g} ms",
    ]
    poles = [_pole(one, period) for one in _poles(linear.a)]
    lines += [filled(f"poles, rad/s: {', '.join(poles)}")] if poles else []
    tuned = law.parameters()
    width = max(map(len, tuned), default=0)
    lines += ["", *(f"{name:<{width}}  {value:.6g}" for name, value in tuned.items())]
    return "\n".join(lines).rstrip()


def _poles(a: np.ndarray) -> list[complex]:
    """Return the poles in the z-plane, one of each pair, the slowest first."""
    found = [complex(one) for one in np.linalg.eigvals(a) if one.imag >= 0.0]
    return sorted(found, key=lambda one: -abs(one))


def _pole(z: complex, period: float) -> str:
    if abs(z) < 1e-9:
        return "a tick's delay"
    s = np.log(z) / period
    if abs(s) < _SLOWEST:
        return "0"
    turning = f" +- {s.imag:.3g}j" if abs(s.imag) > _SLOWEST else ""
    return f"{s.real:.3g}{turning}"


def margins_table(loop: Loop) -> Table:
    """Return margins at the actuators and disturbance rejection of each axis that a loop closes."""
    rows = [row for axis in loop.axes if (row := _row(loop, axis))]
    return Table(
        "Loops",
        (
            Column("axis", left=True),
            Column("crossover", unit="rad/s"),
            Column("phase margin", unit="deg"),
            Column("gain margin", unit="dB"),
            Column("DRB", unit="rad/s"),
            Column("DRP", unit="dB"),
        ),
        tuple(rows),
    )


def _row(loop: Loop, axis: str) -> tuple[Cell, ...]:
    """Return an axis's figures, nothing where nothing comes back."""
    try:
        curve = loop.broken(axis)
        rejected = rejection(loop.disturbance(axis))
    except NoResponse:
        return ()
    if not np.any(np.abs(curve.response) > 1e-9):
        return ()
    cut = margins(curve)
    return (
        words(axis_of(axis).word, "name"),
        number(cut.crossover, ".2f"),
        number(math.degrees(cut.least_phase), ".1f"),
        number(cut.least_gain, ".2f"),
        number(rejected.bandwidth, ".2f"),
        number(rejected.peak, ".2f"),
    )
