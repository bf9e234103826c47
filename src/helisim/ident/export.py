"""A fit for others to read: text and LaTeX tables, and a MAT file."""

import json
import math
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from scipy.io import savemat

from helisim.records.files import atomic_write

if TYPE_CHECKING:
    from helisim.ident.fitted import FittedParameter
    from helisim.ident.result import Fit

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


def latex_table(fit: "Fit", *, caption: str = "", label: str = "") -> str:
    """Return the parameters as a LaTeX `table`, values rounded by their standard errors.

    It needs the package booktabs. The errors are residual-scaled standard errors; CR and
    insensitivity are in percent of the value.
    """
    lines = [f"% {json.dumps(fit.provenance)}", r"\begin{table}", r"\centering"]
    if caption:
        lines.append(rf"\caption{{{caption}}}")
    if label:
        lines.append(rf"\label{{{label}}}")
    lines += [
        r"\begin{tabular}{llrrr}",
        r"\toprule",
        r"Parameter & Unit & Value & CR (\%) & $\bar{I}$ (\%) \\",
        r"\midrule",
        *(_latex_row(one) for one in fit.parameters.values()),
        r"\midrule",
        rf"\multicolumn{{5}}{{l}}{{Average cost $J_\mathrm{{ave}} = {fit.cost:.1f}$}} \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _latex_row(one: "FittedParameter") -> str:
    name, unit = f"${_latex_symbol(one.name)}$", _latex_unit(one.unit)
    if one.fixed:
        return rf"{name} & {unit} & ${one.value:.6g}$ & fixed & fixed \\"
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


def write_matlab(fit: "Fit", path: str | PathLike[str]) -> None:
    """Write A, B, C, D, InputDelay, OutputDelay, names and parameters as a MAT file.

    In MATLAB: m = load("model.mat"); sys = ss(m.A, m.B, m.C, m.D, "InputDelay",
    m.InputDelay, "OutputDelay", m.OutputDelay, "InputName", m.InputName). MATLAB's `ss`
    refuses negative delays, so what leads is written as such and left to the reader.

    Raises:
        StorageError: the file can't be written.
        IdentificationError: the model has no state-space form.
    """
    model, structure = fit.model, fit.structure
    free = list(fit.parameters.values())
    data = {
        "A": np.asarray(model.A),
        "B": np.asarray(model.B),
        "C": np.asarray(model.C),
        "D": np.asarray(model.D),
        "InputDelay": np.array([[fit.input_delays[name]] for name in structure.inputs]),
        "OutputDelay": np.array([[fit.output_delays[name]] for name in structure.outputs]),
        "InputName": _cells(structure.inputs),
        "OutputName": _cells(structure.outputs),
        "StateName": _cells(structure.states),
        "InputUnit": _cells(fit.data.input_units),
        "OutputUnit": _cells(fit.data.output_units),
        "TimeUnit": "seconds",
        "Name": structure.name,
        "ParameterName": _cells([one.name for one in free]),
        "ParameterUnit": _cells([one.unit for one in free]),
        "ParameterValue": np.array([[one.value] for one in free]).reshape(-1, 1),
        "ParameterCramerRao": np.array([[one.cramer_rao] for one in free]).reshape(-1, 1),
        "ParameterStandardError": np.array([[one.standard_error] for one in free]).reshape(-1, 1),
        "AverageCost": fit.cost,
        "Provenance": json.dumps(fit.provenance),
    }
    with atomic_write(path) as temporary:
        savemat(temporary, data, appendmat=False, long_field_names=True)


def _cells(names: "tuple[str, ...] | list[str]") -> np.ndarray:
    """Return names as a column cell array."""
    cells = np.empty((len(names), 1), dtype=object)
    for k, name in enumerate(names):
        cells[k, 0] = name
    return cells


def text_table(fit: "Fit") -> str:
    """Return the fit as a table, with everything a reader should know below it."""
    lines = [f"{fit.structure.name}: {fit.structure.meaning}".rstrip(": "), ""]
    width = max(9, *(len(name) for name in fit.parameters), 0)
    units = max(4, *(len(one.unit) for one in fit.parameters.values()), 0)
    lines.append(
        f"{'parameter':<{width}}  {'unit':<{units}}  {'value':>12}  {'CR %':>7}  "
        f"{'insens. %':>9}  {'std. error':>10}  verdict"
    )
    for one in fit.parameters.values():
        numbers = (
            f"{'-':>7}  {'-':>9}  {'-':>10}"
            if one.fixed
            else f"{one.cr_percent:7.2f}  {one.insensitivity_percent:9.2f}  "
            f"{one.standard_error:10.3g}"
        )
        lines.append(
            f"{one.name:<{width}}  {one.unit:<{units}}  {one.value:12.6g}  {numbers}  "
            f"{fit.verdict(one.name)}"
        )
    lines.append("")
    for name, cost in fit.costs.items():
        low, high = fit.bands[name]
        lines.append(f"J {name} = {cost:.4g} from {low:.3g} to {high:.3g} rad/s")
    quality = "excellent" if fit.excellent else "acceptable" if fit.acceptable else "too high"
    lines.append(f"average J = {fit.cost:.4g}: {quality}")
    return "\n".join(lines + _remarks(fit))


def _remarks(fit: "Fit") -> list[str]:
    remarks = []
    if not fit.converged:
        remarks.append("the search did not converge: give better starts, or fix a parameter")
    if fit.searches_agreeing < 2:
        remarks.append("only one start ended in this minimum: try more searches")
    if fit.dropped:
        remarks.append(f"left out for lack of coherence: {', '.join(fit.dropped)}")
    remarks.extend(f"{a} and {b} are correlated by {r:.3f}" for a, b, r in fit.correlated)
    return remarks + list(fit.data.flags)
