"""What a proof counts as missed."""

from types import SimpleNamespace

import pytest

import helisim as hs
from helisim.design.proof import Proof, over_air
from helisim.sim import Weather


def rated(level):
    return None if level is None else SimpleNamespace(level=level)


@pytest.mark.parametrize(
    ("kind", "flown", "exact", "said"),
    [
        ("hard", 1, 2, None),
        ("hard", None, 2, "Level 2 exactly"),
        ("soft", 3, 1, "Level 3 in flight"),
        ("soft", None, None, "known neither exactly nor from flight"),
        ("objective", 2, 2, None),
        ("check", 3, 3, None),
    ],
)
def test_hard_and_soft_specifications_are_held_against_flight_first(kind, flown, exact, said):
    """An objective has no level to keep: it is as good as the others let it be."""
    spec = hs.Spec(hs.criteria.StabilityMargins(axis="lat"), kind)
    row = SimpleNamespace(spec=spec, flown=rated(flown), exact=rated(exact))
    misses = Proof.misses.fget(SimpleNamespace(table=(row,)))
    assert misses == (() if said is None else (f"stability_margins of roll: {said}",))


def test_a_wind_that_a_vehicle_can_not_hover_in_is_a_remark(jr700):
    """A small vehicle meets gusts that it couldn't hover in: exact figures are of calm air then."""
    found, remarks = over_air(jr700, Weather(wind=4.0, turbulence="severe"))
    assert found is None
    assert "of calm air alone: " in remarks[0]
    assert over_air(jr700, Weather()) == (None, ())
