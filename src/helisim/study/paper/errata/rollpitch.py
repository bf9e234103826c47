"""What is wrong in section 3.2: the roll-pitch models of Table 3."""

import math
from functools import partial
from typing import Any

import numpy as np

from helisim.study.paper import ReferenceTable, ReferenceValue, jr700
from helisim.study.paper.errata.erratum import Row, of, percent_change

_CR_GUIDELINE = 20.0
_INSENSITIVITY_GUIDELINE = 10.0
"""Percent; Tischler and Remple, the guidelines of the CIFER method that the paper follows."""
_COST_ACCEPTABLE = 100.0
_COST_EXCELLENT = 50.0
"""Average cost J; the same guidelines."""


def _cost() -> dict[str, Any]:
    cost, acceptable, excellent = jr700.ROLLPITCH_IN2.cost or 0.0, _COST_ACCEPTABLE, _COST_EXCELLENT
    share, confirmed = cost / acceptable, cost > excellent
    return locals()


def _columns(*names: str) -> tuple[dict[str, float], dict[str, float]]:
    """Return parameters of Table 3 by name, from IN1 and from IN2."""
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    return dict(zip(names, of(before, *names))), dict(zip(names, of(after, *names)))


def _tau_f() -> dict[str, Any]:
    (before,), (after,) = (column.values() for column in _columns("tau_f"))
    claimed, change = jr700.CLAIMED_TAU_F_RISE_PERCENT, percent_change(after, before)
    fall, inverse, confirmed = -change, percent_change(before, after), after < before
    return locals()


def _gyro_ratio() -> dict[str, Any]:
    names, claimed = ("A_lon", "B_lat"), jr700.CLAIMED_GYRO_RATIO
    before, after = _columns(*names)
    ratios = {name: after[name] / before[name] for name in names}
    bounds = {
        name: _together(jr700.ROLLPITCH_IN1[name], jr700.ROLLPITCH_IN2[name]) for name in names
    }
    short = {name: 100.0 * (1.0 - ratio / claimed) for name, ratio in ratios.items()}
    below = " and ".join(f"{short[name]:.1f} % below" for name in names)
    wide = " and ".join(f"{bounds[name]:.1f}" for name in names)
    calculation = ", ".join(
        f"{name}: {after[name]:g} / {before[name]:g} = {ratios[name]:.3f}" for name in names
    )
    mean = np.mean(list(ratios.values()))
    confirmed = all(
        round(ratios[name], 2) != claimed and short[name] < bounds[name] for name in names
    )
    return locals()


def _together(one: ReferenceValue, other: ReferenceValue) -> float:
    """Return the Cramér-Rao bound of a ratio, percent."""
    return math.hypot(one.cr_percent or 0.0, other.cr_percent or 0.0)


def _falls(*names: str) -> dict[str, Any]:
    before, after = _columns(*names)
    change = {name: percent_change(after[name], before[name]) for name in names}
    changes = ", ".join(
        f"{name}: |{after[name]:g}| / |{before[name]:g}| - 1 = {value:.1f} %"
        for name, value in change.items()
    )
    falls = ", ".join(f"{name} falls by {-value:.1f} %" for name, value in change.items())
    confirmed = max(change.values()) < 0.0
    return locals()


def _all() -> dict[str, Any]:
    names = [name for name in jr700.ROLLPITCH_IN1.names if not name.startswith("tau_l")]
    before, after = _columns(*names)
    change = {name: percent_change(after[name], before[name]) for name in names}
    larger = sum(value > 0.0 for value in change.values())
    changes = ", ".join(f"{name} {value:+.0f} %" for name, value in change.items())
    count, confirmed = len(names), not larger
    return locals()


def _quotients(above: str, below: str) -> tuple[list[float], list[str]]:
    """Return the ratio of two parameters from IN1 and from IN2, and how it is written."""
    columns = _columns(above, below)
    ratios = [column[above] / column[below] for column in columns]
    return ratios, [
        f"{column[above]:g} / {column[below]:g} = {ratio:.3f}"
        for column, ratio in zip(columns, ratios)
    ]


