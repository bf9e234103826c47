"""Replicates of closed-loop flights in a gust: how biased, how scattered, how well stated."""

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from plants import ROLLPITCH_IN1, fly_closed_loop

from helisim.ident import (
    ClosedLoopWarning,
    Fit,
    Structure,
    frequency_response,
    identify,
    structures,
)
from helisim.records.record import FlightRecord


@dataclass(frozen=True, kw_only=True)
class Case:
    """A plant under rate feedback, its four sweeps of 90 s, and how it is identified.

    Attributes:
        structure, truth: the plant.
        axes: the swept input of each flight.
        sticks: references outside the loop.
        gain: rate feedback, input unit per rad/s.
        gust: rms of the acceleration of each rate, rad/s^2, below 6 rad/s.
        noise: rms of the white noise of each rate, rad/s.
        sweep: lowest and highest frequency, rad/s.
        amplitude: of the sweep.
        band: of the identification, rad/s.
    """

    structure: Structure
    truth: Mapping[str, float]
    axes: tuple[str, ...]
    sticks: tuple[str, ...]
    gain: float
    gust: float
    noise: float
    sweep: tuple[float, float]
    amplitude: float
    band: tuple[float, float]

    def fly(self, seed: int) -> list[FlightRecord]:
        """Return the four records of one replicate."""
        return [
            fly_closed_loop(
                self.structure,
                self.truth,
                axis=axis,
                sticks=self.sticks,
                gain=self.gain,
                gust=self.gust,
                seed=1000 * seed + number,
                noise=dict.fromkeys(self.structure.outputs, self.noise),
                band=self.sweep,
                amplitude=self.amplitude,
            )
            for number, axis in enumerate(self.axes)
        ]

    def identify(self, records: list[FlightRecord], method: str) -> Fit:
        """Identify by "joint", "direct", or "joint by coherence" (CIFER's weights)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ClosedLoopWarning)
            frf = frequency_response(
                records,
                inputs=self.structure.inputs,
                outputs=self.structure.outputs,
                band=self.band,
                reference=None if method == "direct" else self.sticks,
            )
        weighting = "coherence" if method == "joint by coherence" else "error"
        return identify(frf, self.structure, searches=2, weighting=weighting)


CASES = {
    "yaw": Case(
        structure=structures.yaw_base,
        truth={"N_r": -0.75, "N_ped": 76.0, "tau_r_base": 0.02},
        axes=("ped",) * 4,
        sticks=("PED",),
        gain=0.05,
        gust=0.5,
        noise=0.01,
        sweep=(0.5, 25.0),
        amplitude=0.02,
        band=(0.8, 20.0),
    ),
    "roll and pitch": Case(
        structure=structures.rollpitch,
        truth=ROLLPITCH_IN1,
        axes=("lat", "lat", "lon", "lon"),
        sticks=("LAT", "LON"),
        gain=0.1,
        gust=0.5,
        noise=0.03,
        sweep=(1.5, 45.0),
        amplitude=0.1,
        band=(3.0, 35.0),
    ),
}
"""Yaw in a gust that is a third of the sweep's own acceleration, roll and pitch in a lighter."""


@dataclass(frozen=True, eq=False)
class Replicates:
    """What the replicates of a case found by one method.

    Attributes:
        names: the parameters.
        truth: (n_parameter,).
        value, error: (n_replicate, n_parameter) estimates and their stated standard errors.
    """

    names: tuple[str, ...]
    truth: NDArray[np.float64]
    value: NDArray[np.float64]
    error: NDArray[np.float64]

    @property
    def bias(self) -> NDArray[np.float64]:
        """Mean error over the size of the truth."""
        return (self.value.mean(axis=0) - self.truth) / np.abs(self.truth)

    @property
    def scatter(self) -> NDArray[np.float64]:
        """Standard deviation over the size of the truth."""
        return self.value.std(axis=0, ddof=1) / np.abs(self.truth)

    @property
    def stated(self) -> NDArray[np.float64]:
        """Root mean square of the stated standard errors over the size of the truth."""
        return np.sqrt(np.mean(self.error**2, axis=0)) / np.abs(self.truth)

    @property
    def coverage(self) -> NDArray[np.float64]:
        """Share of replicates whose 95 % interval holds the truth."""
        return np.mean(np.abs(self.value - self.truth) <= 1.96 * self.error, axis=0)


def replicate(
    case: Case, seeds: Iterable[int], methods: tuple[str, ...] = ("joint",)
) -> dict[str, Replicates]:
    """Fly and identify a case once a seed, by every method on the same records."""
    names = tuple(case.structure.names)
    found: dict[str, list[Fit]] = {method: [] for method in methods}
    for seed in seeds:
        records = case.fly(seed)
        for method in methods:
            found[method].append(case.identify(records, method))
    return {
        method: Replicates(
            names=names,
            truth=np.array([case.truth[name] for name in names]),
            value=np.array([[fit[name].value for name in names] for fit in fits]),
            error=np.array([[fit[name].standard_error for name in names] for fit in fits]),
        )
        for method, fits in found.items()
    }
