"""What is wrong in the paper, each with its calculation from the paper's own numbers.

Every figure of an `Erratum` is computed here, at run time, from the transcribed tables and, for
the tail rotor, from the force laws. The texts stand in `errata.toml`.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from helisim.base.files import read_toml
from helisim.base.units import RAD_PER_DEG, RAD_S_PER_RPM
from helisim.physics import rotor
from helisim.study.paper import ReferenceValue, overall_from_parts, published
from helisim.vehicle.folder import model_folder
from helisim.vehicle.parameters import read_parameters

_EQUATION_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 10)
_FIGURE_NUMBERS = (1, 2, 3, 3, 4, 5, 6, 7, 8)
"""As printed, in the order of the text."""
_CR_GUIDELINE, _INSENSITIVITY_GUIDELINE = 20.0, 10.0
"""Percent; Tischler and Remple, the guidelines of the CIFER method that the paper follows."""
_COST_ACCEPTABLE, _COST_EXCELLENT = 100.0, 50.0
"""Average cost J; the same guidelines."""


@dataclass(frozen=True, kw_only=True)
class Erratum:
    """One statement of the paper that its own numbers contradict.

    Attributes:
        title: of the error.
        where: in the paper.
        printed: what stands there.
        calculation: the one line that shows it, with its numbers in place.
        computed: what comes out.
        conclusion: what to make of it, and what helisim does.
        confirmed: whether the calculation does contradict the print.
    """

    title: str
    where: str
    printed: str
    calculation: str
    computed: str
    conclusion: str
    confirmed: bool


def errata() -> tuple[Erratum, ...]:
    """Return all that is known to be wrong in the paper, in the order of its sections."""
    found = []
    for texts in read_toml(Path(__file__).with_suffix(".toml"))["errata"]:
        figures = _FIGURES[texts.pop("figures")](*texts.pop("of", ()))
        said = {name: text.format(**figures) for name, text in texts.items()}
        found.append(Erratum(**said, confirmed=bool(figures["confirmed"])))
    return tuple(found)


def _of(table: str, *names: str) -> list[float]:
    """Return values of a table of the paper; all where no name is given."""
    known = published("jr700")[table]
    return [known[name].value for name in names or known.names]


def _columns(*names: str) -> list[dict[str, float]]:
    """Return parameters of Table 3 by name, from IN1 and from IN2."""
    return [dict(zip(names, _of(table, *names))) for table in ("rollpitch_in1", "rollpitch_in2")]


def _both(name: str) -> list[ReferenceValue]:
    return [published("jr700")[table][name] for table in ("rollpitch_in1", "rollpitch_in2")]


def _percent_change(after: float, before: float) -> float:
    return 100.0 * (abs(after) / abs(before) - 1.0)


def _together(one: ReferenceValue, other: ReferenceValue) -> float:
    """Return the Cramér-Rao bound of a ratio, percent."""
    return math.hypot(one.cr_percent or 0.0, other.cr_percent or 0.0)


# Each returns its locals: what stands in the places of the texts, by name, and `confirmed`.


def _tail_speed() -> dict[str, Any]:
    folder = model_folder("jr700")
    par = read_parameters(folder / "parameters.toml", folder / "calibrated.toml")
    names = ("Omega_tr_as_printed", "Omega_mr", "Omega_tr", "R_tr", "rho")
    printed, main, fast, radius, density = _of("airframe", *names)
    slow, main = printed * RAD_S_PER_RPM, main / RAD_S_PER_RPM

    def thrust(speed: float, pedal: float) -> float:
        area = math.pi * radius**2
        solidity = par["tail_rotor.blades"] * par["tail_rotor.chord"] / (math.pi * radius)
        pitch = par["tail_rotor.pitch_trim"] + pedal * par["tail_rotor.pitch_range"]
        law = (par[f"tail_rotor.{name}"] for name in ("lift_slope", "stall"))
        _, ct = rotor.inflow_and_thrust(pitch, 0.0, 0.0, solidity, *law)
        return density * area * (speed * radius) ** 2 * ct

    idle, weak, needed = thrust(slow, 0.0), thrust(slow, 0.5), thrust(fast, 0.0)
    tip, ratio, geared = slow * radius, main / printed, fast / RAD_S_PER_RPM
    confirmed = weak < needed
    return locals()


def _fuselage() -> dict[str, Any]:
    printed, length, radius = _of("airframe", "l_f_as_printed", "l_f", "R_mr")
    diameters, share = printed / (2.0 * radius), length / (2.0 * radius)
    confirmed = diameters > 10.0
    return locals()


def _units() -> dict[str, Any]:
    paper = published("jr700")
    tables = ("yaw_base", "yaw_gyro", "rollpitch_in1", "heave")
    units = [value.unit for table in tables for value in paper[table]]
    values, count, kinds = len(units), len(set(units)), ", ".join(sorted(set(units)))
    confirmed = count > 1
    return locals()


def _twice() -> dict[str, Any]:
    given = {"equation": _EQUATION_NUMBERS, "figure": _FIGURE_NUMBERS}
    counts = {f"{what} {k}": n for what in given for k, n in Counter(given[what]).items()}
    found = [name for name, count in counts.items() if count > 1]
    equations, last_equation = len(_EQUATION_NUMBERS), max(_EQUATION_NUMBERS)
    figures, last_figure = len(_FIGURE_NUMBERS), max(_FIGURE_NUMBERS)
    twice, confirmed = ", ".join(found), bool(found)
    return locals()


def _gyro_units() -> dict[str, Any]:
    table = published("jr700")["yaw_gyro"]
    k_a, k_delta = table["k_a"].unit, table["k_delta"].unit
    confirmed = k_a != k_delta
    return locals()


def _steady_states() -> dict[str, Any]:
    (n_ped, n_r), (b0, a0) = _of("yaw_base", "N_ped", "N_r"), _of("yaw_overall", "b0", "a0")
    damping, base, overall = -n_r, n_ped / -n_r, b0 / a0
    times, confirmed = base / overall, not math.isclose(base, overall, rel_tol=0.1)
    return locals()


def _margin() -> dict[str, Any]:
    n_r, n_ped, tau = _of("yaw_base", "N_r", "N_ped", "tau_r_base")
    k_p, k_i, k_a = _of("yaw_gyro", "k_p", "k_I", "k_a")

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

    point = np.log(_of("yaw_gyro", "k_p", "k_I", "k_delta", "k_a"))
    steps = 1e-6 * np.eye(len(point))
    slopes = [(products(point + step) - products(point - step)) / 2e-6 for step in steps]
    rank = int(np.linalg.matrix_rank(np.array(slopes).T, tol=1e-6))
    gains, confirmed = len(point), rank < len(point)
    return locals()


def _k_p() -> dict[str, Any]:
    table = published("jr700")["yaw_gyro"]
    k_p, k_i = table["k_p"].value, table["k_I"].value
    ratio = k_i / k_p
    confirmed = "[IN2 OUT]" in table["k_p"].source and "ground test" in table["k_I"].source
    return locals()


def _constants() -> dict[str, Any]:
    (base,), (overall,) = _of("yaw_base", "tau_r_base"), _of("yaw_overall", "tau_r_all")
    base_gain, overall_gain = math.exp(-base), math.exp(-overall)
    base_less, overall_less = 100.0 * (1.0 - base_gain), 100.0 * (1.0 - overall_gain)
    confirmed = base_less > 0.0
    return locals()


def _rounding() -> dict[str, Any]:
    tables = [published("jr700")[name] for name in ("yaw_base", "yaw_gyro", "yaw_overall")]
    base, gyro, overall = ({value.name: value.value for value in table} for table in tables)
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
    paper = published("jr700")
    before, after = paper["rollpitch_in1"].cost or 0.0, paper["rollpitch_in2"].cost or 0.0
    times, confirmed = after / before, after > before
    return locals()


def _cost() -> dict[str, Any]:
    cost = published("jr700")["rollpitch_in2"].cost or 0.0
    acceptable, excellent = _COST_ACCEPTABLE, _COST_EXCELLENT
    share, confirmed = cost / acceptable, cost > excellent
    return locals()


def _tau_f() -> dict[str, Any]:
    before, after = (value.value for value in _both("tau_f"))
    claimed = next(one.rise_percent for one in published("jr700").claims if one.rise_percent)
    change = _percent_change(after, before)
    fall, inverse, confirmed = -change, _percent_change(before, after), after < before
    return locals()


def _gyro_ratio() -> dict[str, Any]:
    claim = next(one for one in published("jr700").claims if one.ratio is not None)
    names, claimed = claim.names, claim.ratio or 0.0
    before, after = _columns(*names)
    ratios = {name: after[name] / before[name] for name in names}
    bounds = {name: _together(*_both(name)) for name in names}
    short = {name: 100.0 * (1.0 - ratio / claimed) for name, ratio in ratios.items()}
    below = " and ".join(f"{short[name]:.1f} % below" for name in names)
    wide = " and ".join(f"{bounds[name]:.1f}" for name in names)
    calculation = ", ".join(
        f"{name}: {after[name]:g} / {before[name]:g} = {ratios[name]:.3f}" for name in names
    )
    mean = np.mean(list(ratios.values()))
    confirmed = all(round(ratios[x], 2) != claimed and short[x] < bounds[x] for x in names)
    return locals()


def _falls(*names: str) -> dict[str, Any]:
    before, after = _columns(*names)
    change = {name: _percent_change(after[name], before[name]) for name in names}
    changes = ", ".join(
        f"{name}: |{after[name]:g}| / |{before[name]:g}| - 1 = {value:.1f} %"
        for name, value in change.items()
    )
    falls = ", ".join(f"{name} falls by {-value:.1f} %" for name, value in change.items())
    confirmed = max(change.values()) < 0.0
    return locals()


def _all() -> dict[str, Any]:
    table = published("jr700")["rollpitch_in1"]
    names = [name for name in table.names if not name.startswith("tau_l")]
    before, after = _columns(*names)
    change = {name: _percent_change(after[name], before[name]) for name in names}
    larger = sum(value > 0.0 for value in change.values())
    changes = ", ".join(f"{name} {value:+.0f} %" for name, value in change.items())
    count, confirmed = len(names), not larger
    return locals()


def _quotients(above: str, below: str) -> tuple[list[float], list[str]]:
    """Return the ratio of two parameters from IN1 and from IN2, and how it is written."""
    pairs = [(column[above], column[below]) for column in _columns(above, below)]
    return [a / b for a, b in pairs], [f"{a:g} / {b:g} = {a / b:.3f}" for a, b in pairs]


def _inertia() -> dict[str, Any]:
    (before, after), written = _quotients("L_b", "M_a")
    pairs = zip(_both("L_b"), _both("M_a"))
    bounds = " and ".join(f"{_together(*pair):.0f}" for pair in pairs)
    quotients, change = " and ".join(written), _percent_change(after, before)
    confirmed = not math.isclose(before, after, rel_tol=0.05)
    return locals()


def _lead() -> dict[str, Any]:
    lat, lon = _of("rollpitch_in1", "tau_lat", "tau_lon")
    lat_ms, lon_ms, apart = 1e3 * lat, 1e3 * lon, 1e3 * (lat - lon)
    confirmed = lon < 0.0
    return locals()


def _beyond() -> dict[str, Any]:
    def above(limit: float, what: str, digits: int) -> list[str]:
        return [
            f"{value.name} ({table.input}) {getattr(value, what):.{digits}f} %"
            for table in map(published("jr700").get, ("rollpitch_in1", "rollpitch_in2"))
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


_FIGURES: Mapping[str, Callable[..., dict[str, Any]]] = {
    one.__name__.removeprefix("_"): one
    for one in (
        *(_tail_speed, _fuselage, _units, _twice, _gyro_units, _steady_states, _margin, _rank),
        *(_k_p, _constants, _rounding, _costs, _cost, _tau_f, _gyro_ratio, _falls, _all),
        *(_inertia, _lead, _beyond, _tie),
    )
}
