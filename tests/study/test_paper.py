"""The paper's transcription and errata, and what an experiment finds of its claims."""

import itertools
import json
import math

import numpy as np
import pytest

from helisim.base.errors import UnknownNameError
from helisim.cli import main
from helisim.study.errata import errata
from helisim.study.paper import check_overall, gyro_effect, overall_from_parts, published
from helisim.study.results import as_json

RPM = 2.0 * math.pi / 60.0
JR700 = published("jr700")
BAND = (0.6, 25.0)  # rad/s, of eq. (8)'s sweep


def values(name: str) -> dict[str, float]:
    return {item.name: item.value for item in JR700[name]}


BASE = values("yaw_base")
GYRO = {**values("yaw_gyro"), "tau_PED": 0.0215}  # s: with tau_r_base, tau_r_all of 72 ms


@pytest.mark.parametrize("name", ["b1", "b0", "a1", "a0"])
def test_the_overall_yaw_model_follows_from_table_2(name):
    """Eq. (8)'s coefficients are eq. (5) of Table 2, as closely as Table 2 is printed."""
    # half a unit in the last printed digit
    halves = {"N_r": 0.5e-4, "N_ped": 0.5e-4, "k_p": 0.5e-4, "k_I": 0.5e-2, "k_a": 0.5e-4}
    halves["k_delta"] = 0.5e-2
    corners = []
    for signs in itertools.product((-1, 1), repeat=6):
        off = {one: sign * half for (one, half), sign in zip(halves.items(), signs)}
        both = {one: value + off.get(one, 0.0) for one, value in {**BASE, **GYRO}.items()}
        corners.append(overall_from_parts(both, both)[name])
    printed = JR700["yaw_overall"][name].value
    assert min(corners) <= printed <= max(corners)
    # and the product of the printed values: 1e-4 is the largest difference, of a0
    assert printed == pytest.approx(overall_from_parts(BASE, GYRO)[name], rel=1e-4)


def test_the_tail_speed_is_the_gear_ratio_inverted():
    """1700 rpm through a ratio of 4.72 gives 8023 rpm; the print divides instead."""
    airframe = JR700["airframe"]
    # design section 8, to its printed digits
    assert airframe["gear_ratio"].value == pytest.approx(4.72, abs=0.005)
    assert airframe["Omega_tr"].value / RPM == pytest.approx(8023.0, abs=0.5)
    assert airframe["Omega_tr"].value == pytest.approx(840.2, abs=0.05)
    # as printed, the tail's tip would move at 5.2 m/s
    tip_speed = airframe["Omega_tr_as_printed"].value * RPM * airframe["R_tr"].value
    assert tip_speed == pytest.approx(5.2, abs=0.05)


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
    printed = JR700["heave"]["Z_w"].value
    # the usual slope 5.73 /rad leaves 3 %: uniform inflow and a constant slope claim no more
    assert heave_damping(5.73) == pytest.approx(printed, rel=0.03)
    # design, section 3: 6.016 /rad is solved from Z_w, and is given to four digits
    assert heave_damping(6.016) == pytest.approx(printed, rel=2e-4)


@pytest.mark.parametrize("name", ["rollpitch_in1", "rollpitch_in2"])
def test_cramer_rao_is_at_least_twice_the_insensitivity(name):
    """CR = 2 sqrt((H^-1)_ii) and I = 1/sqrt(H_ii), so CR/I >= 2 for any Hessian.

    Of the paper's own rows B_a of IN2, for one, has 3.3: a slip of the transcription shows.
    """
    for row in JR700[name]:
        if row.cr_percent is not None:
            assert row.insensitivity_percent is not None
            assert row.cr_percent >= 2.0 * row.insensitivity_percent