def _inertia() -> dict[str, Any]:
    (before, after), written = _quotients("L_b", "M_a")
    tables = (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
    bounds = " and ".join(f"{_together(table['L_b'], table['M_a']):.0f}" for table in tables)
    quotients, change = " and ".join(written), percent_change(after, before)
    confirmed = not math.isclose(before, after, rel_tol=0.05)
    return locals()


def _lead() -> dict[str, Any]:
    lat, lon = of(jr700.ROLLPITCH_IN1, "tau_lat", "tau_lon")
    lat_ms, lon_ms, apart = 1e3 * lat, 1e3 * lon, 1e3 * (lat - lon)
    confirmed = lon < 0.0
    return locals()


def _beyond() -> dict[str, Any]:
    def above(limit: float, what: str, digits: int) -> list[str]:
        tables: tuple[ReferenceTable, ...] = (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
        return [
            f"{value.name} ({table.input}) {getattr(value, what):.{digits}f} %"
            for table in tables
            for value in table
            if (getattr(value, what) or 0.0) > limit
        ]

    over = above(_CR_GUIDELINE, "cr_percent", 1)
    insensitive = above(_INSENSITIVITY_GUIDELINE, "insensitivity_percent", 2)
    cr, wide, count = _CR_GUIDELINE, ", ".join(over), len(over)
    insensitivity, rest = _INSENSITIVITY_GUIDELINE, ", ".join(insensitive)
    confirmed = bool(over)
    return locals()


def _tie() -> dict[str, Any]:
    (before, after), written = _quotients("A_b", "B_a")
    tied, free = math.isclose(after, -1.0, rel_tol=1e-9), math.isclose(before, -1.0, rel_tol=0.05)
    off, confirmed = 100.0 * (1.0 + before), tied and not free
    return locals()


_RISE = {
    "where": "section 3.2, on Table 3",
    "calculation": "{changes}",
    "computed": "{falls}",
    "conclusion": "The columns of Table 3 were compared in the wrong direction.",
}
"""What two errata have in common."""

ROWS = (
    Row(
        title="A fit at the limit called very good",
        where="section 3.2, on Table 3",
        printed="the identification results fit the flight data very well",
        calculation="{cost:.2f} / {acceptable:g} = {share:.3f}",
        computed="IN2's average cost is {share:.0%} of what is acceptable; excellent is "
        "{excellent:g} or less",
        conclusion="The IN1 column is a good fit, the IN2 column just an acceptable one.",
        figures=_cost,
    ),
    Row(
        title="The rotor's time constant falls",
        where="section 3.2, on Table 3",
        printed="after the gyro tau_f is increased of {claimed:g} %",
        calculation="{after:g} / {before:g} - 1 = {change:.1f} %",
        computed="a fall of {fall:.1f} %; {before:g} / {after:g} - 1 = {inverse:.1f} %",
        conclusion="The ratio was taken upside down: IN1 is larger than IN2 by that much.",
        figures=_tau_f,
    ),
    Row(
        title="The ratio of the gyro's settings is not quite met",
        where="section 3.2",
        printed="A_lon and B_lat, IN2 over IN1, are about {claimed:g}",
        calculation="{calculation}",
        computed="{below}; the Cramér-Rao bounds of the ratios are {wide} %",
        conclusion="Nearer {mean:.2f}. The bounds allow {claimed:g}, so the match is possible, "
        "not shown; and with the gyro inside, these ratios are not stick gains (section 3.2 says "
        "so).",
        figures=_gyro_ratio,
    ),
    Row(
        title="L_b and M_a fall",
        printed="L_b and M_a are increased in a certain degree",
        figures=partial(_falls, "L_b", "M_a"),
        **_RISE,
    ),
    Row(
        title="A_lat and B_lon fall",
        printed="the increasing trend is also fitted",
        figures=partial(_falls, "A_lat", "B_lon"),
        **_RISE,
    ),
    Row(
        title="All parameters decrease",
        where="abstract and conclusion 2",
        printed="all the parameters increased a certain degree, from before gyro to after",
        calculation="count of |IN2| > |IN1| in Table 3: {larger} of {count}",
        computed="{changes}",
        conclusion="The trend is the opposite one, without exception; delays are left out.",
        figures=_all,
    ),
    Row(
        title="A gyro that changes the inertia",
        where="Table 3",
        printed="L_b and M_a of IN1 and of IN2, as flapping spring derivatives",
        calculation="L_b / M_a = I_yy / I_xx: {quotients}",
        computed="{change:.0f} % for the same airframe; the bounds of the ratios are {bounds} %",
        conclusion="One hub stiffness acts on both axes, so the ratio belongs to the airframe. "
        "IN2's numbers have no such meaning, and the bounds are wide; helisim calibrates on IN1's.",
        figures=_inertia,
    ),
    Row(
        title="A delay that leads",
        where="Table 3, [IN1 OUT]",
        printed="tau_lon = {lon:g} s",
        calculation="tau_lat - tau_lon = {lat_ms:g} - ({lon_ms:g}) ms",
        computed="{apart:.1f} ms between two inputs that share their servos",
        conclusion="No servo answers before its command: the recorder's channels are skewed. "
        "helisim models a latency of each channel.",
        figures=_lead,
    ),
    Row(
        title="Parameters kept beyond the guidelines",
        where="Table 3",
        printed="no parameter is remarked on",
        calculation="CR > {cr:g} %: {wide}",
        computed="{count} bounds too wide; insensitivity > {insensitivity:g} %: {rest}",
        conclusion="By the method's own rule they should be fixed or dropped. helisim reports each "
        "with its verdict, and judges against these bounds.",
        figures=_beyond,
    ),
    Row(
        title="A symmetry imposed on one column only",
        where="Table 3 and section 3.2",
        printed="A_b = -B_a was added for IN2",
        calculation="A_b / B_a: IN1 {written[0]}, IN2 {written[1]}",
        computed="IN1 is {off:.0f} % from the symmetry",
        conclusion="The rotor is the same in both columns: comparing A_b and B_a between them "
        "compares two structures. helisim ties them where the paper does.",
        figures=_tie,
    ),
)
