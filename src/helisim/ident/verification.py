"""Figures and time histories of a model's prediction of unseen records."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.display import Displayed, shower
from helisim.base.settings import Checked, Value, setting, to_plain

if TYPE_CHECKING:
    from helisim.base.display import Figure

ACCEPTABLE_TIC = 0.25  # Theil's coefficient up to which a model predicts well (Tischler and Remple)
_WIDTH = 80  # columns of a terminal


@dataclass(frozen=True, kw_only=True)
class Approach:
    """Approach of the prediction: "whole" records, or "segments", each from a state of its own.

    `length_s` is of the longest record or of a segment; `pole` is the fastest unstable pole (real,
    imaginary), rad/s, None if stable.
    """

    kind: Literal["whole", "segments"]
    length_s: float
    pole: tuple[float, float] | None = None
    estimated: int
    samples: int

    @property
    def doubling_s(self) -> float | None:
        """Doubling time of an unstable model's state error, s."""
        return None if self.pole is None else float(np.log(2.0) / self.pole[0])

    @property
    def growth(self) -> float:
        """Growth of that error over the predicted length."""
        return 1.0 if self.pole is None else float(np.exp(self.pole[0] * self.length_s))

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
        }[self.kind]
        return f"{told}{how}; {self.estimated} numbers estimated for {self.samples} samples"

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        told = {"doubling_s": self.doubling_s, "growth": self.growth, "message": str(self)}
        return {**to_plain(self), **told}


@dataclass(frozen=True, eq=False, repr=False)
class Trace(Checked, Value):
    """One record, measured and predicted; read-only.

    `time` is (n_time,) s; `inputs`, `measured`, `predicted` are (n_time, n), the last with `bias`
    (n_out,); `starts` (n_start,) s, of segments; `telling` (n_time, n_out) is measured motion
    without what biases, trims and initial states can explain; `estimated` counts initial states.
    """

    time: NDArray[np.float64]
    inputs: NDArray[np.float64]
    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    bias: NDArray[np.float64]
    telling: NDArray[np.float64]
    starts: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    estimated: int = 0

    @property
    def residual(self) -> NDArray[np.float64]:
        """Measured minus predicted, (n_time, n_out)."""
        return self.measured - self.predicted

    @property
    def error(self) -> NDArray[np.float64]:
        """Residual times N / (N - n_estimated), (n_time, n_out)."""
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
    """Return Theil's coefficient of each output, (n_out,); 0 where nothing moves."""
    size = root_mean_square(measured) + root_mean_square(predicted)
    return root_mean_square(measured - predicted) / np.where(size > 0.0, size, 1.0)


def overall_theil(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> float:
    """Return Theil's coefficient, each output normalised by its own size."""
    size = root_mean_square(measured)
    size = np.where(size > 0.0, size, 1.0)
    error = np.sqrt(np.mean(((measured - predicted) / size) ** 2))
    total = np.sqrt(np.mean((measured / size) ** 2)) + np.sqrt(np.mean((predicted / size) ** 2))
    return float(error / total) if total > 0.0 else 0.0


@dataclass(frozen=True, kw_only=True)
class VerifiedOutput:
    """Figures of one output; `counted` is False where it hardly moved."""

    name: str
    unit: str
    j_rms: float
    tic: float
    counted: bool = True


@dataclass(frozen=True, kw_only=True)
class VerifiedRecord(Checked):
    """Figures of one flight, by output; `bias` was added to the prediction."""

    duration_s: float
    j_rms: Mapping[str, float]
    tic: Mapping[str, float]
    bias: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class VerificationFigures:
    """Figures of a `Verification`."""

    j_rms: float
    tic: float
    outputs: tuple[VerifiedOutput, ...]
    records: tuple[VerifiedRecord, ...]
    approach: Approach | None = None
    elsewhere: tuple[str, ...] = setting((), unsaid=True)

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.outputs)
        return f"VerificationFigures({names} of {len(self.records)} record(s), TIC {self.tic:.3f})"

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25, in answer to the model's inputs."""
        return self.tic <= ACCEPTABLE_TIC and not self.elsewhere

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            **{"j_rms": self.j_rms, "tic": self.tic, "acceptable": self.acceptable},
            **to_plain(self),
            "approach": self.approach and self.approach.to_dict(),
        }


@dataclass(frozen=True, eq=False)
class Verification(Checked, Value, Displayed):
    """Prediction of records that the model was not fitted to.

    `j_rms` is the root mean square error over all outputs, each in its unit; `tic` Theil's
    coefficient (0 perfect, 1 useless) over outputs that count, without what biases, trims and
    states explain; `quiet` outputs moved too little beside their noise to count. `elsewhere` are
    the controls that moved where the model's inputs hardly did, and the outputs hardly beside their
    noise: such records are no test of the model.
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
    elsewhere: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return (
            f"Verification({', '.join(self.outputs)} of {len(self.traces)} record(s), "
            f"TIC {self.tic:.3f}: {self._judged})"
        )

    @property
    def acceptable(self) -> bool:
        """Whether Theil's coefficient is at most 0.25, in answer to the model's inputs."""
        return self.figures.acceptable

    @property
    def _judged(self) -> str:
        missed = "says nothing of the model" if self.elsewhere else f"above {ACCEPTABLE_TIC}"
        return "acceptable" if self.acceptable else missed

    @property
    def figures(self) -> VerificationFigures:
        """Figures without traces."""

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
            elsewhere=self.elsewhere,
        )

    def plot(self) -> "Figure":
        """Draw the inputs, each output measured and predicted, and the residuals."""
        return shower().plot_verification(self)

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
        if self.elsewhere:
            said = (
                f"not a test of this model: {', '.join(self.elsewhere)} moved, and its inputs "
                f"{', '.join(self.inputs)} hardly; give a record in which they are excited"
            )
            lines += textwrap.wrap(said, _WIDTH)
        if self.approach is not None:
            lines += [textwrap.fill(part, _WIDTH) for part in str(self.approach).split("; ")]
        return "\n".join(lines)
