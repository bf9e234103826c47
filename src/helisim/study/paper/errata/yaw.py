"""What is wrong in section 3.1: the yaw models and the gyro."""

import math
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from helisim.base.units import RAD_PER_DEG
from helisim.study.paper import jr700
from helisim.study.paper.eq8 import overall_from_parts
from helisim.study.paper.errata.erratum import Row, of

_EQUATION_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 10)
_FIGURE_NUMBERS = (1, 2, 3, 3, 4, 5, 6, 7, 8)
"""As printed, in the order of the text."""

_GAINS = ("k_p", "k_I", "k_delta", "k_a")


def _twice() -> dict[str, Any]:
    given = {"equation": _EQUATION_NUMBERS, "figure": _FIGURE_NUMBERS}
    found = [
        f"{what} {number}"
        for what, numbers in given.items()
        for number, count in Counter(numbers).items()
        if count > 1
    ]
    equations, last_equation = len(_EQUATION_NUMBERS), max(_EQUATION_NUMBERS)
    figures, last_figure = len(_FIGURE_NUMBERS), max(_FIGURE_NUMBERS)
    twice, confirmed = ", ".join(found), bool(found)
    return locals()


def _gyro_units() -> dict[str, Any]:
    k_a, k_delta = jr700.YAW_GYRO["k_a"].unit, jr700.YAW_GYRO["k_delta"].unit
    confirmed = k_a != k_delta
    return locals()


def _steady_states() -> dict[str, Any]:
    (n_ped, n_r), (b0, a0) = of(jr700.YAW_BASE, "N_ped", "N_r"), of(jr700.YAW_OVERALL, "b0", "a0")
    damping, base, overall = -n_r, n_ped / -n_r, b0 / a0
    times, confirmed = base / overall, not math.isclose(base, overall, rel_tol=0.1)
    return locals()


def _margin() -> dict[str, Any]:
    n_r, n_ped, tau = of(jr700.YAW_BASE, "N_r", "N_ped", "tau_r_base")
    k_p, k_i, k_a = of(jr700.YAW_GYRO, "k_p", "k_I", "k_a")

    def loop(omega: float) -> complex:
        s = 1j * omega
        return k_a * (k_p + k_i / s) * n_ped / (s - n_r)

    unity = root_scalar(lambda omega: abs(loop(omega)) - 1.0, bracket=(1.0, 200.0))
    crossover = float(unity.root)
    open_phase = math.pi + float(np.angle(loop(crossover)))
    free, margin = (x / RAD_PER_DEG for x in (open_phase, open_phase - crossover * tau))
    borne, confirmed = 1e3 * open_phase / crossover, margin < 0.0
    return locals()


