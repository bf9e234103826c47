"""What is wrong in section 3.1: the yaw models and the gyro."""

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from helisim.paper import jr700
from helisim.paper.errata.erratum import Erratum, of
from helisim.units import RAD_PER_DEG

_EQUATION_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 10)
_FIGURE_NUMBERS = (1, 2, 3, 3, 4, 5, 6, 7, 8)
"""As printed, in the order of the text."""


def numbered_twice() -> Erratum:
    """Return the erratum of the numbers of equations and figures."""
    twice = {
        what: [str(number) for number, count in Counter(numbers).items() if count > 1]
        for what, numbers in (("equation", _EQUATION_NUMBERS), ("figure", _FIGURE_NUMBERS))
    }
    found = [f"{what} {number}" for what, numbers in twice.items() for number in numbers]
    return Erratum(
        title="Numbers given twice",
        where="sections 3.1 and 3.2",
        printed="eq. (8) is G_r_all and the roll-pitch model; Figure 3 is the loop and its fit",
        calculation=(
            f"{len(_EQUATION_NUMBERS)} equations numbered 1 to {max(_EQUATION_NUMBERS)}, "
            f"{len(_FIGURE_NUMBERS)} figures numbered 1 to {max(_FIGURE_NUMBERS)}"
        ),
        computed=f"used twice: {', '.join(found)}",
        conclusion='"Equation 8" in section 3.2 is the roll-pitch model; here the section is said.',
        confirmed=bool(found),
    )


def eq_4() -> Erratum:
    """Return the erratum of the gyro's law."""
    k_a, k_delta = jr700.YAW_GYRO["k_a"], jr700.YAW_GYRO["k_delta"]
    return Erratum(
        title="Gyro law garbled",
        where="eq. (4)",
        printed="G_r = arg(r) ped = H1 PED + H2 k_delta",
        calculation=(
            f"H1 PED has the unit of k_delta, {k_delta.unit}; H2 k_delta that of k_a, {k_a.unit}"
        ),
        computed=f"a sum of {k_delta.unit} and {k_a.unit}, without the yaw rate",
        conclusion="ped = H1 PED + H2 r, which is eq. (7).",
        confirmed=k_a.unit != k_delta.unit,
    )


def eq_5_input() -> Erratum:
    """Return the erratum of the input of the overall yaw model."""
    base, overall = jr700.YAW_BASE, jr700.YAW_OVERALL
    n_ped, n_r = of(base, "N_ped"), of(base, "N_r")
    b0, a0 = of(overall, "b0"), of(overall, "a0")
    return Erratum(
        title="Overall yaw model labelled with the base model's input",
        where="eqs. (5) and (8) of section 3.1",
        printed="G_r_all = r/ped, as G_r_base = r/ped in eqs. (1) and (6)",
        calculation=(
            f"steady state of (6): {n_ped:g} / {-n_r:g} = {n_ped / -n_r:.1f} rad/s; "
            f"of (8): {b0:g} / {a0:g} = {b0 / a0:.2f} rad/s"
        ),
        computed=f"{n_ped / -n_r / (b0 / a0):.1f} times apart under one name",
        conclusion="The input of G_r_all is the stick: r/PED, from [IN2 OUT].",
        confirmed=not math.isclose(n_ped / -n_r, b0 / a0, rel_tol=0.1),
    )


def delay_in_the_loop() -> Erratum:
    """Return the erratum of the delay of the base model and the gyro's loop."""
    base, gyro = jr700.YAW_BASE, jr700.YAW_GYRO
    n_r, n_ped, tau = (of(base, name) for name in ("N_r", "N_ped", "tau_r_base"))
    k_p, k_i, k_a = (of(gyro, name) for name in ("k_p", "k_I", "k_a"))

    def loop(omega: float) -> complex:
        s = 1j * omega
        return k_a * (k_p + k_i / s) * n_ped / (s - n_r)

    unity = root_scalar(lambda omega: abs(loop(omega)) - 1.0, bracket=(1.0, 200.0))
    crossover = float(unity.root)
    free = math.pi + float(np.angle(loop(crossover)))
    margin = free - crossover * tau
    return Erratum(
        title="The base model's delay can't be in the gyro's loop",
        where="eqs. (1), (5) and Table 2",
        printed=f"tau_r_base = {tau:g} s in (1), a loop without delay in (5)",
        calculation=(
            f"|L| = 1 at {crossover:.1f} rad/s; phase margin {free / RAD_PER_DEG:.1f} - "
            f"{crossover:.1f} x {tau:g} = {margin / RAD_PER_DEG:.1f} degrees"
        ),
        computed=(
            f"unstable with the delay inside; the loop bears {1e3 * free / crossover:.1f} ms"
        ),
        conclusion=(
            "The helicopter flew, so most of the delay is in the record of the yaw rate, not in "
            "the loop. helisim puts it there."
        ),
        confirmed=margin < 0.0,
    )


def _gains() -> NDArray[np.float64]:
    gyro = jr700.YAW_GYRO
    return np.array([of(gyro, name) for name in ("k_p", "k_I", "k_delta", "k_a")])


