"""What was identified in the units that people read: degrees, feet, percent of a control's range.

Computed and stored is SI; these are for tables and text.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from helisim.base.user_units import CONTROL, Powers, UserUnits, parts
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.result import Fit
from helisim.ident.model.dimensions import dimensions
from helisim.ident.responses.response import FrequencyResponse
from helisim.ident.verifying.verification import Trace, Verification
from helisim.records.channels import signal_powers

_TIME = {"s": 1}


class ShownParameters(NamedTuple):
    """Parameters in other units than SI.

    Attributes:
        parameters: in the fit's order.
        notes: what a reader must know of their units, a line each.
    """

    parameters: tuple[FittedParameter, ...]
    notes: tuple[str, ...]


def fit_in(fit: Fit, units: UserUnits) -> ShownParameters:
    """Return a fit's parameters in the given units.

    Where a parameter stands says what its unit leaves out: N_ped in 1/s^2 is a yaw acceleration by
    the pedal, so deg/(s^2 %). What doesn't follow from the structure stays SI, and is told.
    """
    data = fit.data
    signals = dict(zip((*data.inputs, *data.outputs), (*data.input_units, *data.output_units)))
    full = dimensions(fit.structure, signals)
    found, apart, per_radian = [], [], []
    for one in fit.parameters.values():
        declared = parts(one.unit)
        powers = _agreed(declared, full.get(one.name))
        if powers is None:
            apart.append(one.name)
            found.append(one)
            continue
        if declared and "rad" not in declared and full.get(one.name, {}).get("rad", 0) < 0:
            per_radian.append(one.name)
        found.append(_scaled(one, *units.shown(powers)))
    notes = []
    if apart:
        notes.append(f"in SI, as the structure doesn't tell their units: {', '.join(apart)}")
    if per_radian and any(part == "rad" for part, *_ in units.chosen):
        notes.append(f"by a radian of what they multiply: {', '.join(per_radian)}")
    return ShownParameters(tuple(found), tuple(notes))


def response_in(frf: FrequencyResponse, units: UserUnits) -> FrequencyResponse:
    """Return a response in the given units, without its error model."""
    inputs = [_signal(name, unit, units, True) for name, unit in zip(frf.inputs, frf.input_units)]
    outputs = [
        _signal(name, unit, units, False) for name, unit in zip(frf.outputs, frf.output_units)
    ]
    factor = np.outer([many for _, many in outputs], [1.0 / many for _, many in inputs])
    return replace(
        frf,
        response=frf.response * factor[:, :, None],
        input_units=tuple(unit for unit, _ in inputs),
        output_units=tuple(unit for unit, _ in outputs),
        scatter=None,
        direct=None,
    )


def verification_in(found: Verification, units: UserUnits) -> Verification:
    """Return a verification with its outputs in the given units."""
    shown = [_signal(name, unit, units, False) for name, unit in zip(found.outputs, found.units)]
    factor = np.array([many for _, many in shown])
    rms = {name: x * many for (name, x), many in zip(found.j_rms_by_output.items(), factor)}
    return replace(
        found,
        units=tuple(unit for unit, _ in shown),
        traces=tuple(_trace_by(trace, factor) for trace in found.traces),
        j_rms=float(np.sqrt(np.mean(np.square(list(rms.values()))))),
        j_rms_by_output=rms,
    )


def _trace_by(trace: Trace, factor: np.ndarray) -> Trace:
    """Return a trace whose outputs are scaled, (n_out,) each."""
    scaled = {name: getattr(trace, name) * factor for name in ("measured", "predicted", "bias")}
    return replace(trace, **scaled, telling=trace.telling * factor)


def _signal(name: str, unit: str, units: UserUnits, is_input: bool) -> tuple[str, float]:
    powers = signal_powers(name, unit, is_input=is_input)
    return (unit, 1.0) if not powers else units.shown(powers)


def _agreed(declared: Powers | None, full: Powers | None) -> Powers | None:
    """Return a parameter's powers by its stated unit and by its place; None where unknown.

    An angle that the stated unit leaves out below the line stays a radian.
    """
    if full is None:
        return declared if declared == _TIME else None
    if declared is None:
        return full
    if any(declared.get(part, 0) != full.get(part, 0) for part in ("m", "s")):
        return None
    radian = full.get("rad", 0)
    if "rad" not in declared and radian < 0:
        radian = 0
    elif "rad" in declared and declared["rad"] != radian:
        return None
    found = {**declared, "rad": radian, CONTROL: full.get(CONTROL, 0)}
    return {part: power for part, power in found.items() if power}


def _scaled(one: FittedParameter, unit: str, factor: float) -> FittedParameter:
    if factor == 1.0 and one.unit:
        return one
    known = one.definition
    definition = replace(
        known,
        unit=unit,
        start=known.start * factor,
        bounds=None if known.bounds is None else _times(known.bounds, factor),
        scale=None if known.scale is None else known.scale * factor,
        error=known.error * factor,
    )
    return replace(
        one,
        definition=definition,
        value=one.value * factor,
        cramer_rao=one.cramer_rao * factor,
        insensitivity=one.insensitivity * factor,
        standard_error=one.standard_error * factor,
    )


def _times(bounds: Sequence[float], factor: float) -> tuple[float, float]:
    return bounds[0] * factor, bounds[1] * factor
