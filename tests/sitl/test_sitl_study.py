"""The study of logs that ArduPilot wrote: its truths, and that it judges by them."""

import pytest

from script import loaded
from sid_logs import TRUTH, four_axes


@pytest.fixture
def study():
    return loaded("sitl_study")


def test_its_own_helicopter_in_ardupilots_units(study):
    """By hand: swashplate 120 degrees, 280 us of collective, the tail 400 us to each side.

    Full roll puts the two front servos 0.45 x 2 cos 30 degrees of 1000 us apart, full pitch the
    front ones 0.45 x 1.5 above the rear one.
    """
    parameters = {"H_COL_MIN": 1460.0, "H_COL_MAX": 1740.0}
    true = study.stated(study.SOURCES["heli"], parameters, 0.5)
    roll, pitch = 1.283 * 0.9 * 3**0.5 / 2.0 / 7.2, 1.48 * 0.675 / 7.2
    assert true["B_lat"] == pytest.approx(1.7635 * roll)
    assert true["B_lon"] == pytest.approx(-0.61171 * pitch)
    assert true["A_lat"] == pytest.approx(0.52454 * roll)
    assert true["A_lon"] == pytest.approx(1.9432 * pitch)
    assert true["N_ped"] == pytest.approx(21.6 * 2.96 * 0.8)
    # 14 degrees of collective, of which 5 carry the weight; 0.2 %: it rounds a turn's rad/s
    assert true["Z_col"] == pytest.approx(-9.80665 * 14.0 / 5.0, rel=2.1e-3)


def test_the_jr700_in_ardupilots_units(study, jr700):
    """By hand: 900 us of full cyclic on servos that 500 us move by their whole travel, 0.75."""
    parameters = {
        "H_SW_TYPE": 0.0,
        "H_SW_H3_SV1_POS": 0.0,
        "H_SW_H3_SV2_POS": -120.0,
        "H_SW_H3_SV3_POS": 120.0,
        "SERVO4_MIN": 1000.0,
        "SERVO4_MAX": 2000.0,
    }
    true, own = study.exact_jr700(parameters, 0.5), jr700.derivatives
    for name, scale in {"B_lat": 0.675, "A_lon": 0.675, "N_ped": 0.75, "Z_col": 0.75}.items():
        # it flies with its motor, whose trim is another by 1e-5
        assert true[name] == pytest.approx(scale * own[name], rel=1e-4)
    assert true["L_b"] == pytest.approx(own["L_b"], rel=1e-4)


@pytest.mark.slow
def test_a_log_of_known_derivatives_meets_the_bars_and_of_others_misses_them(
    study, tmp_path, capsys
):
    """A helicopter of our own in place of ArduPilot's, whose commands move it all the same."""
    known = {name: value for one in TRUTH.values() for name, value in one.items()}
    log = four_axes(tmp_path / "flight.bin")
    unit = study.stated(study.SOURCES["heli"]._replace(Nped=1.0, Zcol=1.0), {}, 0.5)
    cyclic = unit["B_lat"] / 1.7635, unit["A_lon"] / 1.9432
    mine = study.Source(
        *(known[name] for name in ("tau_f", "L_b", "M_a", "B_a", "A_b")),
        *(known["B_lat"] / cyclic[0], known["B_lon"] / cyclic[1]),
        *(known["A_lat"] / cyclic[0], known["A_lon"] / cyclic[1], 7.2),
        *(known["N_r"], known["N_ped"] / unit["N_ped"], 1.0),
        *(known["Z_w"], known["Z_col"] / unit["Z_col"]),
    )
    study.SOURCES["heli"] = mine
    assert study.main(["--heli", str(log)]) == 0
    assert "inside their bounds 100 %" in capsys.readouterr().out
    study.SOURCES["heli"] = mine._replace(Lb=1.2 * mine.Lb)
    assert study.main(["--heli", str(log)]) == 1
    assert "missed: heli: 92 % inside their bounds, bar 95 %" in capsys.readouterr().out


@pytest.mark.study
def test_logs_that_it_wrote_meet_the_bars(study, ardupilot, monkeypatch, tmp_path):
    """The JR700 and ArduPilot's own helicopter, flown by the program itself."""
    monkeypatch.setenv("HELISIM_ARDUPILOT", str(ardupilot))
    assert study.main(["--fly", str(tmp_path)]) == 0