def test_tables_are_addressed_by_name_and_errata_printed(capsys):
    with pytest.raises(UnknownNameError, match="available: airframe, yaw_base"):
        JR700["yaw"]
    with pytest.raises(UnknownNameError, match="parameter of heave 'Z_q'; available: Z_col, Z_w"):
        JR700["heave"]["Z_q"]
    assert len({one.title for one in errata()}) == len(errata()) >= 20  # the design names eleven
    assert main(["study", "errata"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert f"{len(errata())}. " in text


def test_what_is_found_stands_beside_what_is_printed():
    """The same model shows no difference; IN2 a tenth larger, its tied A_b not identified."""
    direct = overall_from_parts(BASE, GYRO)
    check = check_overall(BASE, GYRO, direct, band_rad_s=BAND)
    assert [one.difference_percent for one in check.coefficients] == [0.0] * 5
    assert (check.gain_db, check.phase_deg) == pytest.approx((0.0, 0.0), abs=1e-9)  # rounding
    data = json.loads(json.dumps(as_json(check), allow_nan=False))
    assert [one["name"] for one in data["coefficients"]] == [
        one.name for one in JR700["yaw_overall"]
    ]
    assert data["coefficients"][0]["paper"] == 175.9690  # eq. (8)
    assert data["coefficients"][0]["difference_percent"] == 0.0
    assert data["band_rad_s"] == [0.6, 25.0]
    assert {"gain_db", "gain_at_rad_s", "phase_deg", "phase_at_rad_s"} <= data.keys()
    after = {name: 1.1 * x for name, x in values("rollpitch_in2").items() if name != "A_b"}
    found = gyro_effect(values("rollpitch_in1"), after)
    changes = {one.name: one for one in found.changes}
    # delays hold the recorder's latencies
    assert list(changes) == ["tau_f", "L_b", "M_a", "B_a", "A_lat", "A_lon", "B_lat", "B_lon"]
    for name in ("A_lon", "B_lat"):
        # 0.2109/0.3697 and 0.2155/0.3778, printed digits
        assert changes[name].paper_ratio == pytest.approx(0.5704, abs=1e-4)
        assert changes[name].ratio == pytest.approx(1.1 * changes[name].paper_ratio, rel=1e-12)
    data = json.loads(json.dumps(as_json(found), allow_nan=False))
    assert data["changes"][0]["paper_ratio"] == pytest.approx(0.0323 / 0.04456, rel=1e-12)


def computed() -> dict[tuple[str, str], str]:
    """What errata say, worked out from the tables: by title and a part of its text."""
    first, second = values("rollpitch_in1"), values("rollpitch_in2")
    yaw, overall = values("yaw_gyro"), values("yaw_overall")
    a = values("airframe")

    def change(name: str) -> float:
        return 100.0 * (abs(second[name]) / abs(first[name]) - 1.0)

    def falls(*names: str) -> str:
        return ", ".join(f"{name} falls by {-change(name):.1f} %" for name in names)

    n_r, n_ped = -BASE["N_r"], BASE["N_ped"]
    # |L| = 1 of k_a (k_p + k_I / s) N_ped / (s - N_r), squared: a quadratic of omega^2
    gain = yaw["k_a"] * n_ped
    middle = n_r**2 - (gain * yaw["k_p"]) ** 2
    squares = np.roots([1.0, middle, -((gain * yaw["k_I"]) ** 2)])
    omega = float(np.sqrt(squares.max()))
    loop = gain * (yaw["k_p"] + yaw["k_I"] / (1j * omega)) / (1j * omega + n_r)
    margin = math.pi + float(np.angle(loop))
    lag = math.degrees(margin - omega * BASE["tau_r_base"])
    lead = 1e3 * (first["tau_lat"] - first["tau_lon"])
    tables = (*JR700["rollpitch_in1"], *JR700["rollpitch_in2"])
    wide = sum((one.cr_percent or 0) > 20 for one in tables)
    times = n_ped / n_r / (overall["b0"] / overall["a0"])
    tail = "Tail rotor speed is the gear ratio upside down"
    delay = "The base model's delay can't be in the gyro's loop"
    steady = "Overall yaw model labelled with the base model's input"
    return {
        (tail, "calculation"): f"{360.2 * RPM * a['R_tr']:.1f} m/s at the tip",
        (tail, "computed"): f"{1700**2 / 360.2:.0f} rpm gives them",
        ("The rotor's time constant falls", "computed"): f"a fall of {-change('tau_f'):.1f} %",
        ("L_b and M_a fall", "computed"): falls("L_b", "M_a"),
        ("A_lat and B_lon fall", "computed"): falls("A_lat", "B_lon"),
        (delay, "calculation"): f"= {lag:.1f} degrees",
        (delay, "computed"): f"{1e3 * margin / omega:.1f} ms",
        ("A delay that leads", "computed"): f"{lead:.1f} ms",
        ("Parameters kept beyond the guidelines", "computed"): f"{wide} bounds too wide",
        (steady, "computed"): f"{times:.1f} times",
        ("Delays printed as constants", "calculation"): f"= {math.exp(-BASE['tau_r_base']):.3f}",
    }


@pytest.mark.parametrize(("place", "expected"), computed().items(), ids=str)
def test_an_erratum_says_what_the_tables_give(place, expected):
    title, part = place
    (found,) = [one for one in errata() if one.title == title]
    assert expected in getattr(found, part)
