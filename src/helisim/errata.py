"""What is wrong in the paper, each with its calculation from the paper's own numbers.

Every figure of an `Erratum` is computed here, at run time, from the transcribed tables and,
for the tail rotor, from the force laws. Only what the paper says in words is quoted.
"""

import math
from collections import Counter
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root_scalar

from helisim.physics import rotor
from helisim.reference import ReferenceTable, jr700
from helisim.units import RAD_PER_DEG, RAD_S_PER_RPM
from helisim.vehicle.assembly import model_folder
from helisim.vehicle.parameters import read_parameters

_CR_GUIDELINE = 20.0
_INSENSITIVITY_GUIDELINE = 10.0
"""Percent; Tischler and Remple, the guidelines of the CIFER method that the paper follows."""
_COST_ACCEPTABLE = 100.0
_COST_EXCELLENT = 50.0
"""Average cost J; the same guidelines."""
_EQUATION_NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 8, 9, 10)
_FIGURE_NUMBERS = (1, 2, 3, 3, 4, 5, 6, 7, 8)
"""As printed, in the order of the text."""


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

    def to_dict(self) -> dict[str, object]:
        """Return plain JSON data."""
        return asdict(self)


def errata() -> tuple[Erratum, ...]:
    """Return all that is known to be wrong in the paper, in the order of its sections."""
    return (
        _tail_speed(),
        _fuselage_length(),
        _no_units(),
        _numbered_twice(),
        _eq_4(),
        _eq_5_input(),
        _delay_in_the_loop(),
        _too_many_gains(),
        _k_p_source(),
        _exponents(),
        _eq_8_rounding(),
        _yaw_costs(),
        _cost_very_well(),
        _tau_f_rise(),
        _gyro_ratio(),
        _rise("L_b and M_a", ("L_b", "M_a"), "L_b and M_a are increased in a certain degree"),
        _rise("A_lat and B_lon", ("A_lat", "B_lon"), "the increasing trend is also fitted"),
        _all_rise(),
        _inertia_ratio(),
        _leading_delay(),
        _bounds_kept(),
        _tie(),
    )


def _of(table: ReferenceTable, name: str) -> float:
    return table[name].value


def _percent(after: float, before: float) -> float:
    return 100.0 * (abs(after) / abs(before) - 1.0)


# Table 1


def _tail_speed() -> Erratum:
    air = jr700.AIRFRAME
    folder = model_folder("jr700")
    par = read_parameters(folder / "parameters.toml", folder / "calibrated.toml")
    printed, main = _of(air, "Omega_tr_as_printed"), _of(air, "Omega_mr") / RAD_S_PER_RPM
    slow, fast = printed * RAD_S_PER_RPM, _of(air, "Omega_tr")
    radius = _of(air, "R_tr")

    def thrust(speed: float, pedal: float) -> float:
        area = math.pi * radius**2
        solidity = par["tail_rotor.blades"] * par["tail_rotor.chord"] / (math.pi * radius)
        _, ct = rotor.inflow_and_thrust.py_func(
            par["tail_rotor.pitch_trim"] + pedal * par["tail_rotor.pitch_range"],
            0.0,
            0.0,
            solidity,
            par["tail_rotor.lift_slope"],
            par["tail_rotor.stall"],
            par["tail_rotor.inflow_floor"],
        )
        return _of(air, "rho") * area * (speed * radius) ** 2 * ct

    idle, weak, needed = thrust(slow, 0.0), thrust(slow, 0.5), thrust(fast, 0.0)
    return Erratum(
        title="Tail rotor speed is the gear ratio upside down",
        where="Table 1",
        printed=f"tail rotor rotation speed {printed:g} rpm",
        calculation=(
            f"{printed:g} rpm x {radius:g} m = {slow * radius:.1f} m/s at the tip; "
            f"{main:g} rpm / {printed:g} rpm = {main / printed:.3f}"
        ),
        computed=(
            f"{idle:.2f} N with the pedals centred and {weak:.2f} N at full pedal, where the "
            f"hover needs {needed:.2f} N; {main:g} rpm x {main / printed:.3f} = "
            f"{fast / RAD_S_PER_RPM:.0f} rpm gives them"
        ),
        conclusion=(
            "A tail rotor turns faster than the main rotor: the speed was divided by the gear "
            "ratio instead of multiplied. helisim uses the product."
        ),
        confirmed=weak < needed,
    )


