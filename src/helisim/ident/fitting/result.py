"""What a fit found: parameters by name with their accuracy, costs, support and the model."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import read_json, write_json
from helisim.base.value import FrozenMap, Value
from helisim.ident.fitting.export import fit_text, latex_table, write_matlab
from helisim.ident.fitting.fit_file import fields_from_plain, fit_to_plain
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.misfit import Misfit
from helisim.ident.fitting.modes import Modes, modes_of
from helisim.ident.fitting.remarks import remarks
from helisim.ident.model.evaluate import matrices, proper_part, response, state_space
from helisim.ident.model.structure import Structure
from helisim.ident.model.structure_toml import delay_places
from helisim.ident.response import FrequencyResponse
from helisim.records.provenance import versions

if TYPE_CHECKING:
    import control

    from helisim.base.display import Axes, Figure

CORRELATION_LIMIT = 0.9
"""Two parameters correlated more than this can stand in for each other."""

ACCEPTABLE_COST = 100.0
EXCELLENT_COST = 50.0
ACCEPTABLE_SINGLE_COST = 200.0
"""Limits of the average cost and of a single response's (Tischler and Remple)."""


@dataclass(frozen=True, eq=False)
class Fit(Value, Displayed):
    """A fitted model.

    Attributes:
        structure: what was fitted.
        parameters: every parameter by name.
        correlation: (n_free, n_free) between the free parameters, in their order.
        costs: J of each response that was used.
        bands: lowest and highest frequency used of each response, rad/s.
        dropped: responses without enough coherent points, or zero by the structure itself.
        converged: the search ended at a minimum, not at its limit of steps.
        searches_agreeing: how many starts, at different delays where the structure has any,
            ended in this minimum; 1 says to look closer.
        data: the frequency response that was fitted.
        covariance: (n_free, n_free) of the free parameters' errors, whose diagonal is the squared
            standard errors; infinite there where the data do not see one. None in a file of
            an earlier version.
        carried: (n_free, n_known) by how much each errs for one standard error of each known
            parameter that has any; None in a file of an earlier version.
        misfit: what the structure leaves beyond noise, which no standard error holds, or None.
        degenerate: where the data support less than the structure has: what to do, a line each.
        options: how `identify` was called, as plain data.
        versions: the programs that computed the fit, by name.
    """

    structure: Structure
    parameters: Mapping[str, FittedParameter]
    correlation: NDArray[np.float64]
    costs: Mapping[str, float]
    bands: Mapping[str, tuple[float, float]]
    dropped: tuple[str, ...]
    converged: bool
    searches_agreeing: int
    data: FrequencyResponse
    covariance: NDArray[np.float64] | None = None
    carried: NDArray[np.float64] | None = None
    misfit: Misfit | None = None
    degenerate: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=versions)

    def __post_init__(self) -> None:
        for name in ("correlation", "covariance", "carried"):
            if getattr(self, name) is not None:
                matrix = np.array(getattr(self, name), dtype=np.float64)
                matrix.flags.writeable = False
                object.__setattr__(self, name, matrix)
        for name in ("parameters", "costs", "bands", "options", "versions"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    def __getitem__(self, name: str) -> FittedParameter:
        """Return a parameter. Raises UnknownNameError."""
        try:
            return self.parameters[name]
        except KeyError:
            raise UnknownNameError("parameter", name, self.parameters) from None

    def __repr__(self) -> str:
        return f"Fit({self.structure.name}, average cost {self.cost:.4g})"

    def __str__(self) -> str:
        return fit_text(self, self.parameters.values())

    @property
    def judged(self) -> str:
        """The average cost in a word or two; "degenerate" whatever it is, where the fit is."""
        if self.degenerate:
            return "degenerate"
        return "excellent" if self.excellent else "acceptable" if self.acceptable else "too high"

    @property
    def remarks(self) -> list[str]:
        """What a reader should know beside the numbers, a line each."""
        return remarks(self)

    @property
    def values(self) -> dict[str, float]:
        """Every parameter's value by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    @property
    def cost(self) -> float:
        """The average of J over the responses."""
        return float(np.mean(list(self.costs.values())))

    @property
    def band(self) -> tuple[float, float]:
        """The lowest and highest frequency used in any response, rad/s."""
        edges = list(self.bands.values())
        return min(low for low, _ in edges), max(high for _, high in edges)

    @property
    def acceptable(self) -> bool:
        """Whether the average cost is at most 100 and each response's at most 200."""
        return self.cost <= ACCEPTABLE_COST and max(self.costs.values()) <= ACCEPTABLE_SINGLE_COST

    @property
    def excellent(self) -> bool:
        """Whether the average cost is at most 50."""
        return self.acceptable and self.cost <= EXCELLENT_COST

    @property
    def poorly_identified(self) -> tuple[str, ...]:
        """Parameters whose accuracy is beyond the guidelines; drop or fix the worst first."""
        return tuple(name for name, one in self.parameters.items() if one.poorly_identified)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Parameters that ended at a bound: widen it, or question the structure."""
        return tuple(name for name, one in self.parameters.items() if one.at_bound)

    @property
    def ok(self) -> bool:
        """Whether the fit converged off every bound with acceptable costs, none poor."""
        return (
            self.converged
            and self.acceptable
            and not (self.at_bound or self.poorly_identified or self.degenerate)
        )

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.9 in size, with it."""
        names = [parameter.name for parameter in self.structure.free]
        return tuple(
            (names[i], names[j], float(self.correlation[i, j]))
            for i in range(len(names))
            for j in range(i + 1, len(names))
            if abs(self.correlation[i, j]) > CORRELATION_LIMIT
        )

    def support(self, name: str) -> str:
        """Return what the data say of a parameter in a few words, correlations included.

        Raises UnknownNameError.
        """
        others = [b if a == name else a for a, b, _ in self.correlated if name in (a, b)]
        own = self[name].support
        return f"{own}, correlated with {', '.join(others)}" if others else own

    @cached_property
    def model(self) -> "control.StateSpace":
        """The identified state space, named; its delays are in `delays`.

        Raises IdentificationError where it has none: M is singular, or D1 makes it improper.
        """
        return state_space(self.structure, self.values)

    @cached_property
    def modes(self) -> Modes:
        """Poles, and zeros of each fitted response, with their standard errors.

        Raises IdentificationError where M is singular.
        """
        return modes_of(self)

    @property
    def delays(self) -> dict[str, float]:
        """The delay of every input and output, and what a response has beside them ("p/lat"), s.

        Negative where the channel leads.
        """
        return {**self.input_delays, **self.output_delays, **self.pair_delays}

    @property
    def input_delays(self) -> dict[str, float]:
        """The delay of every input, s."""
        numbers = matrices(self.structure, self.values)
        return dict(zip(self.structure.inputs, numbers.input_delays.tolist()))

    @property
    def output_delays(self) -> dict[str, float]:
        """The delay of every output, s."""
        numbers = matrices(self.structure, self.values)
        return dict(zip(self.structure.outputs, numbers.output_delays.tolist()))

    @property
    def pair_delays(self) -> dict[str, float]:
        """The delay of each response that has one beside its input's and output's, s."""
        numbers = matrices(self.structure, self.values)
        places = delay_places(self.structure.inputs, self.structure.outputs)["delays"]
        return {name: float(numbers.delays[places[name]]) for name in self.structure.delays}

    def response(self, frequency: ArrayLike) -> FrequencyResponse:
        """Return the model's frequency response, delays included, at (n_freq,) rad/s or one."""
        grid = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        return FrequencyResponse.exact(
            grid,
            response(self.structure, self.values, grid),
            inputs=self.structure.inputs,
            outputs=self.structure.outputs,
        )

    def plot(
        self,
        pairs: "Sequence[str] | str | None" = None,
        *,
        axes: "Sequence[Axes] | None" = None,
    ) -> "Figure":
        """Draw data and model, what the model leaves, and the coherence; grey where not fitted.

        Args:
            pairs: such as ("p/lat", "q/lon"); by default all.
            axes: to draw on, one a panel, pair by pair; by default those of a new figure.

        Returns:
            A matplotlib figure, which a notebook shows; nothing is kept of it.

        Raises:
            UnknownNameError: no such response.
            InputError: there are more or fewer axes than panels.
        """
        return shower().plot_fit(self, pairs, axes)

    @property
    def method(self) -> str:
        """How the response was estimated: "joint input-output" or "direct"."""
        return self.data.method

    @property
    def provenance(self) -> dict[str, Any]:
        """From what and with what the fit was computed, as plain data."""
        return {
            **self.data.provenance,
            "band_rad_s": list(self.band),
            "options": dict(self.options),
            "versions": dict(self.versions),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON that `from_dict` reads back without loss.

        What isn't finite becomes None.
        """
        return fit_to_plain(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Fit":
        """Read what `to_dict` wrote.

        Raises:
            InputError: something is missing or of the wrong type.
        """
        return cls(**fields_from_plain(data))

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fit as JSON that `load_fit` reads. Raises StorageError."""
        write_json(self.to_dict(), path)

    def to_latex(self, *, caption: str = "", label: str = "") -> str:
        """Return the parameters as a LaTeX table, each value rounded by its standard error."""
        return latex_table(
            self.parameters.values(),
            cost=self.cost,
            provenance=self.provenance,
            caption=caption,
            label=label,
        )

    def to_matlab(self, path: str | PathLike[str]) -> None:
        """Write A, B, C, D, InputDelay, OutputDelay, IODelay and names as a MAT file.

        A model with D1 is improper; it is written as a descriptor model with E beside A.

        Raises:
            StorageError: the file can't be written.
            IdentificationError: the model has no state-space form, as its M is singular.
        """
        numbers = matrices(self.structure, self.values)
        facts = {
            "InputDelay": np.array([[delay] for delay in self.input_delays.values()]),
            "OutputDelay": np.array([[delay] for delay in self.output_delays.values()]),
            "IODelay": numbers.delays,
            "InputUnit": self.data.input_units,
            "OutputUnit": self.data.output_units,
            "TimeUnit": "seconds",
            "Name": self.structure.name,
            "AverageCost": self.cost,
            "Provenance": json.dumps(self.provenance),
        }
        model = proper_part(self.structure, self.values)
        write_matlab(path, model, self.parameters.values(), facts, by_rate=numbers.D1)


def load_fit(path: str | PathLike[str]) -> Fit:
    """Read a fit that `Fit.save` wrote.

    Raises:
        StorageError: the file can't be read, or isn't JSON.
        InputError: it isn't a fit; the message names the file.
    """
    data = read_json(path)
    try:
        return Fit.from_dict(data)
    except InputError as error:
        error.args = (f"{path}: {error}",)
        raise
