"""The transcription of the paper, checked against relations that the paper itself contains."""

import itertools
import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from helisim.base.errors import UnknownNameError
from helisim.study.paper import published

RPM = 2.0 * math.pi / 60.0


def values(name: str) -> dict[str, float]:
    return {item.name: item.value for item in published("jr700")[name]}


def rollpitch_matrices(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Section 3.2, eq. (8): states p q a b, inputs lat lon, with M inverted by hand."""
    t = values(name)
    f = [
        [0, 0, 0, t["L_b"]],
        [0, 0, t["M_a"], 0],
        [0, -1, -1 / t["tau_f"], t["A_b"] / t["tau_f"]],
        [-1, 0, t["B_a"] / t["tau_f"], -1 / t["tau_f"]],
    ]
    g = [[0, 0], [0, 0], [t["A_lat"], t["A_lon"]], [t["B_lat"], t["B_lon"]]]
    return np.array(f), np.array(g) / t["tau_f"]


def overall_coefficients(n_r, n_ped, k_p, k_i, k_delta, k_a) -> dict[str, float]:
    """Eq. (5)."""
    return {
        "b1": k_p * n_ped * k_delta,
        "b0": k_i * n_ped * k_delta,
        "a1": k_p * k_a * n_ped - n_r,
        "a0": k_i * k_a * n_ped,
    }


@pytest.mark.parametrize("name", ["b1", "b0", "a1", "a0"])
def test_the_overall_yaw_model_follows_from_table_2(name):
    """Eq. (8)'s coefficients are eq. (5) of Table 2, as closely as Table 2 is printed."""
    base, gyro = published("jr700")["yaw_base"], published("jr700")["yaw_gyro"]
    # half a unit in the last printed digit of N_r, N_ped, k_p, k_I, k_delta, k_a
    printed = [
        (base["N_r"].value, 0.5e-4),
        (base["N_ped"].value, 0.5e-4),
        (gyro["k_p"].value, 0.5e-4),
        (gyro["k_I"].value, 0.5e-2),
        (gyro["k_delta"].value, 0.5e-2),
        (gyro["k_a"].value, 0.5e-4),
    ]
    corners = [
        overall_coefficients(*(value + sign * half for (value, half), sign in zip(printed, signs)))
        for signs in itertools.product((-1, 1), repeat=6)
    ]
    low, high = min(c[name] for c in corners), max(c[name] for c in corners)
    assert low <= published("jr700")["yaw_overall"][name].value <= high
    # and the product of the printed values: 1e-4 is the largest difference, of a0
    nominal = overall_coefficients(*(value for value, _ in printed))[name]
    assert published("jr700")["yaw_overall"][name].value == pytest.approx(nominal, rel=1e-4)


def test_the_tail_speed_is_the_gear_ratio_inverted():
    """1700 rpm through a ratio of 4.72 gives 8023 rpm; the print divides instead."""
    airframe = published("jr700")["airframe"]
    # design section 8, to its printed digits
    assert airframe["gear_ratio"].value == pytest.approx(4.72, abs=0.005)
    assert airframe["Omega_tr"].value / RPM == pytest.approx(8023.0, abs=0.5)
    assert airframe["Omega_tr"].value == pytest.approx(840.2, abs=0.05)
    # as printed, the tail's tip would move at 5.2 m/s
    tip_speed = airframe["Omega_tr_as_printed"].value * RPM * airframe["R_tr"].value
    assert tip_speed == pytest.approx(5.2, abs=0.05)


def test_the_misprints_of_table_1_stay_visible():
    """Both misprints are kept, are marked, and are never the value of the plain name."""
    airframe = published("jr700")["airframe"]
    assert (airframe["l_f"].value, airframe["l_f_as_printed"].value) == (1.332, 1332.0)
    assert airframe["Omega_tr_as_printed"].value == 360.2
    for name in ("l_f", "Omega_tr"):
        assert airframe[name].source.startswith("corrected from Table 1")
        assert "misprint" in airframe[f"{name}_as_printed"].source


def heave_damping(lift_slope: float) -> float:
    """Z_w in hover by blade element and momentum theory.

    Padfield, Helicopter Flight Dynamics (the paper's reference 12), chapter 4:
    Z_w = -2 a A_b rho (Omega R) lambda_0 / ((16 lambda_0 + a sigma) m).
    """
    a = values("airframe")
    tip_speed = a["Omega_mr"] * a["R_mr"]
    disc = math.pi * a["R_mr"] ** 2
    blades = 2 * a["c_mr"] * a["R_mr"]
    solidity = blades / disc
    thrust_coefficient = a["m"] * a["g"] / (a["rho"] * disc * tip_speed**2)
    inflow = math.sqrt(thrust_coefficient / 2)
    force = 2 * lift_slope * blades * a["rho"] * tip_speed * inflow
    return -force / ((16 * inflow + lift_slope * solidity) * a["m"])


def test_table_1_and_table_4_agree():
    """The heave damping of Table 4 is the one of Table 1's rotor, with an ordinary lift slope."""
    printed = published("jr700")["heave"]["Z_w"].value
    # the usual slope 5.73 /rad leaves 3 %: uniform inflow and a constant slope claim no more
    assert heave_damping(5.73) == pytest.approx(printed, rel=0.03)
    # design, section 3: 6.016 /rad is solved from Z_w, and is given to four digits
    assert heave_damping(6.016) == pytest.approx(printed, rel=2e-4)


def test_table_1_can_hover():
    """The blades are far from stall at the weight of Table 1."""
    a = values("airframe")
    tip_speed = a["Omega_mr"] * a["R_mr"]
    pressure = 0.5 * a["rho"] * tip_speed**2
    # mean lift coefficient: the blade's speed grows linearly, so lift is a third of full
    mean_lift = 3 * a["m"] * a["g"] / (pressure * 2 * a["c_mr"] * a["R_mr"])
    assert 0.1 < mean_lift < 0.7  # blades are designed for about 0.5, stall is above 1


def test_the_modes_of_table_3_lie_where_the_sweeps_look():
    """IN1's model has two stable oscillations, near 15 and 27 rad/s (design, section 3)."""
    poles = np.linalg.eigvals(rollpitch_matrices("rollpitch_in1")[0])
    assert np.all(poles.real < 0.0)
    frequencies = sorted(np.abs(poles[poles.imag > 0.0]))
    np.testing.assert_allclose(frequencies, [15.0, 27.0], atol=0.5)  # two digits are given


def test_table_3_gives_the_steady_rates_of_the_design():
    """IN2's steady rates are the matrix R that the cyclic gyro is built on (design, section 5)."""
    f, g = rollpitch_matrices("rollpitch_in2")
    steady = np.linalg.solve(-f, g)[:2]
    np.testing.assert_allclose(steady, [[6.672, -1.240], [0.262, 6.529]], atol=0.5e-3)


def test_the_text_contradicts_table_3():
    """What the paper's text says of the trends is not what its table holds: keep the table."""
    before, after = values("rollpitch_in1"), values("rollpitch_in2")
    change = after["tau_f"] / before["tau_f"] - 1.0
    assert change == pytest.approx(-0.275, abs=0.0005)  # the text: an increase of 37 %
    for name in ("L_b", "M_a", "A_lat", "B_lon"):
        assert abs(after[name]) < abs(before[name])  # the text: increased
    for name in ("A_lon", "B_lat"):
        assert after[name] / before[name] == pytest.approx(0.57, abs=0.005)  # the text: 0.6
    assert before["tau_lon"] < 0.0 < after["tau_lon"]
    assert after["A_b"] == -after["B_a"]
    assert before["A_b"] != -before["B_a"]


@pytest.mark.parametrize("name", ["rollpitch_in1", "rollpitch_in2"])
def test_cramer_rao_is_at_least_twice_the_insensitivity(name):
    """CR = 2 sqrt((H^-1)_ii) and I = 1/sqrt(H_ii), so CR/I >= 2 for any Hessian.

    Of the paper's own rows B_a of IN2, for one, has 3.3: a slip of the transcription shows.
    """
    for row in published("jr700")[name]:
        if row.cr_percent is not None:
            assert row.insensitivity_percent is not None
            assert row.cr_percent >= 2.0 * row.insensitivity_percent


def test_only_the_tied_derivative_lacks_its_bounds():
    """Where the paper prints "-" there is None, and nowhere else in Table 3."""
    missing = [
        (table.name, row.name)
        for table in (published("jr700")["rollpitch_in1"], published("jr700")["rollpitch_in2"])
        for row in table
        if row.cr_percent is None or row.insensitivity_percent is None
    ]
    assert missing == [("rollpitch_in2", "A_b")]


def test_tables_are_addressed_by_name():
    """Every table has the name that the results use; unknown names list those that exist."""
    assert [table.name for table in published("jr700").tables] == [
        "airframe",
        "yaw_base",
        "yaw_gyro",
        "yaw_overall",
        "rollpitch_in1",
        "rollpitch_in2",
        "heave",
    ]
    assert "L_b" in published("jr700")["rollpitch_in1"]
    with pytest.raises(UnknownNameError, match="available: airframe, yaw_base"):
        published("jr700")["yaw"]
    with pytest.raises(UnknownNameError, match="parameter of heave 'Z_q'; available: Z_col, Z_w"):
        published("jr700")["heave"]["Z_q"]


def test_every_value_has_a_unit_and_a_source_and_can_not_change():
    """A number without its place in the paper is not in the tables."""
    for table in published("jr700").tables:
        assert len(set(table.names)) == len(table.values)
        for item in table:
            assert item.unit
            assert "Table" in item.source or "eq." in item.source
    with pytest.raises(FrozenInstanceError):
        published("jr700")["heave"]["Z_w"].value = 0.0  # type: ignore[misc]
