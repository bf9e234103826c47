"""Known dynamics by name, to be put in series with a structure.

    servo = blocks.second_order("servo", omega=(200.0, 2.0), zeta=(0.7, 0.01))
    known = helisim.in_series(structures.rollpitch, inputs={"lat": servo, "lon": servo})

A block is a structure of one input and one output. A number of it is known exactly (62.0), known
with a standard error ((62.0, 1.0), as from a bench, which a fit carries through to the parameters
that it finds), or left out for the fit to find. Blocks of the same name share their parameters.
"""

import math
from collections.abc import Sequence
from typing import Any

from helisim.base.errors import InputError
from helisim.ident.structure import BLOCKS, Parameter, Structure, with_blocks
from helisim.ident.structure import block_named as named
from helisim.ident.structure import read_block as read

__all__ = [
    "BLOCKS",
    "delay",
    "first_order",
    "inflow",
    "low_pass",
    "named",
    "read",
    "second_order",
    "with_blocks",
]

Known = float | tuple[float, float] | None
"""A value, a value and its standard error, or None for a parameter to find."""

_LAG = (1e-4, 2.0)
"""s: from far below a servo's lag to far above a rotor's inflow."""
_FREQUENCY = (1.0, 1e4)
"""rad/s: from a slow hydraulic actuator to a filter before fast samples."""


def first_order(name: str = "lag", *, tau: Known = None) -> Structure:
    """Return 1 / (tau s + 1): an actuator or a sensor with one time constant, s."""
    lag = _parameter(f"{name}_tau", "s", tau, 0.05, _LAG, "time constant")
    return _block(name, "first-order lag", lag, M=((lag.name,),), F=(("-1",),), G=(("1",),))


def second_order(name: str = "servo", *, omega: Known = None, zeta: Known = None) -> Structure:
    """Return omega^2 / (s^2 + 2 zeta omega s + omega^2), such as a servo's.

    Args:
        name: of the block, which begins its parameters' names: "servo_omega", "servo_zeta".
        omega: natural frequency, rad/s.
        zeta: damping ratio.
    """
    frequency = _parameter(f"{name}_omega", "rad/s", omega, 60.0, _FREQUENCY, "natural frequency")
    damping = _parameter(f"{name}_zeta", "1", zeta, 0.7, (0.05, 5.0), "damping ratio")
    sections = _sections(frequency.name, [damping.name])
    return _block(name, "second order", frequency, damping, **sections)


def low_pass(name: str = "filter", *, corner: Known = None, order: int = 2) -> Structure:
    """Return a Butterworth filter, such as a sensor's or the one before the samples.

    Args:
        name: of the block, which begins its parameter's name: "filter_corner".
        corner: where the gain is 3 dB down, rad/s.
        order: 1 to 8.

    Raises:
        InputError: no such order.
    """
    if order not in range(1, 9):
        raise InputError(f"the order of a low-pass is {order!r}, expected 1 to 8")
    edge = _parameter(f"{name}_corner", "rad/s", corner, 60.0, _FREQUENCY, "corner, 3 dB down")
    angles = [math.pi * (2 * k + 1) / (2 * order) for k in range(order // 2)]
    sections = _sections(edge.name, [repr(math.sin(angle)) for angle in angles], odd=order % 2)
    return _block(name, f"Butterworth low-pass of order {order}", edge, **sections)


def inflow(name: str = "inflow", *, tau: Known = None, C: Known = None) -> Structure:
    """Return (1 + tau s / C) / (1 + tau s): a load that comes 1 / C times too large, then decays.

    So a rotor's thrust follows its collective while the induced velocity, which takes the time
    tau, has not yet come: with the hub held, `structures.heave_inflow` is this block.

    Args:
        name: of the block, which begins its parameters' names: "inflow_tau", "inflow_C".
        tau: time constant of the induced velocity, s.
        C: lift deficiency, what stays of a load once the inflow has come.
    """
    lag = _parameter(f"{name}_tau", "s", tau, 0.1, _LAG, "time constant of the inflow")
    stays = _parameter(f"{name}_C", "1", C, 0.7, (0.05, 1.0), "lift deficiency")
    lead = ((f"{lag.name}/{stays.name}",),)
    matrices = {"M": ((lag.name,),), "F": (("-1",),), "G": (("1",),), "H1": lead}
    return _block(name, "first-order inflow", lag, stays, **matrices)


def delay(name: str = "late", *, tau: Known = None) -> Structure:
    """Return e^(-tau s): a transport or sampling delay, s."""
    late = _parameter(f"{name}_tau", "s", tau, 0.0, (-0.3, 0.3), "delay", scale=0.03)
    return _block(name, "delay", late, H0=((),), D=(("1",),), input_delays={"u": late.name})


BLOCKS |= {one.__name__: one for one in (first_order, second_order, low_pass, inflow, delay)}


def _parameter(
    name: str,
    unit: str,
    known: Known,
    start: float,
    bounds: tuple[float, float],
    meaning: str,
    scale: float | None = None,
) -> Parameter:
    if known is None:
        return Parameter(name, unit, start, bounds, meaning, scale)
    value, error = known if isinstance(known, tuple) else (known, 0.0)
    return Parameter(name, unit, float(value), None, meaning, scale, fixed=True, error=float(error))


def _sections(omega: str, dampings: Sequence[str], *, odd: int = 0) -> dict[str, Any]:
    """Return the matrices of second-order sections of one frequency in a row, a lag last if odd."""
    size = 2 * len(dampings) + odd
    rates = [["0"] * size for _ in range(size)]
    gains = [f"{omega}**2"] * len(dampings) + [omega] * odd
    for number, gain in enumerate(gains):
        x, v = 2 * number, min(2 * number + 1, size - 1)
        rates[v][x] = f"-{gain}"
        if v > x:
            rates[x][v], rates[v][v] = "1", f"-2*{dampings[number]}*{omega}"
        if number:  # driven by the section before, the first one by the input
            rates[v][x - 2] = gain
    drive = tuple((gains[0] if k == min(1, size - 1) else "0",) for k in range(size))
    last = 2 * len(gains) - 2
    seen = tuple("1" if k == last else "0" for k in range(size))
    return {"F": tuple(map(tuple, rates)), "G": drive, "H0": (seen,)}


def _block(name: str, meaning: str, *parameters: Parameter, **matrices: Any) -> Structure:
    states = tuple(f"x{k}" for k in range(len(matrices.get("F", ()))))
    names = {"name": name, "meaning": meaning, "states": states, "inputs": ("u",)}
    return Structure(
        parameters=parameters, outputs=("y",), **{"H0": (("1",),), **names, **matrices}
    )
