"""What turbulence does to the base helicopter's parameters: joint and direct estimates of them.

The gyro and the pilot feed what a gust does to the motion back to the controls, so the direct
estimate carries their inverse; with the sticks as reference the gusts average out
(Bendat & Piersol, section 9.2.5; Tischler & Remple, chapter 5).

Slow gusts also move the point that is linearised about: a helicopter that holds its place in them
flies forwards, sideways, up and down through the air. What is to be recovered is the mean of its
derivatives over that air, not those of calm air.
"""

import itertools
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from helisim.errors import InputError
from helisim.ident import ClosedLoopWarning
from helisim.records.channels import IN2
from helisim.sim import FlightPlan, Recorder, Sweep, Weather, fly
from helisim.study.identification import identify_model
from helisim.study.models import HEAVE, ROLLPITCH_IN1, YAW_BASE, ModelSpec
from helisim.vehicle import Vehicle

MODELS = (replace(YAW_BASE, sweeps=("ped", "lat", "col")), ROLLPITCH_IN1, HEAVE)
"""Those of the base helicopter; yaw from more sweeps, which tell the gusts' sideslip apart."""

MAIN: tuple[str, ...] = ("N_r", "N_ped", "L_b", "M_a", "Z_w", "Z_col")
"""Their main parameters."""

SWEEPS = {
    "ped": Sweep(axis="ped", amplitude=0.04, band=(0.3, 6.0)),
    "lat": Sweep(axis="lat"),
    "lon": Sweep(axis="lon"),
    "col": Sweep(axis="col", amplitude=0.06),
}
"""Larger and slower than in calm air where the motion is slow and the gusts are strong."""


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter identified in turbulence.

    Attributes:
        model: its table.
        name: of the parameter.
        unit: of the values.
        calm: of the vehicle linearised in calm air.
        truth: mean of the vehicle linearised in the air that it flew through.
        joint: identified with the sticks as reference.
        joint_error: standard error that the joint estimate states.
        direct: identified from the servo commands alone.
    """

    model: str
    name: str
    unit: str
    calm: float
    truth: float
    joint: float
    joint_error: float
    direct: float

    @property
    def joint_percent(self) -> float:
        """Error of the joint estimate, percent."""
        return 100.0 * (self.joint / self.truth - 1.0)

    @property
    def direct_percent(self) -> float:
        """Error of the direct estimate, percent."""
        return 100.0 * (self.direct / self.truth - 1.0)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        percent = {"joint_percent": self.joint_percent, "direct_percent": self.direct_percent}
        return {**asdict(self), **percent}


def mean_derivatives(vehicle: Vehicle, weather: Weather, points: int = 3) -> dict[str, float]:
    """Return the main derivatives' mean over slow gusts of the weather's rms, by name.

    Gauss-Hermite quadrature over steady winds; 3 points an axis are exact to the fifth power of
    the wind's speed.

    Args:
        vehicle: whose derivatives.
        weather: whose steady wind and turbulence.
        points: an axis.

    Raises:
        TrimError: the vehicle can't hover in one of the winds.
    """
    if weather.dryden is None:
        return {name: weather.trimmed(vehicle).derivatives[name] for name in MAIN}
    nodes, weights = hermegauss(points)
    mean: dict[str, float] = dict.fromkeys(MAIN, 0.0)
    for at in itertools.product(range(points), repeat=3):
        wind = np.array(weather.wind_to) + np.array(weather.dryden.rms) * nodes[list(at)]
        there = vehicle.trimmed(height=weather.height, wind=tuple(wind)).derivatives
        share = float(np.prod(weights[list(at)]) / np.sum(weights) ** 3)
        mean = {name: mean[name] + share * there[name] for name in MAIN}
    return mean


def turbulence_study(
    vehicle: Vehicle,
    *,
    weather: Weather,
    flights: int = 10,
    seed: int = 1,
    jobs: int | None = None,
) -> tuple[Estimate, ...]:
    """Identify the base models from the same turbulent flights, joint and direct.

    Args:
        vehicle: to fly.
        weather: to fly in.
        flights: on each axis.
        seed: of pilots, sensors and air.
        jobs: threads; all processors if None.

    Raises:
        InputError: a number is out of range.
        TrimError: the vehicle can't hover in the wind.
        DivergedError: a flight left the validity of the model.
    """
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    truth = mean_derivatives(vehicle, weather)
    recorder = Recorder.of(vehicle)
    records = {
        axis: fly(
            vehicle,
            FlightPlan(excitation=sweep, recorder=recorder, weather=weather),
            count=flights,
            seed=seed,
            jobs=jobs,
        )
        for axis, sweep in SWEEPS.items()
    }

    def estimates(model: ModelSpec) -> Iterator[Estimate]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ClosedLoopWarning)  # it is what is studied
            joint = identify_model(replace(model, reference=IN2), records)
            direct = identify_model(replace(model, reference=()), records)
        for name in (one for one in joint.values if one in MAIN):
            yield Estimate(
                model=model.name,
                name=name,
                unit=joint[name].unit,
                calm=vehicle.derivatives[name],
                truth=truth[name],
                joint=joint[name].value,
                joint_error=joint[name].standard_error,
                direct=direct[name].value,
            )

    return tuple(one for model in MODELS for one in estimates(model))
