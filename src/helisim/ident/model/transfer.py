"""Transfer functions of any order with a delay, as structures."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.ident.model.structure import Parameter, Structure

_DELAY_BOUNDS = (-0.3, 5.0)
"""s: a skewed recorder can let a channel lead; two cycles of a large vehicle's slow band last as
long. How far a search looks depends on the band, see `rational.delay_grid`."""


class Coefficients(NamedTuple):
    """The names of a transfer function's parameters, from s^0 up; the delay's, if it has one."""

    numerator: tuple[str, ...]
    denominator: tuple[str, ...]
    delay: str | None

    @property
    def zeros(self) -> int:
        """Order of the numerator."""
        return len(self.numerator) - 1

    @property
    def poles(self) -> int:
        """Order of the denominator."""
        return len(self.denominator)

    @property
    def power(self) -> int:
        """The power of s by which the response is to be multiplied first: none."""
        return 0

    def values(
        self, numerator: NDArray[np.float64], denominator: NDArray[np.float64]
    ) -> dict[str, float]:
        """Return parameters for polynomials, each (n_order,) from s^0 up."""
        return {
            **dict(zip(self.numerator, numerator.tolist())),
            **dict(zip(self.denominator, denominator.tolist())),
        }


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

    Args:
        zeros: order m of the numerator.
        poles: order n of the denominator, at least m.
        input: name of the input.
        output: name of the output.
        delay: name of the delay, of either sign; None for no delay.
        name: name of the structure.
        frequency: rad/s, where the poles are first looked for.
    """
    if poles < 0 or not 0 <= zeros <= poles:
        raise InputError(
            f"a transfer function has {zeros} zeros and {poles} poles; expected 0 <= zeros <= poles"
        )
    numerator = [Parameter(f"b{k}", "", 1.0, None, f"numerator, s^{k}") for k in range(zeros + 1)]
    denominator = [
        Parameter(f"a{k}", "1/s" if poles - k == 1 else f"1/s^{poles - k}", start, None, meaning)
        for k in range(poles)
        for start, meaning in [(_butterworth(poles, frequency)[k], f"denominator, s^{k}")]
    ]
    wait = [delay_parameter(delay, "delay")] if delay else []
    feed = f"b{poles}" if zeros == poles else "0"
    gains = [f"b{k}" if k <= zeros and k < poles else "0" for k in range(poles)]
    if zeros == poles:
        gains = [f"b{k} - a{k}*b{poles}" for k in range(poles)]
    # Observable form: the numerator enters G alone, so it is solved from the data first.
    rows = []
    for k in range(poles):
        row = ["0"] * poles
        row[poles - 1] = f"-a{k}"
        if k > 0:
            row[k - 1] = "1"
        rows.append(tuple(row))
    return Structure(
        name=name or f"{output}_over_{input}",
        meaning=f"transfer function with {zeros} zeros and {poles} poles",
        parameters=(*reversed(numerator), *reversed(denominator), *wait),
        states=tuple(f"x{k}" for k in range(poles)),
        inputs=(input,),
        outputs=(output,),
        F=tuple(rows),
        G=tuple((gain,) for gain in gains),
        H0=(tuple("1" if k == poles - 1 else "0" for k in range(poles)),),
        D=((feed,),),
        input_delays={input: delay} if delay else {},
    )


def first_order_delay(*, input: str, output: str, name: str | None = None) -> Structure:
    """Return b0 e^(-tau s) / (s + a0)."""
    return transfer_function(zeros=0, poles=1, input=input, output=output, name=name)


def second_order_delay(
    *, input: str, output: str, zeros: int = 0, name: str | None = None
) -> Structure:
    """Return (b1 s + b0) e^(-tau s) / (s^2 + a1 s + a0); b1 only with `zeros=1`."""
    return transfer_function(zeros=zeros, poles=2, input=input, output=output, name=name)


def coefficients(structure: Structure) -> Coefficients | None:
    """Return the parameters of a structure that `transfer_function` made; None of any other."""
    names = structure.names
    poles = len(structure.states)
    zeros = len(names) - poles - 1
    delay = next(iter(structure.input_delays.values()), None)
    if delay not in (None, *names):  # an expression, such as that of a block in series
        return None
    zeros -= delay is not None
    if len(structure.inputs) != 1 or len(structure.outputs) != 1 or not 0 <= zeros <= poles:
        return None
    made = transfer_function(
        zeros=zeros,
        poles=poles,
        input=structure.inputs[0],
        output=structure.outputs[0],
        delay=delay,
        name=structure.name,
    )
    same = names == made.names and all(
        getattr(structure, part) == getattr(made, part)
        for part in (*"MFGD", "H0", "H1", "input_delays", "output_delays")
    )
    if not same:
        return None
    return Coefficients(
        tuple(f"b{k}" for k in range(zeros + 1)), tuple(f"a{k}" for k in range(poles)), delay
    )


def _butterworth(order: int, frequency: float) -> list[float]:
    """Return the denominator's coefficients a0, a1, ... of well-damped poles."""
    coefficients = {0: [], 1: [1.0], 2: [1.0, 2.0**0.5]}.get(order)
    if coefficients is None:
        coefficients = [1.0]
        for k in range(order - 1):
            coefficients.append(coefficients[-1] * (order - k) / (k + 1.0))
    return [c * frequency ** (order - k) for k, c in enumerate(coefficients)]


def delay_parameter(name: str, meaning: str) -> Parameter:
    """Return a delay of either sign."""
    return Parameter(name, "s", 0.0, _DELAY_BOUNDS, meaning, 0.03)
