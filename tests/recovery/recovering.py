"""What a user would get from an aircraft's records with default options, against its truth."""

import warnings
from dataclasses import dataclass

import numpy as np
from closed_loop import Aircraft
from numpy.typing import NDArray

from helisim import ident
from helisim.ident import Fit, FrequencyResponse, frequency_response, identify
from helisim.ident.frf import resolved_band
from helisim.records.record import FlightRecord


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovery:
    """One replicate."""

    fit: Fit
    excess: dict[str, float]  # |error| of each parameter over its bound
    points: NDArray[np.float64]  # |error| of each usable point over its stated error

    @property
    def inside(self) -> int:
        return sum(value <= 1.0 for value in self.excess.values())

    @property
    def share(self) -> float:
        """Share of the usable points within three stated errors of the truth."""
        return float(np.mean(self.points <= 3.0))


def recover(aircraft: Aircraft, seed: int, estimator: str = "local") -> Recovery:
    """Fly an aircraft and identify it as `helisim identify` does, without options or with one."""
    records = aircraft.fly(seed)
    frf = estimated(aircraft, records, estimator)
    fit = identify(frf, aircraft.structure)
    return Recovery(
        fit=fit, excess=excess(fit, aircraft), points=point_errors(frf, aircraft)[frf.usable()]
    )


def estimated(
    aircraft: Aircraft, records: list[FlightRecord], estimator: str = "local"
) -> FrequencyResponse:
    with warnings.catch_warnings():
        for name in ("ClosedLoop", "CrossControl", "RecordQuality"):
            category = getattr(ident, f"{name}Warning")
            warnings.simplefilter("ignore", category)  # the response's flags repeat them
        return frequency_response(
            records,
            inputs=aircraft.structure.inputs,
            outputs=aircraft.structure.outputs,
            band=resolved_band(records),
            estimator=estimator,
            reference=aircraft.rig.sticks if aircraft.closed else None,
        )


def excess(fit: Fit, aircraft: Aircraft) -> dict[str, float]:
    truth = aircraft.truth.items()
    return {name: abs(fit[name].value - value) / bound(fit, name) for name, value in truth}


def bound(fit: Fit, name: str) -> float:
    """Return CR or 3 standard errors, whichever is larger, in the parameter's unit."""
    return max(fit[name].cramer_rao, 3.0 * fit[name].standard_error)


def point_errors(frf: FrequencyResponse, aircraft: Aircraft) -> NDArray[np.float64]:
    """Return |H - H_true| / |H_true| over the stated error, (n_out, n_in, n_freq).

    Infinite where the true response is zero: no relative error is right there.
    """
    truth = aircraft.response(frf.frequency)
    with np.errstate(divide="ignore"):
        return np.abs(frf.response - truth) / np.abs(truth) / frf.random_error
