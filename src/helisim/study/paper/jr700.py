"""The numbers of the JR700 paper.

M. Wu and M. Chen, "System identifications of three-axis gyro model and base model of a RC
helicopter without stabilizer bar", Beihang University. Radians, seconds and metres; inputs
unitised to [-0.5, 0.5]. The flapping angles of Table 3 are a (longitudinal) and b (lateral).

Its known errors stay visible in the `source` of the value concerned:

- Table 1: l_f lacks a decimal point, and Omega_tr is 1700 / gear ratio, not 1700 x gear ratio.
- Table 2 gives [IN2 OUT] as the main reference of k_p; section 3.1 gives the ground test.
- Eq. (8) of the yaw model is printed from unrounded numbers: Table 2 gives its coefficients
  only to the rounding of Table 2. Eq. (5) names the input ped where it is PED.
- Table 3, IN2: A_b is not fitted, it is tied to B_a by A_b = -B_a. tau_lon of IN1 is negative,
  so the output leads its input. CR above 20 % is kept for tau_f and the delays.
- The text on Table 3 says that tau_f rises by 37 % from IN1 to IN2; the table has it fall by
  27.5 %. It says that L_b, M_a, A_lat and B_lon rise; in the table they fall.
"""

from helisim.base.units import RAD_S_PER_RPM
from helisim.study.paper.values import Published, ReferenceTable, ReferenceValue, TrendClaim

_MAIN_ROTOR_RPM = 1700.0
_PRINTED_TAIL_RPM = 360.2
_GEAR_RATIO = _MAIN_ROTOR_RPM / _PRINTED_TAIL_RPM

AIRFRAME = ReferenceTable(
    "airframe",
    input="",
    cost=None,
    values=(
        ReferenceValue("R_mr", 0.767, "m", source="Table 1, main rotor radius"),
        ReferenceValue("R_tr", 0.137, "m", source="Table 1, tail rotor radius"),
        ReferenceValue("m", 8.01, "kg", source="Table 1, mass"),
        ReferenceValue(
            "l_f",
            1.332,
            "m",
            source="corrected from Table 1: the printed 1332m lacks its decimal point",
        ),
        ReferenceValue("l_f_as_printed", 1332.0, "m", source="Table 1, misprint, see l_f"),
        ReferenceValue("c_mr", 0.065, "m", source="Table 1, main rotor chord, printed as 65 mm"),
        ReferenceValue("g", 9.8015, "m/s^2", source="Table 1, acceleration of gravity"),
        ReferenceValue("rho", 1.225, "kg/m^3", source="Table 1, air density"),
        ReferenceValue(
            "Omega_mr",
            _MAIN_ROTOR_RPM * RAD_S_PER_RPM,
            "rad/s",
            source="Table 1, main rotor speed, printed as 1700 rpm",
        ),
        ReferenceValue(
            "Omega_tr",
            _MAIN_ROTOR_RPM * _GEAR_RATIO * RAD_S_PER_RPM,
            "rad/s",
            source="corrected from Table 1: 1700 rpm x gear_ratio; the printed 360.2 rpm is "
            "1700 / gear_ratio and would give a tip speed of 5.2 m/s",
        ),
        ReferenceValue(
            "Omega_tr_as_printed",
            _PRINTED_TAIL_RPM,
            "rpm",
            source="Table 1, misprint, see Omega_tr",
        ),
        ReferenceValue(
            "gear_ratio",
            _GEAR_RATIO,
            "1",
            source="derived from Table 1: 1700 rpm / 360.2 rpm, tail speed over main rotor speed",
        ),
    ),
)
"""Table 1, SI. Names that end in `_as_printed` keep the two misprints; use the names without."""

YAW_BASE = ReferenceTable(
    "yaw_base",
    input="IN1",
    cost=44.54,  # Figure 4
    values=(
        ReferenceValue("N_r", -0.7512, "1/s", source="Table 2, eq. (6)"),
        ReferenceValue("N_ped", 75.9459, "rad/s^2", source="Table 2, eq. (6)"),
        ReferenceValue("tau_r_base", 0.0505, "s", source="Table 2, eq. (6)"),
    ),
)
"""r/ped = N_ped exp(-tau_r_base s) / (s - N_r), eq. (1)."""

YAW_GYRO = ReferenceTable(
    "yaw_gyro",
    input="IN2",
    cost=None,
    values=(
        ReferenceValue(
            "k_p",
            0.8646,
            "1",
            source="Table 2, eq. (7); from [IN2 OUT], but section 3.1 says the ground test",
        ),
        ReferenceValue("k_I", 17.70, "1/s", source="Table 2, eq. (7); ground test"),
        ReferenceValue("k_delta", 2.68, "1", source="Table 2, eq. (7); from [IN2 IN1]"),
        ReferenceValue("k_a", 0.2941, "s", source="Table 2, eq. (7); from [IN2 OUT]"),
    ),
)
"""ped = (k_p + k_I/s) (k_delta PED - k_a r), eq. (7). The units follow from it: none is printed."""

YAW_OVERALL = ReferenceTable(
    "yaw_overall",
    input="IN2",
    cost=None,
    values=(
        ReferenceValue("b1", 175.9690, "rad/s^2", source="eq. (8), printed; Table 2: 175.976"),
        ReferenceValue("b0", 3602.6, "rad/s^3", source="eq. (8), printed; Table 2: 3602.57"),
        ReferenceValue("a1", 20.0636, "1/s", source="eq. (8), printed; Table 2: 20.0626"),
        ReferenceValue("a0", 395.3770, "1/s^2", source="eq. (8), printed; Table 2: 395.342"),
        ReferenceValue("tau_r_all", 0.072, "s", source="Table 2, eq. (8)"),
    ),
)
"""r/PED = (b1 s + b0) exp(-tau_r_all s) / (s^2 + a1 s + a0), eqs. (5) and (8) of the yaw model."""

