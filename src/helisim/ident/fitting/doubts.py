"""Says of a fit that looks good why it is not to be believed beyond its responses."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from helisim.base.errors import IdentificationError
from helisim.ident.fitting.order import FAST, order
from helisim.ident.model.transfer import coefficients

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit

_RATIO = 10.0
"""Of noise's power, from which what a model leaves is far more than noise."""
_PERCENT = 5.0
"""Relative error of a response beyond noise, from which it is worth a word."""


def doubts(fit: "Fit") -> Iterator[str]:
    """Yield what makes a converged fit doubtful that its cost doesn't show, a line each.

    That is an unstable pole in the upper part of the band, which with too long a delay stands for
    a lag that the structure lacks; and errors many times noise, with the order that would follow.
    """
    if fit.degenerate:
        return
    larger = _larger(fit)
    advice = f"; try --structure {larger}" if larger else "; try a structure with more states"
    fast = _fast(fit)
    if fast:
        yield (
            f"an unstable pole at {fast:.3g} rad/s, where the band ends at {fit.band[1]:.3g}: "
            "hardly the vehicle's, it makes up with the delay for a lag that the structure "
            f"lacks{advice}"
        )
        return
    left = fit.misfit
    if left is None or left.ratio is None or left.ratio < _RATIO or not left.percent:
        return
    worst = max(left.percent, key=lambda name: left.percent[name])
    if left.percent[worst] < _PERCENT:
        return
    yield (
        f"{worst} is off by {left.percent[worst]:.2g} % rms where noise explains little of it: "
        f"modes and derivatives can be off by more than their errors say{advice}"
    )


def _fast(fit: "Fit") -> float:
    """Return the fastest unstable pole in the band's upper part or above, rad/s, or 0."""
    try:
        poles = [one.value for one in fit.modes.poles]
    except IdentificationError:
        return 0.0
    fast = [abs(one) for one in poles if one.real > 0.0 and abs(one) > FAST * fit.band[1]]
    return max(fast, default=0.0)


def _larger(fit: "Fit") -> str:
    """Return the transfer function that would follow where one doesn't, or nothing."""
    form = coefficients(fit.structure)
    if form is None or any(one.fixed for one in fit.structure.parameters):
        return ""
    data = fit.data
    (low, high), begun = fit.band, (form.zeros, form.poles)
    o, i = data.index(fit.structure.outputs[0], fit.structure.inputs[0])
    inside = (data.frequency >= low * (1 - 1e-9)) & (data.frequency <= high * (1 + 1e-9))
    inside &= data.usable()[o, i]
    if np.count_nonzero(inside) < 2:
        return ""
    found = order(
        data.frequency[inside],
        data.response[o, i, inside],
        begun=begun,
        enough=_PERCENT / 100.0,
    )
    return f"tf:{found[0]}/{found[1]}" if found != begun else ""