def too_many_gains() -> Erratum:
    """Return the erratum of the number of gains that the signals hold."""

    def products(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        k_p, k_i, k_delta, k_a = np.exp(logs)
        return np.log([k_p * k_delta, k_i * k_delta, k_p * k_a, k_i * k_a])

    point = np.log(_gains())
    jacobian = np.array(
        [(products(point + step) - products(point - step)) / 2e-6 for step in 1e-6 * np.eye(4)]
    ).T
    rank = int(np.linalg.matrix_rank(jacobian, tol=1e-6))
    return Erratum(
        title="Four gains where the signals hold three",
        where="eqs. (2), (3) and Table 2",
        printed="k_p, k_I, k_delta and k_a, each a number",
        calculation=(
            "d(k_p k_delta, k_I k_delta, k_p k_a, k_I k_a)/d(k_p, k_I, k_delta, k_a) "
            f"has rank {rank} of {len(point)}"
        ),
        computed="k_p, k_I times c and k_delta, k_a over c give the same H1 and H2 for any c",
        conclusion=(
            "One gain is a convention. helisim takes k_delta as given, and the ratio k_I/k_p, "
            "k_p k_delta and k_p k_a as what records tell."
        ),
        confirmed=rank < len(point),
    )


def k_p_source() -> Erratum:
    """Return the erratum of where k_p comes from."""
    k_p, k_i = jr700.YAW_GYRO["k_p"], jr700.YAW_GYRO["k_I"]
    return Erratum(
        title="Two sources for one gain",
        where="section 3.1 and Table 2",
        printed="k_p and k_I from a step on the ground (text); k_p from [IN2 OUT] (Table 2)",
        calculation=(
            f"slope over jump of one ground step: k_I / k_p = {k_i.value:g} / {k_p.value:g} = "
            f"{k_i.value / k_p.value:.2f} 1/s"
        ),
        computed=(
            f"Table 2 takes {k_i.value:g} from the ground and {k_p.value:g} from flight: the "
            "ground's own ratio is not printed"
        ),
        conclusion="Table 2 is followed; `helisim bench` gives k_p and k_I from one step.",
        confirmed="[IN2 OUT]" in k_p.source and "ground test" in k_i.source,
    )


def exponents() -> Erratum:
    """Return the erratum of the exponents of the delays."""
    base, overall = of(jr700.YAW_BASE, "tau_r_base"), of(jr700.YAW_OVERALL, "tau_r_all")
    return Erratum(
        title="Delays printed as constants",
        where="eqs. (6) and (8) of section 3.1",
        printed=f"e^-{base:g} and e^-{overall:g}",
        calculation=(
            f"e^-{base:g} = {math.exp(-base):.3f}, e^-{overall:g} = {math.exp(-overall):.3f}"
        ),
        computed=(
            f"gains {100.0 * (1.0 - math.exp(-base)):.1f} % and "
            f"{100.0 * (1.0 - math.exp(-overall)):.1f} % below 1, and no delay"
        ),
        conclusion="The s is missing: e^(-tau s), as in eqs. (1) and (5).",
        confirmed=math.exp(-base) < 1.0,
    )


def eq_8_rounding() -> Erratum:
    """Return the erratum of the coefficients of eq. (8)."""
    base, overall = jr700.YAW_BASE, jr700.YAW_OVERALL
    k_p, k_i, k_delta, k_a = _gains()
    n_r, n_ped = of(base, "N_r"), of(base, "N_ped")
    products = {
        "b1": k_p * n_ped * k_delta,
        "b0": k_i * n_ped * k_delta,
        "a1": k_p * k_a * n_ped - n_r,
        "a0": k_i * k_a * n_ped,
    }
    off = {name: of(overall, name) / value - 1.0 for name, value in products.items()}
    worst = max(off, key=lambda name: abs(off[name]))
    return Erratum(
        title="Coefficients that Table 2 does not quite give",
        where="eq. (8) of section 3.1",
        printed=", ".join(f"{name} = {of(overall, name):.7g}" for name in products),
        calculation=(
            "eq. (5) with Table 2: "
            + ", ".join(f"{name} = {value:.7g}" for name, value in products.items())
        ),
        computed=f"{worst} is {1e6 * abs(off[worst]):.0f} millionths off, the others less",
        conclusion=(
            "Harmless: (8) was computed before Table 2 was rounded. It was computed, not "
            "identified, though Table 2 cites [IN2 OUT]."
        ),
        confirmed=bool(abs(off[worst]) > 1e-6),
    )


def yaw_costs() -> Erratum:
    """Return the erratum of why IN2 is said to cost less."""
    before, after = jr700.ROLLPITCH_IN1.cost or 0.0, jr700.ROLLPITCH_IN2.cost or 0.0
    return Erratum(
        title="A reason that holds for yaw only",
        where="section 3.1, against section 3.2",
        printed="[IN2 OUT] costs less because the sticks keep the sweep's frequencies better",
        calculation=f"roll-pitch: {after:.2f} from IN2 / {before:.2f} from IN1",
        computed=f"IN2 costs {after / before:.1f} times as much",
        conclusion=(
            "The pilot sweeps the sticks on every axis, so the reason would hold on all. What "
            "differs is the structure: it has the yaw gyro in it, not the cyclic one."
        ),
        confirmed=after > before,
    )
