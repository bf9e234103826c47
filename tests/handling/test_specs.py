"""Specifications as TOML: what is written is read again, and what is wrong is said in one line."""

from dataclasses import dataclass

import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.base.errors import HelisimError, InputError
from helisim.handling import criteria
from helisim.handling.criteria import Limit
from helisim.handling.spec import (
    STANDARDS,
    Spec,
    known_criteria,
    read_specs,
    specs_to_toml,
    standard,
    write_specs,
)
from tabled import tabled

EVERY = (
    Spec(criteria.StabilityMargins(axis="lat", phase=Limit(0.7, 0.3)), "hard"),
    Spec(criteria.Crossover(axis="lon", at="sensors", frequency=Limit(20.0, 40.0)), "objective"),
    Spec(criteria.DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 6.0))),
    Spec(criteria.AttitudeBandwidth(axis="lon", command="rate")),
    Spec(criteria.AttitudeQuickness(axis="lat", scale=4.0), "check"),
    Spec(criteria.Damping(low=1.0)),
    Spec(criteria.PoleLimits()),
    Spec(criteria.ActuatorUse(axis="lat", rate_limit=3.0)),
    Spec(criteria.Coupling(axis="ped", onto="lat")),
    Spec(criteria.LoadRejection(axis="lon", high=2, by="lat", turned=Limit(-6, 0))),
)


def test_every_criterion_is_read_as_it_was_written(tmp_path):
    public = {getattr(criteria, name) for name in criteria.__all__}
    assert {type(one.criterion) for one in EVERY} == public & set(known_criteria().values())
    write_specs(EVERY, tmp_path / "specs.toml")
    assert read_specs(tmp_path / "specs.toml") == EVERY
    assert specs_to_toml(EVERY) == (tmp_path / "specs.toml").read_text()


def test_what_people_write_is_read(tmp_path):
    """A scale for all, words for axes, degrees where a name says so, whole numbers."""
    path = tmp_path / "specs.toml"
    path.write_text(
        'scale = 9\n[[spec]]\ncriterion = "stability_margins"\naxis = "roll"\nkind = "hard"\n'
        'phase_deg = [50, 25]\n[[spec]]\ncriterion = "damping"\nscale = 1.0\n'
        '[[spec]]\ncriterion = "actuator_use"\naxis = "pitch"\nrate_limit = 4\nrms_deg = 2\n'
    )
    margins, damping, use = read_specs(path)
    assert (use.criterion.rms, use.criterion.rate_limit) == (pytest.approx(np.radians(2.0)), 4.0)
    assert margins.criterion.phase.level1 == pytest.approx(np.radians(50.0), rel=1e-15)
    assert (margins.criterion.axis, margins.criterion.scale, margins.kind) == ("lat", 9.0, "hard")
    assert (damping.criterion.scale, damping.kind) == (1.0, "soft")


def asked(name, settings=""):
    return f'[[spec]]\ncriterion = "{name}"\naxis = "lat"\n{settings}\n'


@tabled("text", "words")
def test_what_is_wrong_is_said_in_one_line(text, words, tmp_path):
    path = tmp_path / "specs.toml"
    path.write_text(text)
    with pytest.raises(HelisimError, match=words) as caught:
        read_specs(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


OF_TASK = {"attitude_bandwidth lat soft", "attitude_quickness lat check", "damping all soft"}
OF_ROLL_AND_HEAVE = {
    "margins": {
        "pole_limits all hard",
        *(f"stability_margins {one} hard" for one in ("lat", "col")),
    },
    "disturbance_rejection": {f"disturbance_rejection {one} soft" for one in ("lat", "col")},
}


@pytest.mark.parametrize("name", STANDARDS)
def test_a_standard_rates_a_loop(name):
    """ADS-33E-PRF, 3.3.9.2: what couples is pitch due to roll, and roll due to pitch."""
    specs = standard(name, axes=("roll", "heave"), scale=10.7)
    found = {f"{one.criterion.name} {one.criterion.axis} {one.kind}" for one in specs}
    assert found == OF_ROLL_AND_HEAVE.get(name, OF_TASK)
    for criterion in (one.criterion for one in specs):
        assert criterion.scale == 10.7
        assert getattr(criterion, "task", "") in name
        assert criterion.rate(AttitudeLoop()).level in (1, 2, 3)
    usual = [one.criterion for one in standard(name)]
    pairs = {(one.axis, one.onto) for one in usual if isinstance(one, criteria.Coupling)}
    assert pairs == ({("lat", "lon"), ("lon", "lat")} if name not in OF_ROLL_AND_HEAVE else set())
    assert {one.axis for one in usual} - {"all"} == {"lat", "lon", "ped"}


def test_an_own_criterion_is_read_from_a_file(tmp_path):
    @dataclass(frozen=True, kw_only=True)
    class Slowness(criteria.Criterion):
        most: float
        name = "slowness"
        source = "this test"
        units = {"slowness": "s"}  # noqa: RUF012

        def rate(self, loop):
            found = 1.0 / abs(loop.poles).min()
            return self.rated({"slowness": found}, [1.0 - found / self.most])

    path = tmp_path / "specs.toml"
    path.write_text('[[spec]]\ncriterion = "slowness"\naxis = "lat"\nmost = 2.0\n')
    (spec,) = read_specs(path)
    assert spec == Spec(Slowness(axis="lat", most=2.0))
    assert spec.criterion.rate(AttitudeLoop()).level == 1


def test_what_is_no_specification_is_said():
    with pytest.raises(InputError, match="got 'margins'"):
        Spec("margins")
    with pytest.raises(InputError, match="did you mean margins"):
        standard("margin")
