"""Campaigns in wind and turbulence."""

import pytest

import helisim as hs
from helisim.design.exact import air_met
from helisim.study.campaign import campaign_from
from helisim.study.replicates import fly_and_identify
from helisim.study.truth import mean_derivatives

PLAN = {
    "campaign": {"models": ["heave"], "flights": 1, "seed": 2, "integrator": "Euler"},
    "set": {"sweep": {"duration": 30}},
    "vary": {"weather": {"turbulence": [0, 6], "wind": [0, 6]}},
}


@pytest.fixture(scope="module")
def by_weather():
    campaign = campaign_from(PLAN)
    return {
        (one.values["weather.turbulence"], one.values["weather.wind"]): {
            row["parameter"]: row for row in fly_and_identify(campaign, one)
        }
        for one in campaign
        if one.values["weather.wind"] or not one.values["weather.turbulence"]
    }


@pytest.mark.slow
def test_truth_is_of_the_hover_in_the_wind(by_weather):
    calm, windy = by_weather[0, 0], by_weather[0, 6]
    vehicle = hs.Weather(wind=6.0).trimmed(hs.load("jr700"))
    assert windy["Z_w"]["truth"] == pytest.approx(vehicle.derivatives["Z_w"], rel=1e-9)
    # the trimmed rotor meets 6 m/s besides the 4.2 m/s that it induces: more damping
    assert windy["Z_w"]["truth"] < 1.1 * calm["Z_w"]["truth"] < 0.0


@pytest.mark.slow
def test_truth_in_turbulence_is_the_mean_over_the_air(by_weather):
    vehicle = hs.load("jr700", integrator="Euler")
    rough, calm = (by_weather[one, 6]["Z_w"]["truth"] for one in (6, 0))
    air = air_met(vehicle, hs.Weather(turbulence=6.0, wind=6.0))
    assert rough == pytest.approx(mean_derivatives(air)["Z_w"], rel=1e-12)
    assert rough < calm < 0.0


def test_wind_that_it_cannot_hover_in_fails_with_the_reason():
    campaign = campaign_from({**PLAN, "vary": {}, "set": {"weather": {"wind": 80}}})
    rows = fly_and_identify(campaign, campaign.replicate(0))
    assert {row["parameter"] for row in rows} == {"Z_w", "Z_col", "tau_col"}
    for row in rows:
        assert row["estimate"] is None
        assert "hover" in row["failure"]


"""The base helicopter's main parameters."""
