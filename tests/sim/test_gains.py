"""A pilot's gains on other laws: drift beside that on the gyro, known ratios, what is refused."""

import warnings
from dataclasses import dataclass

import numpy as np
import pytest

import helisim as hs
from helisim.sim import simulate
from helisim.sim.gains import on_law
from helisim.vehicle.law import trimmed_sticks
from small_laws import HOLDS

GIVEN = (-0.01, 0.15, 0.15, 0.035)
"""Gains of COL, LON, LAT and PED as the JR700's file has them."""
OUTER = (0.04, 0.1, 0.15)


@dataclass(frozen=True, kw_only=True)
class Stays(hs.Mission):
    """Hover on the spot."""

    duration: float = 30.0

    def fly(self, pilot):
        yield from pilot.hold(self.duration)


HOVERS = {
    "sweeps": {"excitation": hs.History.of([0.0, 30.0], [0.0, 0.0], axis="lat", source="nothing")},
    "mission": {"mission": Stays()},
}


def drift(vehicle, hover, law, turbulence, seed):
    plan = hs.FlightPlan(weather=hs.Weather(turbulence=turbulence), **HOVERS[hover])
    flight = next(simulate(vehicle.with_controller(law), plan, seed=seed))
    far = flight.positions[:, :2] - flight.positions[0, :2]
    return np.sqrt(np.mean(np.sum(far**2, axis=1)))


@pytest.mark.parametrize("hover", HOVERS)
@pytest.mark.parametrize(
    ("turbulence", "seed", "most"),
    # Calm: the remnant moves an attitude by 0.6 of the stick, and a rate's attitude by much more:
    # 0.05 to 0.12 of the gyro's drift. In rough air the loops are as fast as on the gyro, but the
    # law's own hold is softer in a gust: 0.4 to 2.0 in ten seeds. It was 2.5 to 26 with the gains
    # on the gyro, and 0.66 to 1.1 in calm air.
    [(None, 1, 0.25), ("light", 1, 2.5), ("light", 2, 2.5)],
)
def test_it_drifts_as_on_the_gyro(jr700, hover, turbulence, seed, most):
    own, held = (drift(jr700, hover, law, turbulence, seed) for law in (hs.Controller(), HOLDS))
    assert held < most * own


@pytest.mark.parametrize(
    ("changes", "times"),
    [
        ({}, (1.0, 1.0, 1.0, 1.0)),
        ({"lat.stick": -0.5, "lat.stick_cross": 0.0}, (1.0, 1.0, -2.0, 1.0)),
        ({"ped.k_delta": 2.0, "col.stick": -4.0}, (-0.25, 1.0, 1.0, 0.5)),
    ],
)
def test_sticks_that_ask_for_times_as_much_are_moved_by_one_over_it(jr700, changes, times):
    gyro = hs.RateCommand.of(jr700)
    own = gyro.parameters()
    law = gyro.replace({name: by * own[name] for name, by in changes.items()})
    for found in on_law(jr700.with_controller(law), GIVEN, *OUTER):
        # 2 %: roll and pitch turn into each other, which a stick of one alone doesn't undo
        np.testing.assert_allclose(found, np.multiply(times, GIVEN), rtol=0.02 * bool(changes))


def test_an_attitude_command_is_led_and_where_feedback_diverges_not_fed_back(jr700):
    """The attitude wanted is reached, by a whole stick of 0.6 rad; on the Lynx by leading alone.

    10 %: the loop that is kept closes by 0.92 to 1.
    """
    lynx = (-0.01, 0.5, 0.5, 0.1), 0.02, 0.05, 0.1  # of its file
    for vehicle, gains, share in (
        (jr700, (GIVEN, *OUTER), 0.6),
        (hs.load("lynx"), lynx, 2e-3),
    ):
        ahead, back = (one[1:3] for one in on_law(vehicle.with_controller(HOLDS), *gains))
        np.testing.assert_allclose(0.6 * ahead / (1.0 + 0.6 * back), 1.0, rtol=0.1)
        assert np.all(back < share * ahead)


def test_a_law_that_diverges_keeps_the_files_gains_with_a_note(jr700):
    """Its sticks stand off their middle too, where they hold the hover."""
    plate, trim = jr700.swashplate, jr700.trim

    def rates_up(seen):
        return (*plate.mix(seen.COL, seen.LON + 0.02 + 0.3 * seen.q, seen.LAT - 0.03), seen.PED)

    vehicle = jr700.with_controller(rates_up)
    with pytest.warns(UserWarning, match=r"'rates_up': .*grows at .* 1/s; the pilot keeps"):
        ahead, back = on_law(vehicle, GIVEN, *OUTER)
    assert tuple(ahead) == tuple(back) == GIVEN
    found = trimmed_sticks(vehicle.controller, vehicle.model, trim)
    held = (trim.col, trim.lon - 0.02, trim.lat + 0.03, trim.ped)
    np.testing.assert_allclose(found, held, atol=2e-9)  # commands settle to 1e-9


def fails(seen):
    raise ValueError("no law")


@pytest.mark.parametrize("law", [None, hs.Controller(tail=None), fails])
def test_nothing_is_scaled_where_there_is_nothing_to_scale_by(jr700, law):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ahead, back = on_law(jr700.with_controller(law), GIVEN, *OUTER)
    assert tuple(ahead) == tuple(back) == GIVEN
