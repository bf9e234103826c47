"""Known dynamics by name, to be put in series with a structure.

    servo = blocks.second_order("servo", omega=(200.0, 2.0), zeta=(0.7, 0.01))
    known = helisim.in_series(structures.rollpitch, inputs={"lat": servo, "lon": servo})

A number is exact (62.0), has a standard error ((62.0, 1.0)), or is left out to be fitted.
Blocks of the same name share their parameters, such as "servo_omega".
"""

import math
from collections.abc import Sequence
from typing import Any

from helisim.base.settings import Limits, convert
from helisim.ident.structure import BLOCKS, Parameter, Structure, with_blocks

__all__ = ["delay", "first_order", "low_pass", "second_order", "with_blocks"]

Known = float | tuple[float, ...] | None  # Value, value and standard error, or None to be fitted

_FREQUENCY = (1.0, 1e4)  # rad/s: from a slow hydraulic actuator to a fast filter


def first_order(name: str = "lag", *, tau: Known = None) -> Structure:
    """Return 1 / (tau s + 1), tau in s."""
    lag = _parameter(f"{name}_tau", "s", tau, 0.05, (1e-4, 2.0), "time constant")
    return _block(name, "first-order lag", lag, M=((lag.name,),), F=(("-1",),), G=(("1",),))


def second_order(name: str = "servo", *, omega: Known = None, zeta: Known = None) -> Structure:
    """Return omega^2 / (s^2 + 2 zeta omega s + omega^2), omega in rad/s."""
    frequency = _parameter(f"{name}_omega", "rad/s", omega, 60.0, _FREQUENCY, "natural frequency")
    damping = _parameter(f"{name}_zeta", "1", zeta, 0.7, (0.05, 5.0), "damping ratio")
    sections = _sections(frequency.name, [damping.name])
    return _block(name, "second order", frequency, damping, **sections)


def low_pass(name: str = "filter", *, corner: Known = None, order: int = 2) -> Structure:
    """Return a Butterworth filter of order 1 to 8, 3 dB down at its corner, rad/s."""
    convert(int, order, "order of the low-pass", Limits(low=1, high=8))
    edge = _parameter(f"{name}_corner", "rad/s", corner, 60.0, _FREQUENCY, "corner, 3 dB down")
    angles = [math.pi * (2 * k + 1) / (2 * order) for k in range(order // 2)]
    sections = _sections(edge.name, [repr(math.sin(angle)) for angle in angles], odd=order % 2)
    return _block(name, f"Butterworth low-pass of order {order}", edge, **sections)


def delay(name: str = "late", *, tau: Known = None) -> Structure:
    """Return e^(-tau s), tau in s."""
    late = _parameter(f"{name}_tau", "s", tau, 0.0, (-0.3, 0.3), "delay", scale=0.03)
    return _block(name, "delay", late, H0=((),), D=(("1",),), input_delays={"u": late.name})


BLOCKS |= {one.__name__: one for one in (first_order, second_order, low_pass, delay)}


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
    given = known if isinstance(known, tuple) else (known,)
    value, error = convert(tuple[float, float], (*given, 0.0) if len(given) == 1 else given, name)
    return Parameter(name, unit, value, None, meaning, scale, fixed=True, error=error)


def _sections(omega: str, dampings: Sequence[str], *, odd: int = 0) -> dict[str, Any]:
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
