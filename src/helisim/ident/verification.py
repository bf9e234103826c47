"""How well a model predicted records that no fit has seen: figures and time histories."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.settings import Value, check, from_plain, to_plain
from helisim.base.units import UserUnits
from helisim.records.record import signal_in

if TYPE_CHECKING:
    from helisim.base.display import Axes, Figure

ACCEPTABLE_TIC = 0.25
"""Theil's coefficient up to which a model predicts well (Tischler and Remple)."""
_WIDTH = 80  # columns of a terminal


@dataclass(frozen=True, kw_only=True)
class Approach:
    """How records were predicted.

    Attributes:
        kind: each record "whole", in "segments", each from a state of its own, or "ahead", every
            sample from a state that the samples before it gave.
        length_s: of the longest record, of a segment, or of the past that gives a state, s.
        ahead_s: how far ahead each sample was predicted, s; 0 but for "ahead".
        pole: (real, imaginary) of the fastest unstable pole, rad/s; None of a stable model.
        estimated: numbers that were estimated from the records, biases and trims included.
        samples: numbers that were predicted: samples times outputs.
    """

    kind: Literal["whole", "segments", "ahead"]
    length_s: float
    ahead_s: float = 0.0
    pole: tuple[float, float] | None = None
    estimated: int
    samples: int

    @property
    def doubling_s(self) -> float | None:
        """Time in which an error of an unstable model's state doubles, s."""
        return None if self.pole is None else float(np.log(2.0) / self.pole[0])

    @property
    def growth(self) -> float:
        """By how much such an error grows over the length that is predicted from one state."""
        span = self.ahead_s if self.kind == "ahead" else self.length_s
        return 1.0 if self.pole is None else float(np.exp(self.pole[0] * span))

    @property
    def in_brief(self) -> str:
        """How, in a few words behind "predicted"; nothing where each record is whole."""
        segments = f"in segments of {self.length_s:.3g} s"
        return {"whole": "", "segments": segments, "ahead": f"{self.ahead_s:.3g} s ahead"}[
            self.kind
        ]

    def __str__(self) -> str:
        told = grows = ""
        if self.pole is not None:
            real, imaginary = self.pole
            pair = f" +- {abs(imaginary):.3g}j" if imaginary else ""
            told = (
                f"unstable: its pole {real:.3g}{pair} rad/s doubles an error in "
                f"{self.doubling_s:.3g} s; "
            )
            grows = f", over which one grows {self.growth:.2g} times"
        how = {
            "whole": f"each record predicted whole, up to {self.length_s:.4g} s{grows}, from one "
            "initial state",
            "segments": f"predicted in segments of {self.length_s:.3g} s{grows}, each from an "
            "initial state of its own; TIC is of the motion that these can't make up",
            "ahead": f"each sample predicted {self.ahead_s:.3g} s ahead{grows}, from a state that "
            f"the {self.length_s:.3g} s before gave",
        }[self.kind]
        return f"{told}{how}; {self.estimated} numbers estimated for {self.samples} samples"

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Approach":
        """Return what `to_dict` wrote. Raises InputError."""
        return from_plain(cls, data, "approach", lenient=True)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        told = {"doubling_s": self.doubling_s, "growth": self.growth, "message": str(self)}
        return {**to_plain(self), **told}


@dataclass(frozen=True, eq=False, repr=False)
class Trace(Value):
    """One record, measured and predicted. Read-only.

    Attributes:
        time: (n_time,) s.
        inputs: (n_time, n_in) as recorded.
        measured: (n_time, n_out).
        predicted: (n_time, n_out), with the estimated bias, trim and initial state.
        bias: (n_out,) constant that was added to the prediction.
        starts: (n_start,) s, where the prediction starts anew from a state of its own.
        telling: (n_time, n_out) measured motion that tells of the model: what biases, trims and
            initial states could make up is taken out. By default the motion about its mean.
        estimated: how many numbers the starts' states are, all together; 0 where one state
            serves the whole record.
    """

    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    bias: NDArray[np.float64]
    starts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    telling: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    estimated: int = 0

    def __post_init__(self) -> None:
        check(self)
        if self.telling.size == 0:
            telling = self.measured - np.mean(self.measured, axis=0)
            telling.setflags(write=False)
            object.__setattr__(self, "telling", telling)

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus predicted, (n_time, n_out)."""
        return self.measured - self.predicted

    @property
    def error(self) -> NDArray[np.float64]:
        """The residual, enlarged as N / (N - n_estimated): so many any model meets."""
        size = self.residual.size
        return self.residual * np.sqrt(size / max(size - self.estimated, 1))

    @property
    def j_rms(self) -> NDArray[np.float64]:
        """Root mean square error of each output in its unit, (n_out,)."""
        return root_mean_square(self.error)

    @property
    def tic(self) -> NDArray[np.float64]:
        """Theil's inequality coefficient of each output's telling motion, (n_out,)."""
        return theil(self.telling, self.telling - self.residual)


def root_mean_square(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square of each column, (n,), of (n_time, n)."""
    return np.sqrt(np.mean(values**2, axis=0))


