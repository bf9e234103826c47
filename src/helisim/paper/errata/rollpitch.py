"""What is wrong in section 3.2: the roll-pitch models of Table 3."""

import math

import numpy as np

from helisim.paper import jr700
from helisim.paper.errata.erratum import Erratum, of, percent_change

_CR_GUIDELINE = 20.0
_INSENSITIVITY_GUIDELINE = 10.0
"""Percent; Tischler and Remple, the guidelines of the CIFER method that the paper follows."""
_COST_ACCEPTABLE = 100.0
_COST_EXCELLENT = 50.0
"""Average cost J; the same guidelines."""


def cost_very_well() -> Erratum:
    """Return the erratum of a fit that is called very good."""
    cost = jr700.ROLLPITCH_IN2.cost or 0.0
    return Erratum(
        title="A fit at the limit called very good",
        where="section 3.2, on Table 3",
        printed="the identification results fit the flight data very well",
        calculation=f"{cost:.2f} / {_COST_ACCEPTABLE:g} = {cost / _COST_ACCEPTABLE:.3f}",
        computed=(
            f"IN2's average cost is {cost / _COST_ACCEPTABLE:.0%} of what is acceptable; "
            f"excellent is {_COST_EXCELLENT:g} or less"
        ),
        conclusion="The IN1 column is a good fit, the IN2 column just an acceptable one.",
        confirmed=cost > _COST_EXCELLENT,
    )


def tau_f_rise() -> Erratum:
    """Return the erratum of the rotor's time constant."""
    before, after = of(jr700.ROLLPITCH_IN1, "tau_f"), of(jr700.ROLLPITCH_IN2, "tau_f")
    return Erratum(
        title="The rotor's time constant falls",
        where="section 3.2, on Table 3",
        printed=f"after the gyro tau_f is increased of {jr700.CLAIMED_TAU_F_RISE_PERCENT:g} %",
        calculation=f"{after:g} / {before:g} - 1 = {percent_change(after, before):.1f} %",
        computed=(
            f"a fall of {-percent_change(after, before):.1f} %; "
            f"{before:g} / {after:g} - 1 = {percent_change(before, after):.1f} %"
        ),
        conclusion="The ratio was taken upside down: IN1 is larger than IN2 by that much.",
        confirmed=after < before,
    )


def gyro_ratio() -> Erratum:
    """Return the erratum of the ratio of the gyro's settings."""
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    names = ("A_lon", "B_lat")
    ratios = {name: of(after, name) / of(before, name) for name in names}
    bounds = {
        name: math.hypot(before[name].cr_percent or 0.0, after[name].cr_percent or 0.0)
        for name in names
    }
    claimed = jr700.CLAIMED_GYRO_RATIO
    short = {name: 100.0 * (1.0 - ratio / claimed) for name, ratio in ratios.items()}
    return Erratum(
        title="The ratio of the gyro's settings is not quite met",
        where="section 3.2",
        printed=f"A_lon and B_lat, IN2 over IN1, are about {claimed:g}",
        calculation=", ".join(
            f"{name}: {of(after, name):g} / {of(before, name):g} = {ratio:.3f}"
            for name, ratio in ratios.items()
        ),
        computed=" and ".join(f"{short[name]:.1f} % below" for name in names)
        + f"; the Cramér-Rao bounds of the ratios are {bounds['A_lon']:.1f} and "
        f"{bounds['B_lat']:.1f} %",
        conclusion=(
            f"Nearer {np.mean(list(ratios.values())):.2f}. The bounds allow {claimed:g}, "
            "so the match is possible, not shown; and with the gyro inside, these ratios are not "
            "stick gains (section 3.2 says so)."
        ),
        confirmed=all(
            round(ratio, 2) != claimed and short[name] < bounds[name]
            for name, ratio in ratios.items()
        ),
    )


def rise(what: str, names: tuple[str, ...], printed: str) -> Erratum:
    """Return the erratum of parameters that are said to rise."""
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    change = {name: percent_change(of(after, name), of(before, name)) for name in names}
    return Erratum(
        title=f"{what} fall",
        where="section 3.2, on Table 3",
        printed=printed,
        calculation=", ".join(
            f"{name}: |{of(after, name):g}| / |{of(before, name):g}| - 1 = {value:.1f} %"
            for name, value in change.items()
        ),
        computed=", ".join(f"{name} falls by {-value:.1f} %" for name, value in change.items()),
        conclusion="The columns of Table 3 were compared in the wrong direction.",
        confirmed=all(value < 0.0 for value in change.values()),
    )


