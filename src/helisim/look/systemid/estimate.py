"""Estimates the frequency responses that inferred fits need, those with the same inputs at once."""

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from helisim.ident import CrossControlWarning, FrequencyResponse, RecordQualityWarning
from helisim.ident.frf import ClosedLoopWarning, frequency_response
from helisim.look.systemid.fits import InferredFit
from helisim.records.record import FlightRecord

_OF_FLAGS = (CrossControlWarning, RecordQualityWarning, ClosedLoopWarning)
"""Warnings that are among the responses' flags."""


def estimate_fits(
    records: Sequence[FlightRecord],
    fits: Sequence[InferredFit],
    options: Mapping[str, Any] | None = None,
) -> tuple[FrequencyResponse, ...]:
    """Return the frequency response of each fit, by the joint input-output method.

    Args:
        records: one each sweep or part of it, as `Inferred.read` gives them.
        fits: to estimate responses for; they may share one.
        options: further ones of `frequency_response`, such as {"estimator": "windows"}.

    Raises:
        IdentificationError: the records are too short, or inputs moved as one.
    """
    groups: dict[tuple[frozenset[str], tuple[str, ...]], list[int]] = {}
    for k, fit in enumerate(fits):
        active = frozenset((*fit.inputs, *fit.conditioning))
        groups.setdefault((active, fit.reference), []).append(k)
    found: dict[int, FrequencyResponse] = {}
    for (active, reference), places in groups.items():
        mine = [fits[k] for k in places]
        inputs = tuple(dict.fromkeys(name for fit in mine for name in fit.inputs))
        with warnings.catch_warnings():
            for category in _OF_FLAGS:
                warnings.simplefilter("ignore", category)
            response = frequency_response(
                records,
                inputs=inputs,
                outputs=tuple(dict.fromkeys(name for fit in mine for name in fit.outputs)),
                conditioning=tuple(sorted(active - set(inputs))),
                reference=reference,
                band=(min(fit.band[0] for fit in mine), max(fit.band[1] for fit in mine)),
                **(options or {}),
            )
        found |= {k: _flagged(response, fits[k]) for k in places}
    return tuple(found[k] for k in range(len(fits)))


def _flagged(response: FrequencyResponse, fit: InferredFit) -> FrequencyResponse:
    """Return a response with the flags that are about a fit's signals, or about none."""
    mine = {*fit.inputs, *fit.outputs}
    mine |= {f"{output}/{input_}" for output in fit.outputs for input_ in fit.inputs}
    sensed = mine - set(fit.inputs)
    kept = []
    for flag in response.flags:
        names = {a or b for a, b in _SIGNAL.findall(flag)}
        # a command's steps are a controller's own, and those of pulses in whole microseconds
        if not names or names & (sensed if "spikes" in flag else mine):
            kept.append(flag)
    return replace(response, flags=tuple(kept))


_SIGNAL = re.compile(r"'([a-z]+)'(?!\))|\b([a-z]+/[a-z]+)\b")
"""A signal in quotes, or a response, in a flag; not a repair's name, as in repair='spikes')."""