def _fuselage_length() -> Erratum:
    printed, length = _of(jr700.AIRFRAME, "l_f_as_printed"), _of(jr700.AIRFRAME, "l_f")
    diameter = 2.0 * _of(jr700.AIRFRAME, "R_mr")
    return Erratum(
        title="Fuselage longer than a kilometre",
        where="Table 1",
        printed=f"l_f = {printed:g}m",
        calculation=f"{printed:g} m / (2 x {0.5 * diameter:g} m) = {printed / diameter:.0f}",
        computed=(
            f"{printed / diameter:.0f} rotor diameters; {length:g} m is {length / diameter:.2f}"
        ),
        conclusion="The unit is mm, or the decimal point is missing.",
        confirmed=printed > 10.0 * diameter,
    )


def _no_units() -> Erratum:
    tables = (jr700.YAW_BASE, jr700.YAW_GYRO, jr700.ROLLPITCH_IN1, jr700.HEAVE)
    values = [value for table in tables for value in table]
    kinds = sorted({value.unit for value in values})
    return Erratum(
        title="No parameter has a unit",
        where="Tables 2 to 4",
        printed="values alone",
        calculation=(
            f"{len(values)} parameters of N_r to Z_w have, by eqs. (1) to (10), "
            f"{len(kinds)} different units"
        ),
        computed=", ".join(kinds),
        conclusion=(
            "They follow from the equations if angles are in radians and inputs unitised, and "
            "helisim's force laws then meet all of them."
        ),
        confirmed=len(kinds) > 1,
    )


# Section 3.1


def _numbered_twice() -> Erratum:
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


def _eq_4() -> Erratum:
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


def _eq_5_input() -> Erratum:
    base, overall = jr700.YAW_BASE, jr700.YAW_OVERALL
    n_ped, n_r = _of(base, "N_ped"), _of(base, "N_r")
    b0, a0 = _of(overall, "b0"), _of(overall, "a0")
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


def _delay_in_the_loop() -> Erratum:
    base, gyro = jr700.YAW_BASE, jr700.YAW_GYRO
    n_r, n_ped, tau = (_of(base, name) for name in ("N_r", "N_ped", "tau_r_base"))
    k_p, k_i, k_a = (_of(gyro, name) for name in ("k_p", "k_I", "k_a"))

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
    return np.array([_of(gyro, name) for name in ("k_p", "k_I", "k_delta", "k_a")])


def _too_many_gains() -> Erratum:
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


def _k_p_source() -> Erratum:
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


def _exponents() -> Erratum:
    base, overall = _of(jr700.YAW_BASE, "tau_r_base"), _of(jr700.YAW_OVERALL, "tau_r_all")
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


