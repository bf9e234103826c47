"""Result of a fit: parameters with accuracy, costs, support and the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helisim.base.display import Displayed, shower
from helisim.base.errors import (
    IdentificationError,
    InputError,
    check_known,
    item_of,
)
from helisim.base.files import read_json, write_json
from helisim.base.note import Note
from helisim.base.settings import Checked, Value, convert, placed, setting, to_plain
from helisim.ident import diagnosis
from helisim.ident.cost import coherent, enough, within
from helisim.ident.diagnosis import Residual, Verdict
from helisim.ident.evaluate import linear, response
from helisim.ident.fitted import FittedParameter, finite, text_table
from helisim.ident.modes import Modes, modes
from helisim.ident.response import FrequencyResponse
from helisim.ident.structure import Structure
from helisim.records.record import versions

if TYPE_CHECKING:
    import control

    from helisim.base.display import Figure

FORMAT = "helisim fit, version 1"
CORRELATION_LIMIT = 0.9  # Correlation above which two parameters can stand in for each other
ACCEPTABLE_COST = 100.0
EXCELLENT_COST = 50.0
ACCEPTABLE_SINGLE_COST = 200.0
"""Limits of the average cost and of a single response's (Tischler and Remple)."""
_FEW_RESPONSES = 2  # most responses whose zeros are in a fit's text
_Rows = tuple[tuple[float | None, ...], ...]
_Table = Mapping[str, Any]
_FILED: dict[str, Any] = {
    "structure": _Table,
    "parameters": tuple[_Table, ...],
    "correlation": _Rows,
    "costs": Mapping[str, float],
    "bands_rad_s": Mapping[str, tuple[float, float]],
    "dropped": tuple[str, ...],
    "converged": bool,
    "searches_agreeing": int,
    "degenerate": tuple[str, ...],
    "provenance": _Table,
    "data": _Table,
}  # Required plain data of a fit, with types