def theil(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Theil's coefficient of each output, (n_out,); 0 where nothing moves at all."""
    size = root_mean_square(measured) + root_mean_square(predicted)
    error = root_mean_square(measured - predicted)
    return error / np.where(size > 0.0, size, 1.0)


def overall_theil(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> float:
    """Return Theil's coefficient with each output in units of its own size."""
    size = root_mean_square(measured)
    size = np.where(size > 0.0, size, 1.0)
    error = np.sqrt(np.mean(((measured - predicted) / size) ** 2))
    total = np.sqrt(np.mean((measured / size) ** 2)) + np.sqrt(np.mean((predicted / size) ** 2))
    return float(error / total) if total > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class VerifiedOutput:
    """How well one output was predicted.

    Attributes:
        name, unit: of the output.
        j_rms, tic: root mean square error; Theil's inequality coefficient.
        counted: False of one that moved too little beside its noise to tell of a model.
    """

    name: str
    unit: str
    j_rms: float
    tic: float
    counted: bool = True


@dataclass(frozen=True, kw_only=True)
class VerifiedRecord:
    """How well one flight was predicted.

    Attributes:
        duration_s: of the flight, s.
        j_rms, tic: by output, root mean square error and Theil's inequality coefficient.
        bias: by output, the constant that was added to the prediction.
    """

    duration_s: float
    j_rms: Mapping[str, float]
    tic: Mapping[str, float]
    bias: Mapping[str, float]

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class VerificationFigures:
    """The figures of a `Verification`, without its time histories."""

    j_rms: float
    tic: float
    outputs: tuple[VerifiedOutput, ...]
    records: tuple[VerifiedRecord, ...]
    approach: Approach | None = None

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.outputs)
        return f"VerificationFigures({names} of {len(self.records)} record(s), TIC {self.tic:.3f})"

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25."""
        return self.tic <= ACCEPTABLE_TIC

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        plain = {"j_rms": self.j_rms, "tic": self.tic, "acceptable": self.acceptable}
        approach = self.approach and self.approach.to_dict()
        return {**plain, **to_plain(self), "approach": approach}


@dataclass(frozen=True, eq=False)
class Verification(Value, Displayed):
    """How well a model predicts records that it was not fitted to.

    Attributes:
        inputs: names of the inputs.
        outputs: names of the outputs.
        units: their units.
        traces: one a record.
        j_rms: root mean square error over all outputs, each in its unit.
        tic: Theil's inequality coefficient over the outputs that tell, 0 perfect, 1 useless; of
            motions about the measured mean, so that a large trim doesn't flatter it, and without
            what a state estimated for each segment could make up.
        j_rms_by_output, tic_by_output: the same for each output by name.
        approach: how the records were predicted; None where it isn't known.
        quiet: outputs that moved too little beside their noise to tell of a model.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    traces: tuple[Trace, ...]
    j_rms: float
    tic: float
    j_rms_by_output: Mapping[str, float]
    tic_by_output: Mapping[str, float]
    approach: Approach | None = None
    quiet: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check(self)

    def __repr__(self) -> str:
        return (
            f"Verification({', '.join(self.outputs)} of {len(self.traces)} record(s), "
            f"TIC {self.tic:.3f}: {self._judged})"
        )

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25."""
        return self.tic <= ACCEPTABLE_TIC

    @property
    def _judged(self) -> str:
        return "acceptable" if self.acceptable else f"above {ACCEPTABLE_TIC}"

    @property
    def figures(self) -> VerificationFigures:
        """The figures alone, as results hold them."""

        def by_output(values: NDArray[np.float64]) -> dict[str, float]:
            return dict(zip(self.outputs, values.tolist()))

        return VerificationFigures(
            j_rms=self.j_rms,
            tic=self.tic,
            outputs=tuple(
                VerifiedOutput(
                    name=name,
                    unit=unit,
                    j_rms=self.j_rms_by_output[name],
                    tic=self.tic_by_output[name],
                    counted=name not in self.quiet,
                )
                for name, unit in zip(self.outputs, self.units)
            ),
            records=tuple(
                VerifiedRecord(
                    duration_s=float(trace.time[-1] - trace.time[0]),
                    j_rms=by_output(trace.j_rms),
                    tic=by_output(trace.tic),
                    bias=by_output(trace.bias),
                )
                for trace in self.traces
            ),
            approach=self.approach,
        )

    def in_units(self, units: UserUnits) -> "Verification":
        """Return the verification with its outputs in the given units."""
        shown = [
            signal_in(units, name, unit, is_input=False)
            for name, unit in zip(self.outputs, self.units)
        ]
        factor = np.array([many for _, many in shown])
        rms = {name: self.j_rms_by_output[name] * many for name, many in zip(self.outputs, factor)}
        scaled = ("measured", "predicted", "bias", "telling")
        return replace(
            self,
            units=tuple(unit for unit, _ in shown),
            traces=tuple(
                replace(trace, **{name: getattr(trace, name) * factor for name in scaled})
                for trace in self.traces
            ),
            j_rms=float(np.sqrt(np.mean(np.square(list(rms.values()))))),
            j_rms_by_output=rms,
        )

    def plot(
        self,
        records: "Sequence[int] | int | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw the inputs, each output measured and predicted, and what the prediction leaves.

        Args:
            records: by number, from 0; by default all, side by side.
            axes: to draw on, one a panel, record by record; by default those of a new figure.

        Raises:
            InputError: no such record, or there are more or fewer axes than panels.
        """
        return shower().plot_verification(self, records, axes)

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as plain data for JSON, without the traces."""
        return self.figures.to_dict()

    def __str__(self) -> str:
        lines = [f"{'output':<8}  {'unit':<6}  {'J_rms':>10}  {'TIC':>6}"]
        for name, unit in zip(self.outputs, self.units):
            tic = self.tic_by_output[name]
            mark = f"  above {ACCEPTABLE_TIC}" if tic > ACCEPTABLE_TIC else ""
            mark = "  hardly moved" if name in self.quiet else mark
            lines.append(
                f"{name:<8}  {unit:<6}  {self.j_rms_by_output[name]:10.4g}  {tic:6.3f}{mark}"
            )
        lines.append(f"all       {'':<6}  {self.j_rms:10.4g}  {self.tic:6.3f}  {self._judged}")
        if self.approach is not None:
            lines += [textwrap.fill(part, _WIDTH) for part in str(self.approach).split("; ")]
        return "\n".join(lines)