_T1 = "Table 3, [IN1 OUT]"
_T2 = "Table 3, [IN2 OUT]"

ROLLPITCH_IN1 = ReferenceTable(
    "rollpitch_in1",
    input="IN1",
    cost=40.1776,
    values=(
        ReferenceValue("tau_f", 0.04456, "s", 23.12, 2.876, _T1),
        ReferenceValue("L_b", 539.5, "1/s^2", 13.9, 4.733, _T1),
        ReferenceValue("M_a", 315.1, "1/s^2", 7.54, 2.157, _T1),
        ReferenceValue("A_b", -0.3514, "1", 26.15, 10.00, _T1),
        ReferenceValue("B_a", 0.5340, "1", 8.659, 2.45, _T1),
        ReferenceValue("A_lat", 0.06571, "rad", 5.58, 2.757, _T1),
        ReferenceValue("A_lon", 0.3697, "rad", 3.914, 1.498, _T1),
        ReferenceValue("B_lat", 0.3778, "rad", 3.894, 1.893, _T1),
        ReferenceValue("B_lon", -0.06070, "rad", 7.005, 3.022, _T1),
        ReferenceValue("tau_lat", 0.0115, "s", 35.781, 7.954, _T1),
        ReferenceValue(
            "tau_lon", -0.0083, "s", 32.168, 8.231, f"{_T1}; negative: the output leads its input"
        ),
    ),
)
"""The coupled roll-pitch model, eqs. (8) and (9) of section 3.2, from the servo signals."""

ROLLPITCH_IN2 = ReferenceTable(
    "rollpitch_in2",
    input="IN2",
    cost=98.6534,
    values=(
        ReferenceValue("tau_f", 0.0323, "s", 18.423, 1.245, _T2),
        ReferenceValue("L_b", 439.2, "1/s^2", 12.29, 2.737, _T2),
        ReferenceValue("M_a", 310.8, "1/s^2", 13.537, 2.155, _T2),
        ReferenceValue("A_b", -0.2261, "1", None, None, f"{_T2}; tied, A_b = -B_a"),
        ReferenceValue("B_a", 0.2261, "1", 18.63, 5.608, _T2),
        ReferenceValue("A_lat", 0.00845, "rad", 7.796, 3.569, _T2),
        ReferenceValue("A_lon", 0.2109, "rad", 3.945, 1.467, _T2),
        ReferenceValue("B_lat", 0.2155, "rad", 3.960, 1.646, _T2),
        ReferenceValue("B_lon", -0.04006, "rad", 8.479, 2.868, _T2),
        ReferenceValue("tau_lat", 0.00848, "s", 40.685, 10.11, _T2),
        ReferenceValue("tau_lon", 0.00516, "s", 38.341, 2.185, _T2),
    ),
)
"""The same structure, from the sticks: the gyro is inside, and the values have no meaning alone."""

CLAIMED_TAU_F_RISE_PERCENT = 37.0
"""Section 3.2: "the rotor time constant is increased of 37%"."""

CLAIMED_GYRO_RATIO = 0.6
"""Section 3.2, of A_lon and of B_lat: "which matches with the gyro settings"."""

TREND_CLAIMS = (
    TrendClaim(
        ("tau_f",), f"the rotor time constant is increased of {CLAIMED_TAU_F_RISE_PERCENT:g} %"
    ),
    TrendClaim(
        ("A_lon", "B_lat"),
        f"A_lon and B_lat, IN2 over IN1, are about {CLAIMED_GYRO_RATIO:g}",
        CLAIMED_GYRO_RATIO,
    ),
    TrendClaim(("L_b", "M_a"), "L_b and M_a are increased in a certain degree"),
    TrendClaim(("A_lat", "B_lon"), "the increasing trend is also fitted for A_lat and B_lon"),
    TrendClaim((), "all the parameters increased a certain degree (conclusion 2)"),
)
"""Section 3.2 on Table 3, from [IN1 OUT] to [IN2 OUT]."""

HEAVE = ReferenceTable(
    "heave",
    input="IN1",
    cost=40.62,
    values=(
        ReferenceValue("Z_col", -41.8503, "m/s^2", source="Table 4, eq. (10)"),
        ReferenceValue("Z_w", -0.9403, "1/s", source="Table 4, eq. (10)"),
    ),
)
"""w/col = Z_col / (s - Z_w), eq. (10); the gyro does not act on heave."""

TABLES: dict[str, ReferenceTable] = {
    item.name: item
    for item in (
        AIRFRAME,
        YAW_BASE,
        YAW_GYRO,
        YAW_OVERALL,
        ROLLPITCH_IN1,
        ROLLPITCH_IN2,
        HEAVE,
    )
}

PUBLISHED = Published(
    TABLES, calibration=(YAW_BASE, ROLLPITCH_IN1, HEAVE), source="paper, Tables 2 to 4"
)


def table(name: str) -> ReferenceTable:
    """Return the published table of that name.

    Raises:
        UnknownNameError: no such table; the message lists those that exist.
    """
    return PUBLISHED.table(name)