def all_rise() -> Erratum:
    """Return the erratum of what abstract and conclusion say of all parameters."""
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    names = [name for name in before.names if not name.startswith("tau_l")]
    larger = [name for name in names if abs(of(after, name)) > abs(of(before, name))]
    return Erratum(
        title="All parameters decrease",
        where="abstract and conclusion 2",
        printed="all the parameters increased a certain degree, from before gyro to after",
        calculation=f"count of |IN2| > |IN1| in Table 3: {len(larger)} of {len(names)}",
        computed=", ".join(
            f"{name} {percent_change(of(after, name), of(before, name)):+.0f} %" for name in names
        ),
        conclusion="The trend is the opposite one, without exception; delays are left out.",
        confirmed=not larger,
    )


def inertia_ratio() -> Erratum:
    """Return the erratum of the ratio of the moments of inertia."""
    tables = (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
    ratios = [of(table, "L_b") / of(table, "M_a") for table in tables]
    bounds = [
        math.hypot(table["L_b"].cr_percent or 0.0, table["M_a"].cr_percent or 0.0)
        for table in tables
    ]
    return Erratum(
        title="A gyro that changes the inertia",
        where="Table 3",
        printed="L_b and M_a of IN1 and of IN2, as flapping spring derivatives",
        calculation=(
            "L_b / M_a = I_yy / I_xx: "
            + " and ".join(
                f"{of(table, 'L_b'):g} / {of(table, 'M_a'):g} = {ratio:.3f}"
                for table, ratio in zip(tables, ratios)
            )
        ),
        computed=(
            f"{percent_change(ratios[1], ratios[0]):.0f} % for the same airframe; the bounds of "
            f"the ratios are {bounds[0]:.0f} and {bounds[1]:.0f} %"
        ),
        conclusion=(
            "One hub stiffness acts on both axes, so the ratio belongs to the airframe. IN2's "
            "numbers have no such meaning, and the bounds are wide; helisim calibrates on IN1's."
        ),
        confirmed=not math.isclose(ratios[0], ratios[1], rel_tol=0.05),
    )


def leading_delay() -> Erratum:
    """Return the erratum of the negative delay."""
    lat, lon = (of(jr700.ROLLPITCH_IN1, name) for name in ("tau_lat", "tau_lon"))
    return Erratum(
        title="A delay that leads",
        where="Table 3, [IN1 OUT]",
        printed=f"tau_lon = {lon:g} s",
        calculation=f"tau_lat - tau_lon = {1e3 * lat:g} - ({1e3 * lon:g}) ms",
        computed=f"{1e3 * (lat - lon):.1f} ms between two inputs that share their servos",
        conclusion=(
            "No servo answers before its command: the recorder's channels are skewed. helisim "
            "models a latency of each channel."
        ),
        confirmed=lon < 0.0,
    )


def bounds_kept() -> Erratum:
    """Return the erratum of parameters beyond the guidelines."""
    over = [
        f"{value.name} ({table.input}) {value.cr_percent:.1f} %"
        for table in (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
        for value in table
        if value.cr_percent is not None and value.cr_percent > _CR_GUIDELINE
    ]
    insensitive = [
        f"{value.name} ({table.input}) {value.insensitivity_percent:.2f} %"
        for table in (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
        for value in table
        if value.insensitivity_percent is not None
        and value.insensitivity_percent > _INSENSITIVITY_GUIDELINE
    ]
    return Erratum(
        title="Parameters kept beyond the guidelines",
        where="Table 3",
        printed="no parameter is remarked on",
        calculation=f"CR > {_CR_GUIDELINE:g} %: {', '.join(over)}",
        computed=(
            f"{len(over)} bounds too wide; insensitivity > {_INSENSITIVITY_GUIDELINE:g} %: "
            f"{', '.join(insensitive)}"
        ),
        conclusion=(
            "By the method's own rule they should be fixed or dropped. helisim reports each "
            "with its verdict, and judges against these bounds."
        ),
        confirmed=bool(over),
    )


def tie() -> Erratum:
    """Return the erratum of the symmetry of A_b and B_a."""
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    ratios = [of(table, "A_b") / of(table, "B_a") for table in (before, after)]
    return Erratum(
        title="A symmetry imposed on one column only",
        where="Table 3 and section 3.2",
        printed="A_b = -B_a was added for IN2",
        calculation=(
            f"A_b / B_a: IN1 {of(before, 'A_b'):g} / {of(before, 'B_a'):g} = {ratios[0]:.3f}, "
            f"IN2 {of(after, 'A_b'):g} / {of(after, 'B_a'):g} = {ratios[1]:.3f}"
        ),
        computed=f"IN1 is {100.0 * (1.0 + ratios[0]):.0f} % from the symmetry",
        conclusion=(
            "The rotor is the same in both columns: comparing A_b and B_a between them compares "
            "two structures. helisim ties them where the paper does."
        ),
        confirmed=not math.isclose(ratios[0], -1.0, rel_tol=0.05)
        and math.isclose(ratios[1], -1.0, rel_tol=1e-9),
    )
