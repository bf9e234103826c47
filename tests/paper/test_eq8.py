"""Eq. (8) by eq. (5) from the parts, beside a model identified directly."""

import json

import numpy as np
import pytest

from helisim.study.paper import check_overall, overall_from_parts, published
from helisim.study.results import as_json

TAU_PED = 0.0215  # s: with tau_r_base of 50.5 ms, tau_r_all of 72 ms


BAND = (0.6, 25.0)  # rad/s, of eq. (8)'s sweep


def printed(table):
    return {one.name: one.value for one in table}


BASE = printed(published("jr700")["yaw_base"])
GYRO = {**printed(published("jr700")["yaw_gyro"]), "tau_PED": TAU_PED}


def test_table_2_gives_eq_8():
    """Wu and Chen, eq. (5) with Table 2 is eq. (8) as printed, to Table 2's rounding."""
    found = overall_from_parts(BASE, GYRO)
    for name, value in printed(published("jr700")["yaw_overall"]).items():
        assert found[name] == pytest.approx(value, rel=1e-4), name  # errata: 89 millionths


def test_the_same_model_shows_no_difference():
    """Identified as the parts say: no coefficient and no response differs."""
    direct = overall_from_parts(BASE, GYRO)
    check = check_overall(BASE, GYRO, direct, band_rad_s=BAND)
    assert [one.difference_percent for one in check.coefficients] == [0.0] * 5
    assert check.gain_db == pytest.approx(0.0, abs=1e-9)  # rounding
    assert check.phase_deg == pytest.approx(0.0, abs=1e-9)


def test_a_gain_and_a_delay_show_where_they_are_largest():
    """A tenth more gain is 0.83 dB everywhere; a millisecond is 1.43 degrees at 25 rad/s."""
    values = overall_from_parts(BASE, GYRO)
    louder = {**values, "b1": 1.1 * values["b1"], "b0": 1.1 * values["b0"]}
    check = check_overall(BASE, GYRO, louder, band_rad_s=BAND)
    assert check.gain_db == pytest.approx(-20.0 * np.log10(1.1), rel=1e-9)
    assert {one.name: one.difference_percent for one in check.coefficients} == pytest.approx(
        {"b1": -100 / 11, "b0": -100 / 11, "a1": 0.0, "a0": 0.0, "tau_r_all": 0.0}, abs=1e-9
    )
    later = {**values, "tau_r_all": values["tau_r_all"] + 1e-3}
    check = check_overall(BASE, GYRO, later, band_rad_s=BAND)
    assert check.phase_deg == pytest.approx(np.degrees(25.0 * 1e-3), rel=1e-9)
    assert check.phase_at_rad_s == pytest.approx(25.0)
    assert check.gain_db == pytest.approx(0.0, abs=1e-9)


def test_it_is_plain_data():
    """Coefficients with their differences, band, and the two largest gaps with their places."""
    direct = printed(published("jr700")["yaw_overall"])
    data = json.loads(
        json.dumps(as_json(check_overall(BASE, GYRO, direct, band_rad_s=BAND)), allow_nan=False)
    )
    assert [one["name"] for one in data["coefficients"]] == list(
        published("jr700")["yaw_overall"].names
    )
    assert data["coefficients"][0]["paper"] == 175.9690  # eq. (8)
    assert data["band_rad_s"] == [0.6, 25.0]
    assert {"gain_db", "gain_at_rad_s", "phase_deg", "phase_at_rad_s"} <= data.keys()
