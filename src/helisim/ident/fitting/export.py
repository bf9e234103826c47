"""Fitted parameters and models for others to read: text and LaTeX tables, and a MAT file."""

import json
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from helisim.base.errors import IdentificationError
from helisim.base.files import atomic_write
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.misfit import RATIO_LIMIT
from helisim.ident.fitting.modes import text_lines

if TYPE_CHECKING:
    import control

    from helisim.ident.fitting.result import Fit

_LATEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}

_FEW_RESPONSES = 2
"""Up to so many responses a fit's text has their zeros; `print(fit.modes)` has them all."""

_UNSURE_DIGITS = 4
"""Significant digits of a value whose error is unknown."""

_MOST_DIGITS = 7
"""Significant digits of a value whose error is negligible, as on data without noise."""


def rounded(value: float, error: float) -> tuple[str, str]:
    """Return a value and its error as text, rounded by the Particle Data Group's rule.

    The error keeps two digits where its first three are 100 to 354, one from 355 to 949, and
    becomes 1.0 of the next decade above; the value ends at the same decimal. The error is empty
    where it is negligible.
    """
    if not math.isfinite(value):
        return str(value), ""
    if not math.isfinite(error):
        return f"{value:.{_UNSURE_DIGITS}g}", r"\infty"
    if error <= abs(value) * 10.0**-_MOST_DIGITS:
        return f"{value:.{_MOST_DIGITS}g}", ""
    decade = math.floor(math.log10(error))
    first = round(error / 10.0 ** (decade - 2))
    if first >= 1000:
        decade, first = decade + 1, 100
    if first >= 950:
        decade, digits, error = decade + 1, 2, 10.0 ** (decade + 1)
    else:
        digits = 2 if first < 355 else 1
    decimals = digits - 1 - decade
    if decimals >= 0:
        return f"{value:.{decimals}f}", f"{error:.{decimals}f}"
    return f"{round(value, decimals):.0f}", f"{round(error, decimals):.0f}"


