"""Data of a fit as they would be with another unit or sign, swapped columns or less delay."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from helisim.ident.model.structure import Structure
from helisim.ident.model.transfer import coefficients, transfer_function
from helisim.ident.response import FrequencyResponse

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit

Kind = Literal["delay", "sign", "band", "coherence", "unit", "columns", "order"]
"""Of a likely cause of a fit that fails."""

DEGREES = 180.0 / math.pi
_MORE_DELAY = (0.025, 0.05, 0.1, 0.2)
"""s, by which delays are tried that are fixed, at a bound, or not there."""


class Trial(NamedTuple):
    """Data as they would be, and what that means.

    Attributes:
        kind: of the cause.
        data: with it out of the way.
        text: what was changed.
        option: of the command line, that changes it.
        structure: to fit in place of the fit's, or None.
    """

    kind: Kind
    data: FrequencyResponse
    text: str
    option: str
    structure: Structure | None = None


def trials(fit: "Fit", data: FrequencyResponse) -> list[Trial]:
    """Return what is worth a trial: orders and delays first, columns, signs, units.

    Args:
        fit: that fails.
        data: its frequency response, without its scatter.
    """
    return [*_orders(fit, data), *_delays(fit, data), *_columns(fit, data)]


def _columns(fit: "Fit", data: FrequencyResponse) -> list[Trial]:
    """Return changed data: swapped columns first, then signs, then units."""
    outputs = [name for name in data.outputs if name in fit.structure.outputs]
    inputs = [name for name in data.inputs if name in fit.structure.inputs]
    found = []
    for names, axis in ((outputs, 0), (inputs, 1)):
        for one, other in combinations(names, 2):
            option = f"--channel {one}=COLUMN_OF_{other} --channel {other}=COLUMN_OF_{one}"
            text = f"with the columns of {one} and {other} swapped"
            found.append(Trial("columns", _swapped(data, axis, one, other), text, option))
    for names, axis in ((outputs, 0), (inputs, 1)):
        for name in names:
            option = f"--channel {name}=COLUMN:UNIT:sign=-1"
            text = f"with {name}'s sign the other way"
            found.append(Trial("sign", _scaled(data, axis, name, -1.0), text, option))
    for name in outputs:
        unit = data.output_units[data.outputs.index(name)]
        if unit not in ("rad", "rad/s"):
            continue
        degrees = unit.replace("rad", "deg")
        for factor, said, was in ((DEGREES, unit, degrees), (1.0 / DEGREES, degrees, unit)):
            option = f"--channel {name}=COLUMN:{said}"
            text = f"with {name}'s column in {said}, not {was}"
            found.append(Trial("unit", _scaled(data, 0, name, factor), text, option))
    return found


def _orders(fit: "Fit", data: FrequencyResponse) -> Iterator[Trial]:
    """Yield larger transfer functions than the one that was fitted."""
    form = coefficients(fit.structure)
    if form is None or any(one.fixed for one in fit.structure.parameters):
        return
    for zeros, poles in ((form.zeros, form.poles + 1), (form.zeros + 1, form.poles + 1)):
        larger = transfer_function(
            input=fit.structure.inputs[0],
            output=fit.structure.outputs[0],
            zeros=zeros,
            poles=poles,
        )
        option = f"--structure tf:{zeros}/{poles}"
        yield Trial("order", data, f"with {zeros} zeros and {poles} poles", option, larger)


def _delays(fit: "Fit", data: FrequencyResponse) -> Iterator[Trial]:
    """Yield data with less delay of inputs, where the structure's own can't have found it."""
    stuck = []
    for name in (one for one in data.inputs if one in fit.structure.inputs):
        parameter = fit.parameters.get(fit.structure.input_delays.get(name, ""))
        if parameter is None or parameter.fixed or parameter.at_bound:
            stuck.append((name, parameter))
    together = [stuck] if len(stuck) > 1 else []
    for group in [*together, *([one] for one in stuck)]:
        for delay in _MORE_DELAY:
            response = data.response.copy()
            for name, _ in group:
                response[:, data.inputs.index(name)] *= np.exp(1j * data.frequency * delay)
            known = [parameter for _, parameter in group if parameter is not None]
            option = " ".join(f"--fix {one.name}={one.value + delay:.3g}" for one in known)
            lacking = "" if known else "; the structure has none there: give it one"
            inputs = " and ".join(name for name, _ in group)
            text = f"with a delay of {inputs} longer by about {delay:g} s{lacking}"
            yield Trial("delay", replace(data, response=response), text, option)


def _scaled(data: FrequencyResponse, axis: int, name: str, factor: float) -> FrequencyResponse:
    """Return the response with an output, or an input, times a factor."""
    response = data.response.copy()
    if axis == 0:
        response[data.outputs.index(name)] *= factor
    else:
        response[:, data.inputs.index(name)] /= factor
    return replace(data, response=response)


def _swapped(data: FrequencyResponse, axis: int, one: str, other: str) -> FrequencyResponse:
    """Return the response with two outputs, or two inputs, in each other's place."""
    names = data.outputs if axis == 0 else data.inputs
    order = list(range(len(names)))
    a, b = names.index(one), names.index(other)
    order[a], order[b] = order[b], order[a]
    changed = {
        field: np.take(getattr(data, field), order, axis=axis)
        for field in ("response", "coherence", "random_error")
    }
    if axis == 0:
        changed["multiple_coherence"] = data.multiple_coherence[order]
    else:
        changed["cross_control_coherence"] = data.cross_control_coherence[np.ix_(order, order)]
    return replace(data, **changed)
