"""Campaigns in wind and turbulence: what is flown, and what counts as the truth there."""

from pathlib import Path

import pytest

import helisim as hs
from helisim.design.exact import air_met
from helisim.study.campaign import campaign_from
from helisim.study.comparison import identify_model
from helisim.study.models import HEAVE
from helisim.study.replicates import Dataset, fly_and_identify
from helisim.study.truth import mean_derivatives

PLAN = {
    "campaign": {"models": ["heave"], "flights": 1, "seed": 2, "integrator": "Euler"},
    "set": {"sweep": {"duration": 30}},
    "vary": {"weather": {"turbulence": [0, 6], "wind": [0, 6]}},
}


@pytest.fixture(scope="module")
def by_weather():
    """Rows of each replicate by turbulence and wind."""
    campaign = campaign_from(PLAN)
    return {
        (one.values["weather.turbulence"], one.values["weather.wind"]): {
            row.parameter: row for row in fly_and_identify(campaign, one)
        }
        for one in campaign
    }


def test_flights_are_in_the_weather(by_weather):
    """The same sweep flown in that weather, and identified alone, gives the replicate's numbers."""
    weather = hs.Weather(turbulence=6.0, wind=6.0)
    vehicle = hs.load("jr700", integrator="Euler")
    sweep = hs.Sweep(axis="col", duration=30.0)
    # the last of four replicates has seed 2 + 3, col is axis 0 of 4
    flights = {
        "col": hs.fly(vehicle, hs.FlightPlan(excitation=sweep, weather=weather), seed=4 * 5, jobs=1)
    }
    fit = identify_model(HEAVE, flights)
    for name, row in by_weather[6, 6].items():
        # 1e-6: this process may use more threads in BLAS, which changes the last bits
        assert row.estimate == pytest.approx(fit[name].value, rel=1e-6)


def test_truth_is_of_the_hover_in_the_wind(by_weather):
    calm, windy = by_weather[0, 0], by_weather[0, 6]
    vehicle = hs.Weather(wind=6.0).trimmed(hs.load("jr700"))
    assert windy["Z_w"].truth == pytest.approx(vehicle.derivatives["Z_w"], rel=1e-9)
    # the trimmed rotor meets 6 m/s besides the 4.2 m/s that it induces: more damping
    assert windy["Z_w"].truth < 1.1 * calm["Z_w"].truth < 0.0


@pytest.mark.slow
def test_truth_in_turbulence_is_the_mean_over_the_air(by_weather):
    vehicle = hs.load("jr700", integrator="Euler")
    for wind in (0, 6):
        rough, calm = by_weather[6, wind]["Z_w"].truth, by_weather[0, wind]["Z_w"].truth
        air = air_met(vehicle, hs.Weather(turbulence=6.0, wind=wind))
        assert rough == pytest.approx(mean_derivatives(air)["Z_w"], rel=1e-12)
        assert rough < calm < 0.0


def test_a_dataset_says_that_its_truth_is_a_mean():
    """So that replicates judged by calm air's truth, as once, are not put beside others."""
    gusty, calm = campaign_from(PLAN), campaign_from({})
    assert Dataset(Path("gusty"), gusty).provenance["truth"] == "mean over the air met"
    assert "truth" not in Dataset(Path("calm"), calm).provenance


def test_turbulence_widens_the_error_bars(by_weather):
    for wind in (0, 6):
        rough, calm = by_weather[6, wind]["Z_w"], by_weather[0, wind]["Z_w"]
        assert rough.standard_error > 1.5 * calm.standard_error


def test_wind_that_it_cannot_hover_in_fails_with_the_reason():
    campaign = campaign_from({**PLAN, "vary": {}, "set": {"weather": {"wind": 80}}})
    rows = fly_and_identify(campaign, campaign.replicate(0))
    assert {row.parameter for row in rows} == {"Z_w", "Z_col", "tau_col"}
    for row in rows:
        assert row.estimate is None
        assert "hover" in row.failure
