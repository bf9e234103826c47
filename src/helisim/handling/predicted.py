"""Loops that models predict, with intervals, and models corrected by loops as flown."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from helisim.base.arrays import Complex, Real
from helisim.base.linear import Linear
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.figures import bandwidth, margins, rejection
from helisim.handling.loop import Curve, axis_of
from helisim.handling.measured.interval import Interval, intervals

ATTITUDE_DRB = "attitude_DRB"
"""Figure: DRB of a disturbance of the attitude alone, as of an estimate that drifts, rad/s."""
LOWEST, _POINTS = 0.2, 500  # rad/s, and how many up to half of the law's ticks


@dataclass(frozen=True, eq=False)
class FlownPlant:
    """A model that is corrected by loops as flown; it is `Linear`.

    `ratios`, by axis, are those of the loop as flown to the loop that the model predicts. Beyond
    its band a ratio keeps the value of the nearest end.
    """

    model: Linear
    ratios: Mapping[str, Curve]

    @property
    def inputs(self) -> tuple[str, ...]:
        """The model's commands."""
        return self.model.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """What the model senses."""
        return self.model.outputs

    def response(self, frequency: Real) -> Complex:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        found = np.array(self.model.response(frequency))
        for axis, ratio in self.ratios.items():
            inside = np.clip(frequency, *ratio.frequency[[0, -1]])
            found[:, self.inputs.index(axis)] *= ratio.at(inside)
        return found


class Ticking(Linear, Protocol):
    """A linear law at ticks that are a `period` apart, s."""

    @property
    def period(self) -> float:
        """Of its ticks, s."""
        ...


@dataclass(frozen=True, eq=False)
class PredictedLoop(ClosedLoop):
    """The loop of an identified model, and as `draws` those of models as likely, by the same law.

    Models tell it from a lowest frequency up to half of an autopilot's ticks. Law `flew` is known
    to be stable with all of them: how often a loop encircles -1 counts beside it, as what is slower
    isn't seen.
    """

    draws: tuple[ClosedLoop, ...] = ()
    flew: Linear | None = None

    @classmethod
    def of(
        cls,
        plants: Sequence[Linear],
        law: Ticking,
        lowest: float = LOWEST,
        flew: Linear | None = None,
    ) -> Self:
        """Return the loop of the first plant, the likeliest, and of all others as draws.

        It is from `lowest`, rad/s, on; law `flew` is one that flew, stable.
        """
        grid = np.geomspace(lowest, np.pi / law.period, _POINTS)
        first, *others = (ClosedLoop(plant, law, grid) for plant in plants)
        return cls(first.plant, law, grid, tuple(others), flew)

    def figures(self, axis: str) -> dict[str, Interval]:
        """Return an axis's figures with their 95 % intervals, cut at the command.

        DRB of the attitude alone is one only of a law that senses the attitude.
        """

        def told(one: ClosedLoop) -> dict[str, float]:
            cut, left = margins(one.broken(axis)), rejection(one.disturbance(axis))
            if self.flew is not None:
                flown = margins(ClosedLoop(one.plant, self.flew, one.frequency).broken(axis))
                cut = replace(cut, encircled=cut.encircled - flown.encircled)
            quick = bandwidth(one.command(axis))
            found = {
                "crossover": cut.crossover,
                "phase_margin": float(np.degrees(cut.least_phase)),
                "gain_margin": cut.least_gain,
                "DRB": left.bandwidth,
                "DRP": left.peak,
                # the yaw stick asks for a rate
                "bandwidth": quick.rate if axis_of(axis).name == "ped" else quick.phase,
            }
            if axis_of(axis).angle in self.law.inputs:
                found[ATTITUDE_DRB] = rejection(one.disturbance(axis, "attitude")).bandwidth
            return found

        return intervals(self, told)
