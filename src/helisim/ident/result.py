"""What a fit found: parameters by name with their accuracy, costs, support and the model."""

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag

from helisim.base.display import Displayed, shower
from helisim.base.errors import IdentificationError, InputError, UnknownNameError
from helisim.base.files import atomic_write, read_json, write_json
from helisim.base.note import Note
from helisim.base.settings import FrozenMap, Value, convert, placed
from helisim.ident import diagnosis
from helisim.ident.cost import coherence_weight, enough, within
from helisim.ident.diagnosis import Misfit, Residual
from helisim.ident.evaluate import Matrices, matrices, proper_part, response, state_space
from helisim.ident.fitted import FittedParameter, finite, latex_table, text_table
from helisim.ident.modes import Modes, modes
from helisim.ident.response import FrequencyResponse
from helisim.ident.structure import Structure
from helisim.records.record import versions

if TYPE_CHECKING:
    import control

    from helisim.base.display import Axes, Figure

FORMAT = "helisim fit, version 1"
"""What `Fit.to_dict` writes and `Fit.from_dict` reads."""
CORRELATION_LIMIT = 0.9
"""Two parameters correlated more than this can stand in for each other."""
ACCEPTABLE_COST = 100.0
EXCELLENT_COST = 50.0
ACCEPTABLE_SINGLE_COST = 200.0
"""Limits of the average cost and of a single response's (Tischler and Remple)."""
_FEW_RESPONSES = 2
"""Up to so many responses a fit's text has their zeros; `print(fit.modes)` has them all."""

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
}
"""What a fit's plain data must have, with their types."""


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
            standard errors; infinite there where the data do not see one. None where it is
            unknown.
        carried: (n_free, n_known) by how much each errs for one standard error of each known
            parameter that has any; None where it is unknown.
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
        if name not in self.parameters:
            raise UnknownNameError("parameter", name, self.parameters)
        return self.parameters[name]

    def __repr__(self) -> str:
        return f"Fit({self.structure.name}, average cost {self.cost:.4g})"

    def __str__(self) -> str:
        return self.text()

    def text(
        self,
        parameters: Collection[FittedParameter] | None = None,
        say: Callable[[Note], str] = str,
    ) -> str:
        """Return the fit in words: its parameters, costs, and what a reader should know.

        Args:
            parameters: its own in other units; SI by default.
            say: words a note.
        """
        shown = self.parameters.values() if parameters is None else parameters
        lines = [f"{self.structure.name}: {self.structure.meaning}".rstrip(": "), ""]
        lines += [*text_table(shown, self.support), ""]
        try:
            found = self.modes
            if len(self.costs) > _FEW_RESPONSES:
                found = replace(found, zeros={}, gains={})
            lines += [str(found), ""] if found.poles else []
        except IdentificationError:  # M is singular, so there are none
            pass
        for name, cost in self.costs.items():
            low, high = self.bands[name]
            left = f"; {self.misfit.words(name)}" if self.misfit else ""
            lines.append(f"J {name} = {cost:.4g} from {low:.3g} to {high:.3g} rad/s{left}")
        judged = self.judged
        if self.misfit and self.misfit.ratio is not None:
            lines.append(self.misfit.summary)
            judged += ", as costs go" if self.misfit.ratio > diagnosis.RATIO_LIMIT else ""
        return "\n".join([*lines, f"average J = {self.cost:.4g}: {judged}", *map(say, self.notes)])

    @property
    def judged(self) -> str:
        """The average cost in a word or two; "degenerate" whatever it is, where the fit is."""
        if self.degenerate:
            return "degenerate"
        return "excellent" if self.excellent else "acceptable" if self.acceptable else "too high"

    @property
    def remarks(self) -> list[str]:
        """What a reader should know beside the numbers, a line each: the texts of `notes`."""
        return [note.text for note in self.notes]

    @property
    def notes(self) -> tuple[Note, ...]:
        """What a reader should know beside the numbers, the gravest first, with what mends it."""
        found = [Note("degenerate", text) for text in self.degenerate]
        if not self.converged:
            text = "the search did not converge: give better starts, or fix a parameter"
            found.append(Note.of("search", text, remedy="start,fix"))
        if self.searches_agreeing < 2:
            text = (
                "no two starts, at different delays where there are any, ended in this minimum: "
                "try more searches, or say where to start"
            )
            found.append(Note.of("starts", text, remedy="searches,start"))
        doubt = None if self.degenerate else self._doubt
        found += [doubt] if doubt else []
        if self.at_bound:
            text = f"at a bound: {', '.join(self.at_bound)}; widen it, or doubt the structure"
            found.append(Note.of("bound", text, remedy="bounds"))
        reached = self.structure.connected
        incoherent = [name for name in self.dropped if name in reached]
        if incoherent:
            text = f"left out for lack of coherence: {', '.join(incoherent)}"
            found.append(Note("coherence", text))
        unreached = [name for name in self.dropped if name not in reached]
        seen = [name for name in unreached if enough(self.data, *name.split("/", 1))]
        if seen:
            text = (
                f"coherent, yet zero in the structure: {', '.join(seen)}; left out: chance, or a "
                "coupling that the structure lacks"
            )
            found.append(Note("coupling", text))
        found += [
            Note("correlation", f"{a} and {b} are correlated by {r:.3f}")
            for a, b, r in self.correlated
        ]
        return (*found, *self.shapes, *(Note("data", flag) for flag in self.data.flags))

    @property
    def _doubt(self) -> Note | None:
        try:
            poles = [one.value for one in self.modes.poles]
        except IdentificationError:
            poles = []
        return diagnosis.doubt(self.structure, self.data, self.band, poles, self.misfit)

    @property
    def shapes(self) -> tuple[Note, ...]:
        """What the shape of a failing fit's errors says; nothing of an acceptable one."""
        return () if self.acceptable else tuple(diagnosis.shapes(self._residuals(), self.costs))

    def _residuals(self) -> Iterator[Residual]:
        """Yield what the model leaves of each response that was fitted."""
        data, model = self.data, self.response(self.data.frequency)
        for name, band in self.bands.items():
            output, _, input_ = name.partition("/")
            at = data.index(output, input_)
            inside = within(data.frequency, band) & data.usable()[at]
            predicted = model.response[*model.index(output, input_), inside]
            measured = data.response[*at, inside]
            if not inside.any() or not np.all(np.abs(predicted) * np.abs(measured) > 0.0):
                continue
            coherence = data.coherence[*at, inside]
            tables = ("delays", name), ("input_delays", input_), ("output_delays", output)
            texts = (getattr(self.structure, table).get(key) for table, key in tables)
            delays = (self.parameters[text] for text in texts if text in self.parameters)
            yield Residual(
                name,
                data.frequency[inside],
                measured / predicted,
                20.0 / coherence.size * coherence_weight(coherence),
                coherence,
                next(delays, None),
            )

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
        flawed = self.at_bound or self.poorly_identified or self.degenerate
        return self.converged and self.acceptable and not flawed

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of parameters whose correlation exceeds 0.9 in size, with it."""
        names = [parameter.name for parameter in self.structure.free]
        beyond = np.argwhere(np.triu(np.abs(self.correlation) > CORRELATION_LIMIT, 1))
        return tuple((names[i], names[j], float(self.correlation[i, j])) for i, j in beyond)

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

        Those are of the errors of the free and of the known parameters. Raises
        IdentificationError where M is singular.
        """
        names = [one.name for one in self.structure.free]
        known = [one for one in self.structure.parameters if one.error > 0.0]
        covariance = self.covariance
        if covariance is not None and self.carried is not None and known:
            errors = np.array([one.error for one in known])
            across = self.carried * errors
            covariance = np.block([[covariance, across], [across.T, np.diag(errors**2)]])
            names += [one.name for one in known]
        costs = tuple(self.costs)
        return modes(self.structure, self.values, costs, names=names, covariance=covariance)

    @cached_property
    def _numbers(self) -> Matrices:
        return matrices(self.structure, self.values)

    @property
    def delays(self) -> dict[str, float]:
        """The delay of every input and output, and what a response has beside them ("p/lat"), s.

        Negative where the channel leads.
        """
        return {**self.input_delays, **self.output_delays, **self.pair_delays}

    @property
    def input_delays(self) -> dict[str, float]:
        """The delay of every input, s."""
        return dict(zip(self.structure.inputs, self._numbers.input_delays.tolist()))

    @property
    def output_delays(self) -> dict[str, float]:
        """The delay of every output, s."""
        return dict(zip(self.structure.outputs, self._numbers.output_delays.tolist()))

    @property
    def pair_delays(self) -> dict[str, float]:
        """The delay of each response that has one beside its input's and output's, s."""
        places = self.structure.delay_places("delays")
        return {name: float(self._numbers.delays[places[name]]) for name in self.structure.delays}

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
        try:
            found = self.modes.to_dict()
        except IdentificationError:  # M is singular, so there are none
            found = None
        known: dict[str, Any] = {}
        if self.covariance is not None:
            known["covariance"] = [[finite(x) for x in row] for row in self.covariance.tolist()]
        if self.carried is not None:
            known["carried"] = self.carried.tolist()
        if self.misfit is not None:
            known["misfit"] = self.misfit.to_dict()
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
            "method": self.method,
            "windows_s": list(self.data.windows),
            "flags": list(self.data.flags),
            "delays_s": self.delays,
            "modes": found,
            "provenance": self.provenance,
            "data": self.data.to_dict(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Fit":
        """Read what `to_dict` wrote.

        Raises:
            InputError: something is missing or of the wrong type, or the names of its parts don't
                belong together.
        """
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
        pairs, free = structure.delay_places("delays"), len(structure.free)
        errors = sum(one.error > 0.0 for one in structure.parameters)
        left = None if given.get("misfit") is None else _misfit(given["misfit"])
        costs, bands = filed["costs"], filed["bands_rad_s"]
        for name in (*costs, *filed["dropped"]):
            if name not in pairs:
                raise UnknownNameError("response of the fit", name, pairs)
        for key, names, known in (
            ("parameters", structure.names, parameters),
            ("costs", bands or ["any response"], costs),
            ("bands_rad_s", costs, bands),
            ("data", costs, response.pairs),
            ("misfit", costs, left.percent if left else costs),
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
            carried=_matrix(given.get("carried"), (free, errors), "carried"),
            misfit=left,
            degenerate=filed["degenerate"],
            options=convert(_Table, filed["provenance"].get("options", {}), "options"),
            versions=convert(Mapping[str, str], filed["provenance"].get("versions"), "versions"),
        )

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

        In MATLAB: m = load("model.mat"); sys = ss(m.A, m.B, m.C, m.D, "InputDelay",
        m.InputDelay, "OutputDelay", m.OutputDelay, "InputName", m.InputName). MATLAB's `ss`
        refuses negative delays, so what leads is written as such and left to the reader. It has no
        delay for a pair either: sys = tf(sys); sys.IODelay = m.IODelay has. A model with D1 is
        improper; it is written as a descriptor model with E beside A, sys = dss(m.A, m.B, m.C,
        m.D, m.E, ...): its last states are the inputs and their rates.

        Raises:
            StorageError: the file can't be written.
            IdentificationError: the model has no state-space form, as its M is singular.
        """
        from scipy.io import savemat  # slow to import, and few write such files

        parameters = tuple(self.parameters.values())
        numbers = {
            "ParameterValue": [one.value for one in parameters],
            "ParameterCramerRao": [one.cramer_rao for one in parameters],
            "ParameterStandardError": [one.standard_error for one in parameters],
            "InputDelay": self._numbers.input_delays,
            "OutputDelay": self._numbers.output_delays,
        }
        names = {
            "InputName": self.structure.inputs,
            "OutputName": self.structure.outputs,
            "ParameterName": [one.name for one in parameters],
            "ParameterUnit": [one.unit for one in parameters],
            "InputUnit": self.data.input_units,
            "OutputUnit": self.data.output_units,
        }
        data = {
            **descriptor(proper_part(self.structure, self.values), self._numbers.D1),
            **{name: _cells(some) for name, some in names.items()},
            **{name: np.array(some, dtype=float).reshape(-1, 1) for name, some in numbers.items()},
            "IODelay": self._numbers.delays,
            "TimeUnit": "seconds",
            "Name": self.structure.name,
            "AverageCost": self.cost,
            "Provenance": json.dumps(self.provenance),
        }
        with atomic_write(path) as temporary:
            savemat(temporary, data, appendmat=False, long_field_names=True)


def load_fit(path: str | PathLike[str]) -> Fit:
    """Read a fit that `Fit.save` wrote.

    Raises:
        StorageError: the file can't be read, or isn't JSON.
        InputError: it isn't a fit; the message names the file.
    """
    data = read_json(path)
    with placed(path):
        return Fit.from_dict(data)


def _misfit(table: Any) -> Misfit:
    """Return what `Misfit.to_dict` wrote. Raises InputError."""
    keys = ("magnitude_db", "phase_deg", "ratio")
    given = convert(_Table, table, "misfit")
    if any(key not in given for key in keys):
        raise InputError(f"misfit needs {', '.join(keys)}; it has {', '.join(given)}")
    magnitude, phase = (convert(Mapping[str, float], given[key], key) for key in keys[:2])
    found = Misfit(magnitude, phase, convert(float | None, given["ratio"], "ratio"))
    if {*found.magnitude} != {*found.phase}:
        raise InputError("misfit has other responses in magnitude_db than in phase_deg")
    return found


def _matrix(rows: Any, shape: tuple[int, int], name: str) -> NDArray[np.float64] | None:
    """Return a matrix of plain data, None where it isn't finite, as numbers. Raises InputError."""
    if rows is None:
        return None
    cells = convert(_Rows, rows, name)
    if len(cells) != shape[0] or any(len(row) != shape[1] for row in cells):
        raise InputError(f"the fit's {name} must be {shape[0]} rows of {shape[1]} numbers")
    numbers = [[np.inf if x is None else x for x in row] for row in cells]
    return np.array(numbers, dtype=np.float64).reshape(shape)


def descriptor(model: "control.StateSpace", by_rate: NDArray[np.float64]) -> dict[str, Any]:
    """Return E dx/dt = A x + B u, y = C x + D u; E only where outputs follow an input's rate.

    Such an input z has two more states, itself and its rate w: 0 = u - z, dz/dt = w.

    Args:
        model: without what follows rates, states named.
        by_rate: (n_out, n_in) D1, by how much an output follows an input's rate.
    """
    a, b, c, d = (np.asarray(matrix) for matrix in (model.A, model.B, model.C, model.D))
    followed = np.flatnonzero(np.any(by_rate != 0.0, axis=0))
    k, n = followed.size, a.shape[0]
    if not k:
        return {"A": a, "B": b, "C": c, "D": d, "StateName": _cells(model.state_labels)}
    inner, none = np.eye(k), np.zeros((k, k))
    names = [model.input_labels[j] for j in followed]
    return {
        "A": block_diag(a, -inner, inner),
        "B": np.vstack([b, np.eye(b.shape[1])[followed], np.zeros((k, b.shape[1]))]),
        "C": np.hstack([c, np.zeros((c.shape[0], k)), by_rate[:, followed]]),
        "D": d,
        "E": block_diag(np.eye(n), np.block([[none, none], [inner, none]])),
        "StateName": _cells([*model.state_labels, *names, *(f"d({name})/dt" for name in names)]),
    }


def _cells(names: Sequence[str]) -> NDArray[np.object_]:
    """Return names as a column cell array."""
    cells = np.empty((len(names), 1), dtype=object)
    cells[:, 0] = names
    return cells
