"""Transfer functions with a delay as structures."""

from typing import NamedTuple

from helisim.base.errors import InputError
from helisim.ident.structure import DELAYS, MATRICES, Parameter, Structure

_DELAY_BOUNDS = (-0.3, 5.0)  # s; searches look as far as `rational.delay_grid`


def delay_parameter(name: str, meaning: str) -> Parameter:
    """Return a delay of either sign."""
    return Parameter(name, "s", 0.0, _DELAY_BOUNDS, meaning, 0.03)


def transfer_function(
    *,
    zeros: int,
    poles: int,
    input: str,
    output: str,
    delay: str | None = "tau",
    name: str | None = None,
    frequency: float = 5.0,
) -> Structure:
    """Return (b_m s^m + ... + b0) e^(-tau s) / (s^n + a_(n-1) s^(n-1) + ... + a0).

    `zeros` is m, `poles` n >= m; `delay` is its name or None; starts are at `frequency`, rad/s.
    """
    if not 0 <= zeros <= poles:
        raise InputError(
            f"a transfer function has {zeros} zeros and {poles} poles; expected 0 <= zeros <= poles"
        )
    starts = [1.0, 2.0**0.5] if poles == 2 else [1.0]  # of well-damped poles
    for k in range(len(starts) - 1, poles - 1):
        starts.append(starts[-1] * (poles - k) / (k + 1.0))
    numerator = [Parameter(f"b{k}", "", 1.0, None, f"numerator, s^{k}") for k in range(zeros + 1)]
    denominator = [
        Parameter(
            f"a{k}",
            "1/s" if poles - k == 1 else f"1/s^{poles - k}",
            starts[k] * frequency ** (poles - k),
            None,
            f"denominator, s^{k}",
        )
        for k in range(poles)
    ]
    late = [delay_parameter(delay, "delay")] if delay else []
    gains = [f"b{k}" if k <= zeros else "0" for k in range(poles)]
    if zeros == poles:
        gains = [f"b{k} - a{k}*b{poles}" for k in range(poles)]
    # observable form: the numerator enters G alone, so it is solved from the data first
    rows = [["1" if j == k - 1 else "0" for j in range(poles)] for k in range(poles)]
    for k in range(poles):
        rows[k][-1] = f"-a{k}"
    return Structure(
        name=name or f"{output}_over_{input}",
        meaning=f"transfer function with {zeros} zeros and {poles} poles",
        parameters=(*reversed(numerator), *reversed(denominator), *late),
        states=tuple(f"x{k}" for k in range(poles)),
        inputs=(input,),
        outputs=(output,),
        F=tuple(map(tuple, rows)),
        G=tuple((gain,) for gain in gains),
        H0=(("0",) * (poles - 1) + ("1",) * (poles > 0),),
        D=((f"b{poles}" if zeros == poles else "0",),),
        input_delays={input: delay} if delay else {},
    )


class Rational(NamedTuple):
    """Orders of a transfer function, its delay, and its coefficients, numerator first, s^0 up."""

    zeros: int
    poles: int
    delay: str | None
    names: tuple[str, ...]


def rational_form(structure: Structure) -> Rational | None:
    """Return the form of what `transfer_function` made, else None."""
    if len(structure.inputs) != 1 or len(structure.outputs) != 1:
        return None
    delay = structure.input_delays.get(structure.inputs[0])
    if delay not in (None, *structure.names):  # an expression, such as that of a block in series
        return None
    poles = len(structure.states)
    zeros = len(structure.names) - poles - 1 - (delay is not None)
    if not 0 <= zeros <= poles:
        return None
    (input_,), (output,) = structure.inputs, structure.outputs
    made = transfer_function(zeros=zeros, poles=poles, input=input_, output=output, delay=delay)
    parts = ("names", *MATRICES, *DELAYS)
    if any(getattr(structure, part) != getattr(made, part) for part in parts):
        return None
    names = (*(f"b{k}" for k in range(zeros + 1)), *(f"a{k}" for k in range(poles)))
    return Rational(zeros, poles, delay, names)