def latex_table(
    parameters: Collection[FittedParameter],
    *,
    cost: float,
    provenance: Mapping[str, Any],
    caption: str = "",
    label: str = "",
) -> str:
    """Return parameters as a LaTeX `table`, values rounded by their standard errors.

    It needs the package booktabs. The errors are standard errors; CR and
    insensitivity are in percent of the value.

    Args:
        parameters: one a row.
        cost: average cost of the fit, the last row.
        provenance: plain data, a comment above the table.
        caption: of the table; none if empty.
        label: of the table; none if empty.
    """
    lines = [f"% {json.dumps(provenance)}", r"\begin{table}", r"\centering"]
    if caption:
        lines.append(rf"\caption{{{caption}}}")
    if label:
        lines.append(rf"\label{{{label}}}")
    lines += [
        r"\begin{tabular}{llrrr}",
        r"\toprule",
        r"Parameter & Unit & Value & CR (\%) & $\bar{I}$ (\%) \\",
        r"\midrule",
        *(_latex_row(one) for one in parameters),
        r"\midrule",
        rf"\multicolumn{{5}}{{l}}{{Average cost $J_\mathrm{{ave}} = {cost:.1f}$}} \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _latex_row(one: FittedParameter) -> str:
    name, unit = f"${_latex_symbol(one.name)}$", _latex_unit(one.unit)
    if one.fixed:
        known = rf" \pm {one.standard_error:.2g}" if one.standard_error else ""
        return rf"{name} & {unit} & ${one.value:.6g}{known}$ & fixed & fixed \\"
    value, error = rounded(one.value, one.standard_error)
    number = rf"${value} \pm {error}$" if error else f"${value}$"
    mark = r"\,$^*$" if one.poorly_identified or one.at_bound else ""
    percent = " & ".join(
        f"{x:.1f}" if math.isfinite(x) else r"$\infty$"
        for x in (one.cr_percent, one.insensitivity_percent)
    )
    return rf"{name}{mark} & {unit} & {number} & {percent} \\"


_GREEK = ("tau", "omega", "zeta", "alpha", "beta", "gamma", "delta", "theta", "phi", "psi")


def _latex_symbol(name: str) -> str:
    head, *tail = name.split("_")
    first = rf"\{head}" if head in _GREEK else head if len(head) == 1 else rf"\mathrm{{{head}}}"
    return rf"{first}_{{\mathrm{{{','.join(tail)}}}}}" if tail else first


def _latex_unit(unit: str) -> str:
    escaped = "".join(_LATEX_SPECIAL.get(character, character) for character in unit)
    return escaped.replace(r"\textasciicircum{}2", r"$^2$").replace(r"\textasciicircum{}3", r"$^3$")


def write_matlab(
    path: str | PathLike[str],
    model: "control.StateSpace",
    parameters: Collection[FittedParameter],
    facts: Mapping[str, Any],
    *,
    by_rate: NDArray[np.float64],
) -> None:
    """Write A, B, C, D, names, parameters and further facts as a MAT file.

    In MATLAB: m = load("model.mat"); sys = ss(m.A, m.B, m.C, m.D, "InputDelay",
    m.InputDelay, "OutputDelay", m.OutputDelay, "InputName", m.InputName). MATLAB's `ss`
    refuses negative delays, so what leads is written as such and left to the reader. It has no
    delay for a pair either: sys = tf(sys); sys.IODelay = m.IODelay has. A model with D1 has E
    too, and is sys = dss(m.A, m.B, m.C, m.D, m.E, ...): its last states are the inputs and
    their rates.

    Args:
        path: of the file.
        model: in state space, its signals and states named.
        parameters: of the model.
        facts: name in the file -> text, number, list of texts or array of numbers.
        by_rate: (n_out, n_in) D1, by how much an output follows an input's rate.

    Raises:
        StorageError: the file can't be written.
    """
    from scipy.io import savemat  # slow to import, and few write such files

    def column(of: Callable[[FittedParameter], float]) -> np.ndarray:
        return np.array([[of(one)] for one in parameters]).reshape(-1, 1)

    data = {
        **_descriptor(model, by_rate),
        "InputName": _cells(model.input_labels),
        "OutputName": _cells(model.output_labels),
        "ParameterName": _cells([one.name for one in parameters]),
        "ParameterUnit": _cells([one.unit for one in parameters]),
        "ParameterValue": column(lambda one: one.value),
        "ParameterCramerRao": column(lambda one: one.cramer_rao),
        "ParameterStandardError": column(lambda one: one.standard_error),
        **{
            name: _cells(fact) if isinstance(fact, list | tuple) else fact
            for name, fact in facts.items()
        },
    }
    with atomic_write(path) as temporary:
        savemat(temporary, data, appendmat=False, long_field_names=True)


def _descriptor(model: "control.StateSpace", by_rate: NDArray[np.float64]) -> dict[str, Any]:
    """Return E dx/dt = A x + B u, y = C x + D u; E only where outputs follow an input's rate.

    Such an input z has two more states, itself and its rate w: 0 = u - z, dz/dt = w.
    """
    a, b, c, d = (np.asarray(matrix) for matrix in (model.A, model.B, model.C, model.D))
    plain = {"A": a, "B": b, "C": c, "D": d, "StateName": _cells(model.state_labels)}
    followed = np.flatnonzero(np.any(by_rate != 0.0, axis=0))
    k, n = followed.size, a.shape[0]
    if not k:
        return plain
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


def _cells(names: Sequence[str]) -> np.ndarray:
    """Return names as a column cell array."""
    cells = np.empty((len(names), 1), dtype=object)
    for k, name in enumerate(names):
        cells[k, 0] = name
    return cells


def fit_text(fit: "Fit", parameters: Collection[FittedParameter]) -> str:
    """Return a fit in words: its parameters, costs, and what a reader should know.

    Args:
        fit: what was found.
        parameters: its own, or the same in other units.
    """
    lines = [f"{fit.structure.name}: {fit.structure.meaning}".rstrip(": "), ""]
    lines += [*text_table(parameters, fit.support), ""]
    lines += modes_text(fit)
    for name, cost in fit.costs.items():
        low, high = fit.bands[name]
        left = f"; {fit.misfit.words(name)}" if fit.misfit else ""
        lines.append(f"J {name} = {cost:.4g} from {low:.3g} to {high:.3g} rad/s{left}")
    if fit.misfit and fit.misfit.ratio is not None:
        lines.append(fit.misfit.summary)
    unlike = fit.misfit is not None and (fit.misfit.ratio or 0.0) > RATIO_LIMIT
    judged = f"{fit.judged}{', as costs go' if unlike else ''}"
    lines += [f"average J = {fit.cost:.4g}: {judged}", *fit.remarks]
    return "\n".join(lines)


def modes_text(fit: "Fit") -> list[str]:
    """Return the poles as lines of text, with the zeros where there are one or two responses."""
    try:
        found = fit.modes
    except IdentificationError:  # M is singular, so there are none
        return []
    if not found.poles:
        return []
    if len(fit.costs) > _FEW_RESPONSES:
        found = replace(found, zeros={}, gains={})
    return [*text_lines(found), ""]


def text_table(parameters: Collection[FittedParameter], support: Callable[[str], str]) -> list[str]:
    """Return parameters with their accuracy as lines of text, headings first.

    Args:
        parameters: one a line.
        support: what the data say of a parameter, by its name.
    """
    width = max(9, *(len(one.name) for one in parameters), 0)
    units = max(4, *(len(one.unit) for one in parameters), 0)
    lines = [
        f"{'parameter':<{width}}  {'unit':<{units}}  {'value':>12}  {'CR %':>7}  "
        f"{'insens. %':>9}  {'std. error':>10}  support"
    ]
    for one in parameters:
        numbers = (
            f"{'-':>7}  {'-':>9}  {f'{one.standard_error:.3g}' if one.standard_error else '-':>10}"
            if one.fixed
            else f"{one.cr_percent:7.2f}  {one.insensitivity_percent:9.2f}  "
            f"{one.standard_error:10.3g}"
        )
        lines.append(
            f"{one.name:<{width}}  {one.unit:<{units}}  {one.value:12.6g}  {numbers}  "
            f"{support(one.name)}"
        )
    return lines