def _eq_8_rounding() -> Erratum:
    base, overall = jr700.YAW_BASE, jr700.YAW_OVERALL
    k_p, k_i, k_delta, k_a = _gains()
    n_r, n_ped = _of(base, "N_r"), _of(base, "N_ped")
    products = {
        "b1": k_p * n_ped * k_delta,
        "b0": k_i * n_ped * k_delta,
        "a1": k_p * k_a * n_ped - n_r,
        "a0": k_i * k_a * n_ped,
    }
    off = {name: _of(overall, name) / value - 1.0 for name, value in products.items()}
    worst = max(off, key=lambda name: abs(off[name]))
    return Erratum(
        title="Coefficients that Table 2 does not quite give",
        where="eq. (8) of section 3.1",
        printed=", ".join(f"{name} = {_of(overall, name):.7g}" for name in products),
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


def _yaw_costs() -> Erratum:
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


# Section 3.2


def _cost_very_well() -> Erratum:
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


def _tau_f_rise() -> Erratum:
    before, after = _of(jr700.ROLLPITCH_IN1, "tau_f"), _of(jr700.ROLLPITCH_IN2, "tau_f")
    return Erratum(
        title="The rotor's time constant falls",
        where="section 3.2, on Table 3",
        printed=f"after the gyro tau_f is increased of {jr700.CLAIMED_TAU_F_RISE_PERCENT:g} %",
        calculation=f"{after:g} / {before:g} - 1 = {_percent(after, before):.1f} %",
        computed=(
            f"a fall of {-_percent(after, before):.1f} %; "
            f"{before:g} / {after:g} - 1 = {_percent(before, after):.1f} %"
        ),
        conclusion="The ratio was taken upside down: IN1 is larger than IN2 by that much.",
        confirmed=after < before,
    )


def _gyro_ratio() -> Erratum:
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    names = ("A_lon", "B_lat")
    ratios = {name: _of(after, name) / _of(before, name) for name in names}
    bounds = {
        name: math.hypot(before[name].cr_percent or 0.0, after[name].cr_percent or 0.0)
        for name in names
    }
    short = {
        name: 100.0 * (1.0 - ratio / jr700.CLAIMED_GYRO_RATIO) for name, ratio in ratios.items()
    }
    return Erratum(
        title="The ratio of the gyro's settings is not quite met",
        where="section 3.2",
        printed=f"A_lon and B_lat, IN2 over IN1, are about {jr700.CLAIMED_GYRO_RATIO:g}",
        calculation=", ".join(
            f"{name}: {_of(after, name):g} / {_of(before, name):g} = {ratio:.3f}"
            for name, ratio in ratios.items()
        ),
        computed=" and ".join(f"{short[name]:.1f} % below" for name in names)
        + f"; the Cramér-Rao bounds of the ratios are {bounds['A_lon']:.1f} and "
        f"{bounds['B_lat']:.1f} %",
        conclusion=(
            f"Nearer {np.mean(list(ratios.values())):.2f}. The bounds allow "
            f"{jr700.CLAIMED_GYRO_RATIO:g}, so the match is possible, not shown; and with the gyro "
            "inside, these ratios are not stick gains (section 3.2 says so)."
        ),
        confirmed=all(
            round(ratio, 2) != jr700.CLAIMED_GYRO_RATIO and short[name] < bounds[name]
            for name, ratio in ratios.items()
        ),
    )


def _rise(what: str, names: tuple[str, ...], printed: str) -> Erratum:
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    change = {name: _percent(_of(after, name), _of(before, name)) for name in names}
    return Erratum(
        title=f"{what} fall",
        where="section 3.2, on Table 3",
        printed=printed,
        calculation=", ".join(
            f"{name}: |{_of(after, name):g}| / |{_of(before, name):g}| - 1 = {value:.1f} %"
            for name, value in change.items()
        ),
        computed=", ".join(f"{name} falls by {-value:.1f} %" for name, value in change.items()),
        conclusion="The columns of Table 3 were compared in the wrong direction.",
        confirmed=all(value < 0.0 for value in change.values()),
    )


def _all_rise() -> Erratum:
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    names = [name for name in before.names if not name.startswith("tau_l")]
    larger = [name for name in names if abs(_of(after, name)) > abs(_of(before, name))]
    return Erratum(
        title="All parameters decrease",
        where="abstract and conclusion 2",
        printed="all the parameters increased a certain degree, from before gyro to after",
        calculation=f"count of |IN2| > |IN1| in Table 3: {len(larger)} of {len(names)}",
        computed=", ".join(
            f"{name} {_percent(_of(after, name), _of(before, name)):+.0f} %" for name in names
        ),
        conclusion="The trend is the opposite one, without exception; delays are left out.",
        confirmed=not larger,
    )


def _inertia_ratio() -> Erratum:
    tables = (jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2)
    ratios = [_of(table, "L_b") / _of(table, "M_a") for table in tables]
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
                f"{_of(table, 'L_b'):g} / {_of(table, 'M_a'):g} = {ratio:.3f}"
                for table, ratio in zip(tables, ratios)
            )
        ),
        computed=(
            f"{_percent(ratios[1], ratios[0]):.0f} % for the same airframe; the bounds of the "
            f"ratios are {bounds[0]:.0f} and {bounds[1]:.0f} %"
        ),
        conclusion=(
            "One hub stiffness acts on both axes, so the ratio belongs to the airframe. IN2's "
            "numbers have no such meaning, and the bounds are wide; helisim calibrates on IN1's."
        ),
        confirmed=not math.isclose(ratios[0], ratios[1], rel_tol=0.05),
    )


def _leading_delay() -> Erratum:
    lat, lon = (_of(jr700.ROLLPITCH_IN1, name) for name in ("tau_lat", "tau_lon"))
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


def _bounds_kept() -> Erratum:
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


def _tie() -> Erratum:
    before, after = jr700.ROLLPITCH_IN1, jr700.ROLLPITCH_IN2
    ratios = [_of(table, "A_b") / _of(table, "B_a") for table in (before, after)]
    return Erratum(
        title="A symmetry imposed on one column only",
        where="Table 3 and section 3.2",
        printed="A_b = -B_a was added for IN2",
        calculation=(
            f"A_b / B_a: IN1 {_of(before, 'A_b'):g} / {_of(before, 'B_a'):g} = {ratios[0]:.3f}, "
            f"IN2 {_of(after, 'A_b'):g} / {_of(after, 'B_a'):g} = {ratios[1]:.3f}"
        ),
        computed=f"IN1 is {100.0 * (1.0 + ratios[0]):.0f} % from the symmetry",
        conclusion=(
            "The rotor is the same in both columns: comparing A_b and B_a between them compares "
            "two structures. helisim ties them where the paper does."
        ),
        confirmed=not math.isclose(ratios[0], -1.0, rel_tol=0.05)
        and math.isclose(ratios[1], -1.0, rel_tol=1e-9),
    )
