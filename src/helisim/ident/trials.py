"""Reports likely causes of a failing fit: units, signs, columns, delays, by trial fits."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, islice
from typing import Any

import numpy as np

from helisim.base.errors import HelisimError
from helisim.base.note import Note, Option
from helisim.ident.diagnosis import DEGREES
from helisim.ident.fit import identify
from helisim.ident.response import FrequencyResponse
from helisim.ident.result import Fit

_MORE_DELAY = (0.025, 0.05, 0.1, 0.2)  # s, of trial delays that are fixed, at a bound, or missing
_BETTER = 0.3  # greatest share of the cost that a trial may leave
_TOLD, _CLOSE = 3, 3.0  # Trials reported: most, and largest cost over the best one's
_TRIALS, _LARGEST, _SEARCHES = 24, 12, 3


def suspicions(fit: Fit) -> tuple[Note, ...]:
    """Return the likely causes of a failing fit, the clearest first; takes some seconds."""
    if fit.acceptable:
        return ()
    data, better = replace(fit.data, scatter=None, direct=None), []
    if len(fit.structure.free) <= _LARGEST:
        base = _cost(fit, data)
        for note, changed in islice(_trials(fit, data), _TRIALS):
            cost = _cost(fit, changed)
            if cost < _BETTER * base:
                text = f"{note.text}: J would be {cost:.3g}, not {base:.3g}"
                better.append((cost, replace(note, text=text)))
    better.sort(key=lambda pair: pair[0])
    tried = [one for cost, one in better[:_TOLD] if cost < _CLOSE * better[0][0] + 1.0]
    # wrong units, columns and delays show at an edge of the band, too
    return (*tried, *(one for one in fit.shapes if not tried or one.kind == "coherence"))


def _cost(fit: Fit, data: FrequencyResponse) -> float:
    try:
        return identify(
            data,
            fit.structure,
            band=fit.band,
            searches=_SEARCHES,
            weighting="coherence",
            responses=fit.options.get("responses"),
            frequencies_per_response=fit.options.get("frequencies_per_response", 20),
        ).cost
    except HelisimError:
        return math.inf


def _trials(fit: Fit, data: FrequencyResponse) -> Iterator[tuple[Note, FrequencyResponse]]:
    structure = fit.structure
    outputs = [(name, k) for k, name in enumerate(data.outputs) if name in structure.outputs]
    inputs = [(name, k) for k, name in enumerate(data.inputs) if name in structure.inputs]

    def scaled(axis: int, number: int, factor: Any) -> FrequencyResponse:
        response = data.response.copy()
        np.moveaxis(response, axis, 0)[number] *= factor
        return replace(data, response=response)

    def note(kind: str, text: str, *columns: str) -> Note:
        return Note(kind, text, tuple(Option("channel", one) for one in columns))

    for name, number in inputs:
        known = fit.parameters.get(structure.input_delays.get(name, ""))
        if known is not None and not known.fixed and not known.at_bound:
            continue
        for delay in _MORE_DELAY:
            text = f"with a delay of {name} longer by about {delay:g} s"
            if known is None:
                said = Note("delay", f"{text}; the structure has none there: give it one")
            else:
                said = Note(
                    "delay", text, (Option("fix", f"{known.name}={known.value + delay:.3g}"),)
                )
            yield said, scaled(1, number, np.exp(1j * data.frequency * delay))
    for axis, signals in enumerate((outputs, inputs)):
        for (one, a), (other, b) in combinations(signals, 2):
            order = np.arange(data.response.shape[axis])
            order[[a, b]] = b, a
            taken = {
                field: np.take(getattr(data, field), order, axis=axis)
                for field in ("response", "coherence", "random_error")
            }
            text = f"with the columns of {one} and {other} swapped"
            columns = f"{one}=COLUMN_OF_{other}", f"{other}=COLUMN_OF_{one}"
            yield note("columns", text, *columns), replace(data, **taken)
        for name, number in signals:
            text = f"with {name}'s sign the other way"
            yield note("sign", text, f"{name}=COLUMN:UNIT:sign=-1"), scaled(axis, number, -1.0)
    for name, number in outputs:
        unit = data.output_units[number]
        units = (unit, unit.replace("rad", "deg"))
        for factor, (said, was) in ((DEGREES, units), (1.0 / DEGREES, units[::-1])):
            if unit in ("rad", "rad/s"):
                text = f"with {name}'s column in {said}, not {was}"
                yield note("unit", text, f"{name}=COLUMN:{said}"), scaled(0, number, factor)
