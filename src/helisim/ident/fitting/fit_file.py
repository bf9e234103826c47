"""A fit as plain data for JSON, and back."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from helisim.base.errors import IdentificationError, InputError
from helisim.ident.fitting.fitted import FittedParameter, matrix_from_plain, matrix_to_plain
from helisim.ident.fitting.misfit import Misfit
from helisim.ident.model.structure import Structure
from helisim.ident.response import FrequencyResponse

if TYPE_CHECKING:
    from helisim.ident.fitting.result import Fit

FORMAT = "helisim fit, version 1"
"""What `Fit.to_dict` writes and `Fit.from_dict` reads."""


def fit_to_plain(fit: "Fit") -> dict[str, Any]:
    """Return plain data for JSON that `fields_from_plain` reads back without loss."""
    return {
        "format": FORMAT,
        "structure": fit.structure.to_dict(),
        "parameters": [one.to_dict() for one in fit.parameters.values()],
        "correlation": fit.correlation.tolist(),
        **({} if fit.covariance is None else {"covariance": matrix_to_plain(fit.covariance)}),
        **({} if fit.carried is None else {"carried": fit.carried.tolist()}),
        **({} if fit.misfit is None else {"misfit": fit.misfit.to_dict()}),
        "correlated": [list(pair) for pair in fit.correlated],
        "cost": fit.cost,
        "costs": dict(fit.costs),
        "band_rad_s": list(fit.band),
        "bands_rad_s": {name: list(edges) for name, edges in fit.bands.items()},
        "dropped": list(fit.dropped),
        "converged": fit.converged,
        "acceptable": fit.acceptable,
        "searches_agreeing": fit.searches_agreeing,
        "degenerate": list(fit.degenerate),
        "method": fit.method,
        "windows_s": list(fit.data.windows),
        "flags": list(fit.data.flags),
        "delays_s": fit.delays,
        "modes": _modes(fit),
        "provenance": fit.provenance,
        "data": fit.data.to_dict(),
    }


def _modes(fit: "Fit") -> dict[str, Any] | None:
    try:
        return fit.modes.to_dict()
    except IdentificationError:  # M is singular, so there are none
        return None


def fields_from_plain(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a fit's fields from what `fit_to_plain` gave.

    Raises:
        InputError: something is missing or of the wrong type.
    """
    if not isinstance(data, Mapping) or data.get("format") != FORMAT:
        received = data.get("format") if isinstance(data, Mapping) else type(data).__name__
        raise InputError(
            f"this isn't a fit that Fit.to_dict wrote: its format is {received!r}, "
            f"expected {FORMAT!r}"
        )
    try:
        structure = Structure.from_dict(data["structure"])
        parameters = [FittedParameter.from_dict(structure, one) for one in data["parameters"]]
        return {
            "structure": structure,
            "parameters": {one.name: one for one in parameters},
            "correlation": np.array(data["correlation"], dtype=np.float64).reshape(
                len(structure.free), len(structure.free)
            ),
            "costs": {name: float(cost) for name, cost in data["costs"].items()},
            "bands": {
                name: (float(low), float(high)) for name, (low, high) in data["bands_rad_s"].items()
            },
            "dropped": tuple(data["dropped"]),
            "converged": bool(data["converged"]),
            "searches_agreeing": int(data["searches_agreeing"]),
            "degenerate": tuple(data.get("degenerate", ())),
            "data": FrequencyResponse.from_dict(data["data"]),
            "covariance": matrix_from_plain(data.get("covariance"), len(structure.free)),
            "carried": _carried(data.get("carried"), structure),
            "misfit": Misfit.from_dict(data["misfit"]) if "misfit" in data else None,
            "options": data["provenance"].get("options", {}),
            "versions": data["provenance"]["versions"],
        }
    except KeyError as error:
        raise InputError(f"the fit lacks {error}") from None
    except InputError:
        raise
    except (TypeError, AttributeError, ValueError) as error:
        raise InputError(f"the fit holds something of the wrong type: {error}") from None


def _carried(rows: Sequence[Sequence[float]] | None, structure: Structure) -> Any:
    if rows is None:
        return None
    known = sum(one.error > 0.0 for one in structure.parameters)
    return np.array(rows, dtype=np.float64).reshape(len(structure.free), known)
