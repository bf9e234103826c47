"""Says why a fit may fail: what its data show of units, signs, columns, delays, bands and orders.

Two ways, both from the fit and its frequency response alone: the shape of what the model leaves,
and trials: the same structure fitted to the data as they would be with another unit or sign, with
columns swapped or less delay, and transfer functions of higher order.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, combinations, islice

import numpy as np

from helisim.base.errors import HelisimError
from helisim.base.note import Note, Option
from helisim.ident.diagnosis import DEGREES
from helisim.ident.fit import identify
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit
from helisim.ident.structure import Structure
from helisim.ident.transfer import rational_form, transfer_function

_MORE_DELAY = (0.025, 0.05, 0.1, 0.2)
"""s, by which delays are tried that are fixed, at a bound, or not there."""
_BETTER = 0.3
"""Of the cost, that a trial may leave at most to be worth a word."""
_TOLD, _CLOSE = 3, 3.0
"""Trials that are told: those that leave no more than three times as much as the best."""
_TRIALS = 24
_LARGEST = 12
"""Trials, and free parameters of a structure that is tried: so that it takes seconds at most."""
_SEARCHES = 3


_Trial = tuple[Note, FrequencyResponse, Structure]
"""What is changed, and the data or the structure as they would be."""


def suspicions(fit: Fit) -> tuple[Note, ...]:
    """Return the likely causes that a failing fit's data show, the clearest first.

    Fits the structure again to the data as they would be with other units or signs, and with
    columns swapped: a few seconds at most. An acceptable fit has none.

    Args:
        fit: that of `identify`.

    Returns:
        Notes of the kinds "delay", "sign", "band", "coherence", "unit", "columns" and "order".
    """
    if fit.acceptable:
        return ()
    tried = _tried(fit)
    # a wrong unit, column or delay shows at an edge of the band, too
    return (*tried, *(one for one in fit.shapes if not tried or one.kind == "coherence"))


def _tried(fit: Fit) -> tuple[Note, ...]:
    """Return the changes of the data with which the same structure fits far better."""
    if len(fit.structure.free) > _LARGEST:
        return ()
    data = replace(fit.data, scatter=None, direct=None)
    base = _cost(fit, data, fit.structure)
    better = []
    trials = chain(_orders(fit, data), _delays(fit, data), _swaps(fit, data), _factors(fit, data))
    for note, changed, structure in islice(trials, _TRIALS):
        cost = _cost(fit, changed, structure)
        if cost < _BETTER * base:
            text = f"{note.text}: J would be {cost:.3g}, not {base:.3g}"
            better.append((cost, replace(note, text=text)))
    better.sort(key=lambda pair: pair[0])
    return tuple(one for cost, one in better[:_TOLD] if cost < _CLOSE * better[0][0] + 1.0)


def _cost(fit: Fit, data: FrequencyResponse, structure: Structure) -> float:
    """Return the cost of a structure on data, fitted as `fit`; infinite where it can't be."""
    try:
        return identify(
            data,
            structure,
            band=fit.band,
            searches=_SEARCHES,
            weighting="coherence",
            responses=fit.options.get("responses"),
            frequencies_per_response=fit.options.get("frequencies_per_response", 20),
        ).cost
    except HelisimError:
        return math.inf


def _orders(fit: Fit, data: FrequencyResponse) -> Iterator[_Trial]:
    """Yield larger transfer functions than the one that was fitted."""
    form = rational_form(fit.structure)
    if form is None or not form.names or any(one.fixed for one in fit.structure.parameters):
        return
    (input_,), (output,) = fit.structure.inputs, fit.structure.outputs
    for zeros, poles in ((form.zeros, form.poles + 1), (form.zeros + 1, form.poles + 1)):
        larger = transfer_function(input=input_, output=output, zeros=zeros, poles=poles)
        remedy = (Option("structure", f"tf:{zeros}/{poles}"),)
        yield Note("order", f"with {zeros} zeros and {poles} poles", remedy), data, larger


def _delays(fit: Fit, data: FrequencyResponse) -> Iterator[_Trial]:
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
            known = [one for _, one in group if one is not None]
            remedy = tuple(Option("fix", f"{one.name}={one.value + delay:.3g}") for one in known)
            text = (
                f"with a delay of {' and '.join(n for n, _ in group)} longer by about {delay:g} s"
            )
            text += "" if known else "; the structure has none there: give it one"
            changed = replace(data, response=response)
            yield Note("delay", text, remedy), changed, fit.structure


def _swaps(fit: Fit, data: FrequencyResponse) -> Iterator[_Trial]:
    """Yield data with the columns of two outputs, or of two inputs, in each other's place."""
    for axis, known in ((0, fit.structure.outputs), (1, fit.structure.inputs)):
        names = data.inputs if axis else data.outputs
        for one, other in combinations([name for name in names if name in known], 2):
            order = list(range(len(names)))
            a, b = names.index(one), names.index(other)
            order[a], order[b] = b, a
            changed = {
                field: np.take(getattr(data, field), order, axis=axis)
                for field in ("response", "coherence", "random_error")
            }
            if axis:
                among = data.cross_control_coherence[np.ix_(order, order)]
                changed["cross_control_coherence"] = among
            else:
                changed["multiple_coherence"] = data.multiple_coherence[order]
            text = f"with the columns of {one} and {other} swapped"
            pairs = ((one, other), (other, one))
            remedy = tuple(Option("channel", f"{x}=COLUMN_OF_{y}") for x, y in pairs)
            yield Note("columns", text, remedy), replace(data, **changed), fit.structure


def _factors(fit: Fit, data: FrequencyResponse) -> Iterator[_Trial]:
    """Yield data of other signs first, then of angles in other units."""
    outputs = [name for name in data.outputs if name in fit.structure.outputs]
    inputs = [name for name in data.inputs if name in fit.structure.inputs]

    def scaled(name: str, factor: float) -> FrequencyResponse:
        response = data.response.copy()
        if name in outputs:
            response[data.outputs.index(name)] *= factor
        else:
            response[:, data.inputs.index(name)] /= factor
        return replace(data, response=response)

    def trial(kind: str, text: str, name: str, column: str, factor: float) -> _Trial:
        remedy = (Option("channel", f"{name}=COLUMN:{column}"),)
        return Note(kind, text, remedy), scaled(name, factor), fit.structure

    for name in (*outputs, *inputs):
        yield trial("sign", f"with {name}'s sign the other way", name, "UNIT:sign=-1", -1.0)
    for name in outputs:
        unit = data.output_units[data.outputs.index(name)]
        degrees = unit.replace("rad", "deg")
        tried: Sequence[tuple[float, str, str]] = (
            (DEGREES, unit, degrees),
            (1.0 / DEGREES, degrees, unit),
        )
        for factor, said, was in tried if unit in ("rad", "rad/s") else ():
            yield trial("unit", f"with {name}'s column in {said}, not {was}", name, said, factor)
