"""Known dynamics by name, and a door that puts them in series with a structure.

    servo = blocks.second_order("servo", omega=(200.0, 2.0), zeta=(0.7, 0.01))
    known = helisim.in_series(structures.rollpitch, inputs={"lat": servo, "lon": servo})

A block is a structure of one input and one output. A number of it is known exactly (62.0), known
with a standard error ((62.0, 1.0), as from a bench, which a fit carries through to the parameters
that it finds), or left out for the fit to find. Blocks of the same name share their parameters.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from helisim.base.errors import InputError, UnknownNameError
from helisim.ident.model.series import in_series
from helisim.ident.model.structure import Parameter, Structure

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
    return _block(
        name, "first-order lag", (lag,), M=((lag.name,),), F=(("-1",),), G=(("1",),), H0=(("1",),)
    )


def second_order(name: str = "servo", *, omega: Known = None, zeta: Known = None) -> Structure:
    """Return omega^2 / (s^2 + 2 zeta omega s + omega^2), such as a servo's.

    Args:
        name: of the block, which begins its parameters' names: "servo_omega", "servo_zeta".
        omega: natural frequency, rad/s.
        zeta: damping ratio.
    """
    frequency = _parameter(f"{name}_omega", "rad/s", omega, 60.0, _FREQUENCY, "natural frequency")
    damping = _parameter(f"{name}_zeta", "1", zeta, 0.7, (0.05, 5.0), "damping ratio")
    return _sections(name, "second order", (frequency, damping), frequency.name, [damping.name])


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
    return _sections(
        name,
        f"Butterworth low-pass of order {order}",
        (edge,),
        edge.name,
        [repr(math.sin(angle)) for angle in angles],
        odd=bool(order % 2),
    )


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
    return _block(
        name,
        "first-order inflow",
        (lag, stays),
        M=((lag.name,),),
        F=(("-1",),),
        G=(("1",),),
        H0=(("1",),),
        H1=((f"{lag.name}/{stays.name}",),),
    )


def delay(name: str = "late", *, tau: Known = None) -> Structure:
    """Return e^(-tau s): a transport or sampling delay, s."""
    late = _parameter(f"{name}_tau", "s", tau, 0.0, (-0.3, 0.3), "delay", scale=0.03)
    return _block(name, "delay", (late,), D=(("1",),), input_delays={"u": late.name})


BLOCKS: dict[str, Callable[..., Structure]] = {
    "first_order": first_order,
    "second_order": second_order,
    "low_pass": low_pass,
    "inflow": inflow,
    "delay": delay,
}
"""The blocks by name."""

_NUMBERS = {
    "first_order": ("tau",),
    "second_order": ("omega", "zeta"),
    "low_pass": ("corner", "order"),
    "inflow": ("tau", "C"),
    "delay": ("tau",),
}
"""What each block is told by number."""


def named(kind: str) -> Callable[..., Structure]:
    """Return the function that makes a block. Raises UnknownNameError."""
    try:
        return BLOCKS[kind]
    except KeyError:
        raise UnknownNameError("block", kind, BLOCKS) from None


def read(text: str, name: str | None = None) -> Structure:
    """Read a block from text, such as "second_order:omega=62+-1,zeta=0.7".

    Args:
        text: the block's kind, and its numbers; "value+-error" has a standard error, what is left
            out is for a fit to find. "name=servo" names it.
        name: of the block, where the text has none; its kind if None.

    Raises:
        UnknownNameError: no such kind, or no such number of it.
        InputError: a number can't be read, or can't be.
    """
    kind, _, rest = text.partition(":")
    make = named(kind.strip())
    known = _NUMBERS[kind.strip()]
    given: dict[str, Any] = {"name": name or kind.strip()}
    for part in filter(None, (one.strip() for one in rest.split(","))):
        key, equals, number = (one.strip() for one in part.partition("="))
        if not equals or (key not in known and key != "name"):
            raise UnknownNameError(f"number of the block {kind.strip()!r}", key, (*known, "name"))
        given[key] = number if key == "name" else _number(number, key, text)
    return make(**given)


def with_blocks(structure: Structure, series: Mapping[str, str]) -> Structure:
    """Return a structure with blocks in series that are told in words.

    Args:
        structure: before whose inputs and behind whose outputs they come.
        series: signal, or several with commas between that share one block -> block as `read`
            takes it: {"lat,lon": "second_order:omega=62+-1,zeta=0.7"}. It has the signals' names
            if it has no name.

    Raises:
        UnknownNameError: no such signal, block or number.
        InputError: a number can't be read, or a signal has two blocks.
    """
    inputs: dict[str, Structure] = {}
    outputs: dict[str, Structure] = {}
    for signals, text in series.items():
        names = [one.strip() for one in signals.split(",") if one.strip()]
        block = read(text, "_".join(names))
        for signal in names:
            if signal not in (*structure.inputs, *structure.outputs):
                known = (*structure.inputs, *structure.outputs)
                raise UnknownNameError(f"signal of {structure.name!r}", signal, known)
            side = inputs if signal in structure.inputs else outputs
            if signal in side:
                raise InputError(f"{signal} has two blocks in series; put one after the other")
            side[signal] = block
    return in_series(structure, inputs=inputs, outputs=outputs)


def _number(text: str, key: str, whole: str) -> Known:
    value, sign, error = text.replace("±", "+-").partition("+-")
    try:
        if key == "order":
            return int(text)
        return (float(value), float(error)) if sign else float(value)
    except ValueError:
        raise InputError(
            f"{key} = {text!r} of the block {whole!r} isn't a number, such as 62 or 62+-1"
        ) from None


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


def _sections(
    name: str,
    meaning: str,
    parameters: tuple[Parameter, ...],
    omega: str,
    dampings: list[str],
    *,
    odd: bool = False,
) -> Structure:
    """Return second-order sections of one frequency one behind the other, a lag last if odd."""
    size = 2 * len(dampings) + odd
    rates = [["0"] * size for _ in range(size)]
    drive = ["0"] * size
    for number, damping in enumerate(dampings):
        x, v = 2 * number, 2 * number + 1
        rates[x][v] = "1"
        rates[v][x], rates[v][v] = f"-{omega}**2", f"-2*{damping}*{omega}"
        _drive(rates, drive, v, f"{omega}**2")
    if odd:
        rates[-1][-1] = f"-{omega}"
        _drive(rates, drive, size - 1, omega)
    last = size - 1 if odd else size - 2
    return _block(
        name,
        meaning,
        parameters,
        F=tuple(map(tuple, rates)),
        G=tuple((cell,) for cell in drive),
        H0=(tuple("1" if k == last else "0" for k in range(size)),),
    )


def _drive(rates: list[list[str]], drive: list[str], row: int, gain: str) -> None:
    """Drive a state by the section before, the first one by the input."""
    before = row - (row % 2) - 2
    if before < 0:
        drive[row] = gain
    else:
        rates[row][before] = gain


def _block(
    name: str, meaning: str, parameters: tuple[Parameter, ...], **matrices: Any
) -> Structure:
    rows = matrices.get("F", ())
    return Structure(
        name=name,
        meaning=meaning,
        parameters=parameters,
        states=tuple(f"x{k}" for k in range(len(rows))),
        inputs=("u",),
        outputs=("y",),
        **{"H0": ((),), **matrices},
    )