@dataclass(frozen=True, eq=False)
class Fit(Checked, Value, Displayed):
    """A fitted model, with `costs` J and `bands` in rad/s of each used response.

    `correlation` and `covariance` of the free parameters are (n_free, n_free), the latter infinite
    for unseen ones; `carried` (n_free, n_known) is the error for one standard error of each known
    one; `searches_agreeing` starts ended in this minimum; `residual` is beyond noise; where the
    order is too high `lower` is the one to fit instead, such as "tf:1/2".
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
    covariance: NDArray[np.float64] | None = setting(None, finite=False)
    carried: NDArray[np.float64] | None = setting(None, finite=False)
    residual: Residual | None = None
    degenerate: tuple[str, ...] = ()
    lower: str = ""
    omitted: tuple[Note, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=versions)

    def __getitem__(self, name: str) -> FittedParameter:
        """Return a parameter. Raises UnknownNameError."""
        return item_of(self.parameters, name, "parameter")

    def __repr__(self) -> str:
        return f"Fit({self.structure.name}, average cost {self.cost:.4g})"

    def __str__(self) -> str:
        return self.text()

    def text(self, say: Callable[[Note], str] = str) -> str:
        """Return parameters, costs and remarks; `say` words a note."""
        lines = [f"{self.structure.name}: {self.structure.meaning}".rstrip(": "), ""]
        lines += [*text_table(self.parameters.values(), self.support), ""]
        found = self._modes
        if found and len(self.costs) > _FEW_RESPONSES:
            found = replace(found, zeros={}, gains={})
        lines += [str(found), ""] if found and found.poles else []
        if count := self.options.get("lines"):
            lines.append(
                f"by maximum likelihood on the records' Fourier transforms, {count} lines; J is of "
                "the model beside what of the residuals moves with the inputs"
            )
        for name, cost in self.costs.items():
            low, high = self.bands[name]
            left = f"; {self.residual.words(name)}" if self.residual else ""
            lines.append(f"J {name} = {cost:.4g} from {low:.3g} to {high:.3g} rad/s{left}")
        if self.residual and self.residual.ratio is not None:
            lines.append(self.residual.summary)
        told = [note for note in self.notes if note not in self.verdict.reasons]
        lines += [
            f"average J = {self.cost:.4g}: {self.judged}, as costs go",
            self.verdict.text(say),
        ]
        return "\n".join([*lines, *map(say, (*self.verdict.reasons[1:], *told))])

    @property
    def verdict(self) -> Verdict:
        """Whether the numbers can be believed, and why not."""
        return Verdict.of(self.notes)

    @property
    def judged(self) -> str:
        """The guideline's word for the cost, which is no verdict."""
        return "excellent" if self.excellent else "acceptable" if self.acceptable else "too high"

    @property
    def remarks(self) -> list[str]:
        """Texts of `notes`."""
        return [note.text for note in self.notes]

    @property
    def notes(self) -> tuple[Note, ...]:
        """Remarks, the gravest first, with remedies."""
        reached = self.structure.connected
        incoherent = [name for name in self.dropped if name in reached]
        unreached = [name for name in self.dropped if name not in reached]
        seen = [name for name in unreached if enough(self.data, *name.split("/", 1))]
        unknown = [
            one.name
            for one in self.parameters.values()
            if not one.fixed and one.standard_error > 0.5 * abs(one.value)
        ]
        said = (
            (
                not self.converged,
                "search",
                "the search did not converge: give better starts, or fix a parameter",
                "start,fix",
            ),
            (
                self.searches_agreeing < 2 and bool(self.structure.free),
                "starts",
                "no two starts, at different delays where there are any, ended in this minimum: "
                "try more searches, or say where to start",
                "searches,start",
            ),
            (
                self.at_bound,
                "bound",
                f"at a bound: {', '.join(self.at_bound)}; widen it, or doubt the structure",
                "bounds",
            ),
            (
                2 * len(unknown) > len(self.structure.free),
                "support",
                f"the data do not fix {', '.join(unknown)}: errors above half of the value",
                "band",
            ),
            (
                incoherent,
                "coherence",
                f"left out for lack of coherence: {', '.join(incoherent)}",
                "",
            ),
            (
                seen,
                "coupling",
                f"coherent, yet zero in the structure: {', '.join(seen)}; left out: chance, or a "
                "coupling that the structure lacks",
                "",
            ),
        )
        poles = [one.value for one in self._modes.poles] if self._modes else []
        doubt = diagnosis.doubt(self.band, poles, self.residual)
        return (
            *(Note("degenerate", text) for text in self.degenerate),
            *self.data.evidence,
            *self._failing,
            *diagnosis.implausible(
                self.structure,
                {name: (one.value, one.standard_error) for name, one in self.parameters.items()},
                poles,
                self.band,
                self.data.line,
                self.data.conditions.full,
                not self.data.reference
                and self.data.opposed
                and all(one.kind != "driven" for one in self.data.evidence),
            ),
            *self.omitted,
            *([doubt] if doubt and not self.degenerate else []),
            *(Note.of(kind, text, remedy) for there, kind, text, remedy in said if there),
            *(
                Note("correlation", f"{a} and {b} are correlated by {r:.3f}")
                for a, b, r in self.correlated
            ),
            *self.shapes,
            *(Note("data", flag) for flag in self.data.flags),
        )

    @property
    def _failing(self) -> tuple[Note, ...]:
        """The response, or the average, whose J is beyond the guideline."""
        worst = max(self.costs, key=lambda name: self.costs[name])
        if self.costs[worst] > ACCEPTABLE_SINGLE_COST:
            said = f"J of {worst} is {self.costs[worst]:.4g}, above {ACCEPTABLE_SINGLE_COST:g}"
        elif self.cost > ACCEPTABLE_COST:
            said = f"average J is {self.cost:.4g}, above {ACCEPTABLE_COST:g}; {worst} has most"
        else:
            return ()
        return (Note("cost", f"{said}: the structure does not follow the data"),)

    @property
    def shapes(self) -> tuple[Note, ...]:
        """Remarks on the shape of an unacceptable fit's errors."""
        data, model = self.data, self.response(self.data.frequency)
        found = []
        for name, band in () if self.acceptable else self.bands.items():
            at, there = (one.index(*name.split("/", 1)) for one in (data, model))
            inside = within(data.frequency, band) & coherent(data, *at)
            ratio = data.response[*at, inside] / model.response[*there, inside]
            if self.costs[name] > EXCELLENT_COST and inside.any() and np.all(np.isfinite(ratio)):
                omega, coherence = data.frequency[inside], data.coherence[*at, inside]
                found.append(diagnosis.shape(name, omega, ratio, coherence))
        return tuple(note for note in found if note)

    @property
    def values(self) -> dict[str, float]:
        """Value of every parameter by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    @property
    def cost(self) -> float:
        """Average of J over the responses."""
        return float(np.mean(list(self.costs.values())))

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency used, rad/s."""
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
    def at_bound(self) -> tuple[str, ...]:
        """Parameters at a bound: widen it, or question the structure."""
        return tuple(name for name, one in self.parameters.items() if one.at_bound)

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.9 in size, with it."""
        names = [parameter.name for parameter in self.structure.free]
        beyond = np.argwhere(np.triu(np.abs(self.correlation) > CORRELATION_LIMIT, 1))
        return tuple((names[i], names[j], float(self.correlation[i, j])) for i, j in beyond)

    def support(self, name: str) -> str:
        """Return a parameter's support as text, with correlations. Raises UnknownNameError."""
        others = [b if a == name else a for a, b, _ in self.correlated if name in (a, b)]
        own = self[name].support
        return f"{own}, correlated with {', '.join(others)}" if others else own

    @cached_property
    def model(self) -> "control.StateSpace":
        """State space with names, without `delays`. Raises IdentificationError if M is singular."""
        return linear(self.structure, self.values).system

    @cached_property
    def modes(self) -> Modes:
        """Poles, and zeros of each fitted response, with errors. Raises IdentificationError."""
        names = [one.name for one in self.structure.free]
        covariance, known = self.covariance, self.structure.uncertain
        if covariance is not None and self.carried is not None and known:
            errors = np.array([one.error for one in known])
            across = self.carried * errors
            covariance = np.block([[covariance, across], [across.T, np.diag(errors**2)]])
            names += [one.name for one in known]
        return modes(
            self.structure, self.values, tuple(self.costs), names=names, covariance=covariance
        )

    @property
    def _modes(self) -> Modes | None:
        try:
            return self.modes
        except IdentificationError:  # M is singular
            return None

    @property
    def delays(self) -> dict[str, float]:
        """Delay of every input and output, s; negative where the channel leads."""
        numbers = self.structure.matrices(self.values)
        late = (*numbers["input_delays"].ravel(), *numbers["output_delays"].ravel())
        return dict(zip((*self.structure.inputs, *self.structure.outputs), map(float, late)))

    def response(self, frequency: ArrayLike) -> FrequencyResponse:
        """Return the model's frequency response, delays included, at (n_freq,) rad/s or one."""
        grid = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        return FrequencyResponse.exact(
            grid,
            response(self.structure, self.values, grid),
            inputs=self.structure.inputs,
            outputs=self.structure.outputs,
        )

    def plot(self, pairs: "Sequence[str] | str | None" = None) -> "Figure":
        """Draw data, model, residual and coherence of `pairs`, such as ("p/lat",); default all."""
        return shower().plot_fit(self, pairs)

    @property
    def method(self) -> str:
        """Estimate of the response: "joint input-output" or "direct"."""
        return self.data.method

    @property
    def provenance(self) -> dict[str, Any]:
        """Origin of the fit as plain data."""
        return {
            **self.data.provenance,
            "band_rad_s": list(self.band),
            "options": dict(self.options),
            "versions": dict(self.versions),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, without loss; None for what isn't finite."""
        given = {"covariance": self.covariance, "carried": self.carried}
        known: dict[str, Any] = {
            key: [[finite(x) for x in row] for row in one.tolist()]
            for key, one in given.items()
            if one is not None
        }
        known |= {} if self.residual is None else {"residual": self.residual.to_dict()}
        return {
            "format": FORMAT,
            "structure": self.structure.to_dict(),
            "parameters": [one.to_dict() for one in self.parameters.values()],
            "correlation": self.correlation.tolist(),
            **known,
            "correlated": [list(pair) for pair in self.correlated],
            "cost": self.cost,
            "costs": dict(self.costs),
            "band_rad_s": list(self.band),
            "bands_rad_s": {name: list(edges) for name, edges in self.bands.items()},
            "dropped": list(self.dropped),
            "converged": self.converged,
            "acceptable": self.acceptable,
            "searches_agreeing": self.searches_agreeing,
            "degenerate": list(self.degenerate),
            "lower": self.lower,
            "omitted": to_plain(self.omitted),
            "verdict": self.verdict.to_dict(),
            "method": self.method,
            "windows_s": list(self.data.windows),
            "flags": list(self.data.flags),
            "delays_s": self.delays,
            "modes": self._modes and self._modes.to_dict(),
            "provenance": self.provenance,
            "data": self.data.to_dict(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Fit":
        """Read what `to_dict` wrote. Raises InputError for missing, wrong or inconsistent data."""
        given = convert(Mapping[str, Any], data, "fit")
        if given.get("format") != FORMAT:
            raise InputError(
                f"this isn't a fit that Fit.to_dict wrote: its format is {given.get('format')!r}, "
                f"expected {FORMAT!r}"
            )
        missing = [key for key in _FILED if key not in given]
        if missing:
            raise InputError(f"the fit lacks {', '.join(missing)}")
        filed = {key: convert(hint, given[key], key) for key, hint in _FILED.items()}
        structure = Structure.from_dict(filed["structure"])
        fitted = [FittedParameter.from_dict(structure, one) for one in filed["parameters"]]
        parameters = {one.name: one for one in fitted}
        response = FrequencyResponse.from_dict(filed["data"])
        pairs, free = structure.pairs, len(structure.free)
        left = None if given.get("residual") is None else Residual.from_dict(given["residual"])
        costs, bands = filed["costs"], filed["bands_rad_s"]
        check_known("response of the fit", (*costs, *filed["dropped"]), pairs)
        for key, names, known in (
            ("parameters", structure.names, parameters),
            ("costs", bands or ["any response"], costs),
            ("bands_rad_s", costs, bands),
            ("data", costs, response.pairs),
            ("residual", costs, left.percent if left else costs),
        ):
            lacking = [name for name in names if name not in known]
            if lacking:
                raise InputError(
                    f"the fit's {key} lack {', '.join(lacking)}; they have {', '.join(known)}"
                )
        return cls(
            structure=structure,
            parameters=parameters,
            correlation=np.asarray(_matrix(filed["correlation"], (free, free), "correlation")),
            costs=costs,
            bands=bands,
            dropped=filed["dropped"],
            converged=filed["converged"],
            searches_agreeing=filed["searches_agreeing"],
            data=response,
            covariance=_matrix(given.get("covariance"), (free, free), "covariance"),
            carried=_matrix(given.get("carried"), (free, len(structure.uncertain)), "carried"),
            residual=left,
            degenerate=filed["degenerate"],
            lower=convert(str, given.get("lower", ""), "lower"),
            omitted=convert(tuple[Note, ...], given.get("omitted", ()), "omitted"),
            options=convert(_Table, filed["provenance"].get("options", {}), "options"),
            versions=convert(Mapping[str, str], filed["provenance"].get("versions"), "versions"),
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fit as JSON for `load_fit`. Raises StorageError."""
        write_json(self.to_dict(), path)


def load_fit(path: str | PathLike[str]) -> Fit:
    """Read a fit from a file. Raises StorageError, or InputError if it isn't a fit."""
    with placed(path):
        return Fit.from_dict(read_json(path))


def _matrix(rows: Any, shape: tuple[int, int], name: str) -> NDArray[np.float64] | None:
    if rows is None:
        return None
    cells = convert(_Rows, rows, name)
    if len(cells) != shape[0] or any(len(row) != shape[1] for row in cells):
        raise InputError(f"the fit's {name} must be {shape[0]} rows of {shape[1]} numbers")
    numbers = [[np.inf if x is None else x for x in row] for row in cells]
    return np.array(numbers, dtype=np.float64).reshape(shape)