def _rank() -> dict[str, Any]:
    def products(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        k_p, k_i, k_delta, k_a = np.exp(logs)
        return np.log([k_p * k_delta, k_i * k_delta, k_p * k_a, k_i * k_a])

    point = np.log(of(jr700.YAW_GYRO, *_GAINS))
    steps = 1e-6 * np.eye(len(point))
    slopes = [(products(point + step) - products(point - step)) / 2e-6 for step in steps]
    rank = int(np.linalg.matrix_rank(np.array(slopes).T, tol=1e-6))
    gains, confirmed = len(point), rank < len(point)
    return locals()


def _k_p() -> dict[str, Any]:
    proportional, integral = jr700.YAW_GYRO["k_p"], jr700.YAW_GYRO["k_I"]
    k_p, k_i, ratio = proportional.value, integral.value, integral.value / proportional.value
    confirmed = "[IN2 OUT]" in proportional.source and "ground test" in integral.source
    return locals()


def _constants() -> dict[str, Any]:
    (base,), (overall,) = of(jr700.YAW_BASE, "tau_r_base"), of(jr700.YAW_OVERALL, "tau_r_all")
    base_gain, overall_gain = math.exp(-base), math.exp(-overall)
    base_less, overall_less = 100.0 * (1.0 - base_gain), 100.0 * (1.0 - overall_gain)
    confirmed = base_less > 0.0
    return locals()


def _rounding() -> dict[str, Any]:
    base, gyro, overall = (
        dict(zip(table.names, of(table, *table.names)))
        for table in (jr700.YAW_BASE, jr700.YAW_GYRO, jr700.YAW_OVERALL)
    )
    products = overall_from_parts(base, {**gyro, "tau_PED": 0.0})
    names = ("b1", "b0", "a1", "a0")
    printed, computed = (
        ", ".join(f"{name} = {values[name]:.7g}" for name in names)
        for values in (overall, products)
    )
    millionths, worst = max((1e6 * abs(overall[x] / products[x] - 1.0), x) for x in names)
    confirmed = millionths > 1.0
    return locals()


def _costs() -> dict[str, Any]:
    before, after = jr700.ROLLPITCH_IN1.cost or 0.0, jr700.ROLLPITCH_IN2.cost or 0.0
    times, confirmed = after / before, after > before
    return locals()


ROWS = (
    Row(
        title="Numbers given twice",
        where="sections 3.1 and 3.2",
        printed="eq. (8) is G_r_all and the roll-pitch model; Figure 3 is the loop and its fit",
        calculation="{equations} equations numbered 1 to {last_equation}, "
        "{figures} figures numbered 1 to {last_figure}",
        computed="used twice: {twice}",
        conclusion='"Equation 8" in section 3.2 is the roll-pitch model; here the section is said.',
        figures=_twice,
    ),
    Row(
        title="Gyro law garbled",
        where="eq. (4)",
        printed="G_r = arg(r) ped = H1 PED + H2 k_delta",
        calculation="H1 PED has the unit of k_delta, {k_delta}; H2 k_delta that of k_a, {k_a}",
        computed="a sum of {k_delta} and {k_a}, without the yaw rate",
        conclusion="ped = H1 PED + H2 r, which is eq. (7).",
        figures=_gyro_units,
    ),
    Row(
        title="Overall yaw model labelled with the base model's input",
        where="eqs. (5) and (8) of section 3.1",
        printed="G_r_all = r/ped, as G_r_base = r/ped in eqs. (1) and (6)",
        calculation="steady state of (6): {n_ped:g} / {damping:g} = {base:.1f} rad/s; "
        "of (8): {b0:g} / {a0:g} = {overall:.2f} rad/s",
        computed="{times:.1f} times apart under one name",
        conclusion="The input of G_r_all is the stick: r/PED, from [IN2 OUT].",
        figures=_steady_states,
    ),
    Row(
        title="The base model's delay can't be in the gyro's loop",
        where="eqs. (1), (5) and Table 2",
        printed="tau_r_base = {tau:g} s in (1), a loop without delay in (5)",
        calculation="|L| = 1 at {crossover:.1f} rad/s; phase margin {free:.1f} - "
        "{crossover:.1f} x {tau:g} = {margin:.1f} degrees",
        computed="unstable with the delay inside; the loop bears {borne:.1f} ms",
        conclusion="The helicopter flew, so most of the delay is in the record of the yaw rate, "
        "not in the loop. helisim puts it there.",
        figures=_margin,
    ),
    Row(
        title="Four gains where the signals hold three",
        where="eqs. (2), (3) and Table 2",
        printed="k_p, k_I, k_delta and k_a, each a number",
        calculation="d(k_p k_delta, k_I k_delta, k_p k_a, k_I k_a)/d(k_p, k_I, k_delta, k_a) "
        "has rank {rank} of {gains}",
        computed="k_p, k_I times c and k_delta, k_a over c give the same H1 and H2 for any c",
        conclusion="One gain is a convention. helisim takes k_delta as given, and the ratio "
        "k_I/k_p, k_p k_delta and k_p k_a as what records tell.",
        figures=_rank,
    ),
    Row(
        title="Two sources for one gain",
        where="section 3.1 and Table 2",
        printed="k_p and k_I from a step on the ground (text); k_p from [IN2 OUT] (Table 2)",
        calculation="slope over jump of one ground step: k_I / k_p = {k_i:g} / {k_p:g} = "
        "{ratio:.2f} 1/s",
        computed="Table 2 takes {k_i:g} from the ground and {k_p:g} from flight: the ground's own "
        "ratio is not printed",
        conclusion="Table 2 is followed; `helisim bench` gives k_p and k_I from one step.",
        figures=_k_p,
    ),
    Row(
        title="Delays printed as constants",
        where="eqs. (6) and (8) of section 3.1",
        printed="e^-{base:g} and e^-{overall:g}",
        calculation="e^-{base:g} = {base_gain:.3f}, e^-{overall:g} = {overall_gain:.3f}",
        computed="gains {base_less:.1f} % and {overall_less:.1f} % below 1, and no delay",
        conclusion="The s is missing: e^(-tau s), as in eqs. (1) and (5).",
        figures=_constants,
    ),
    Row(
        title="Coefficients that Table 2 does not quite give",
        where="eq. (8) of section 3.1",
        printed="{printed}",
        calculation="eq. (5) with Table 2: {computed}",
        computed="{worst} is {millionths:.0f} millionths off, the others less",
        conclusion="Harmless: (8) was computed before Table 2 was rounded. It was computed, not "
        "identified, though Table 2 cites [IN2 OUT].",
        figures=_rounding,
    ),
    Row(
        title="A reason that holds for yaw only",
        where="section 3.1, against section 3.2",
        printed="[IN2 OUT] costs less because the sticks keep the sweep's frequencies better",
        calculation="roll-pitch: {after:.2f} from IN2 / {before:.2f} from IN1",
        computed="IN2 costs {times:.1f} times as much",
        conclusion="The pilot sweeps the sticks on every axis, so the reason would hold on all. "
        "What differs is the structure: it has the yaw gyro in it, not the cyclic one.",
        figures=_costs,
    ),
)
