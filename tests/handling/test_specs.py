"""Specifications as TOML: what is written is read again, and what is wrong is said in one line."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.base.errors import HelisimError, InputError
from helisim.handling import criteria
from helisim.handling.criteria import Border, Limit
from helisim.handling.criterion import Froude
from helisim.handling.spec import (
    KINDS,
    STANDARDS,
    Spec,
    known_criteria,
    read_specs,
    specs_to_toml,
    standard,
    write_specs,
)

EVERY = (
    Spec(criteria.StabilityMargins(axis="lat", phase=Limit(0.7, 0.3)), "hard"),
    Spec(criteria.Crossover(axis="lon", frequency=Limit(20.0, 40.0)), "objective"),
    Spec(criteria.CrossoverOrder(axis="lon", at="sensors")),
    Spec(criteria.NicholsExclusion(axis="ped", shape="ellipse", scale=4.0), "check"),
    Spec(criteria.DiskMargin(axis="ped", skew=1.0)),
    Spec(criteria.DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 6.0))),
    Spec(criteria.AttitudeBandwidth(axis="lon", fit=True, sign=-1)),
    Spec(criteria.AttitudeQuickness(axis="lat", border=Border((0.1, 0.5), (2, 1), (1, 0.5)))),
    Spec(criteria.AttitudeHold(axis="lat")),
    Spec(criteria.Damping(low=1.0)),
    Spec(criteria.PoleLimits(fastest=Limit(100.0, 200.0))),
    Spec(criteria.ActuatorOnset(axis="lat", rate_limit=3.0)),
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
    )
    margins, damping = read_specs(path)
    assert margins.criterion.phase.level1 == pytest.approx(np.radians(50.0), rel=1e-15)
    assert (margins.criterion.axis, margins.criterion.scale, margins.kind) == ("lat", 9.0, "hard")
    assert (damping.criterion.scale, damping.kind) == (1.0, "soft")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"no specification: each is a table \[\[spec\]\]"),
        ("spec = 3\n", "no specification"),
        ("sepc = 3\n", "did you mean spec"),
        ('[[spec]]\naxis = "lat"\n', "spec 1: it says no criterion; there are actuator_onset"),
        ('[[spec]]\ncriterion = "margins"\n', "did you mean stability_margins"),
        ('[[spec]]\ncriterion = "damping"\nkind = "firm"\n', "hard, soft, objective, check"),
        (
            '[[spec]]\ncriterion = "damping"\nhigh = "x"\n',
            r"spec 1: damping\.high must be a number above 0, got 'x'",
        ),
        ('[[spec]]\ncriterion = "damping"\nratio = 0.5\n', "two numbers, where Levels 1 and 2"),
        ('[[spec]]\ncriterion = "damping"\nratio = [0.5, 0.5]\n', "can't end at the same value"),
        ('[[spec]]\ncriterion = "damping"\nlowest = 2.0\n', "unknown setting of damping 'lowest'"),
        (
            '[[spec]]\ncriterion = "stability_margins"\naxis = "lat"\ngain_deg = [6.0, 3.0]\n',
            "unknown setting of stability_margins 'gain_deg'; available: .* phase_deg",
        ),
        (
            '[[spec]]\ncriterion = "stability_margins"\naxis = "lat"\nphase_deg = [20, 45]\n',
            "phase: more is better, so Level 1 must end above where Level 2 does",
        ),
        (
            '[[spec]]\ncriterion = "disturbance_rejection"\naxis = "lat"\nbandwidth = [1, 2]\n',
            "bandwidth: more is better",
        ),
        (
            '[[spec]]\ncriterion = "nichols_exclusion"\naxis = "lat"\nphase = 0.5\n'
            "phase_deg = 30\n",
            "phase and phase_deg say the same",
        ),
        ('[[spec]]\ncriterion = "crossover"\naxis = "lat"\n', "crossover needs frequency"),
        ('[[spec]]\ncriterion = "crossover"\n', "crossover needs axis and frequency"),
        ('[[spec]]\ncriterion = "disk_margin"\naxis = "rol"\n', "did you mean roll"),
        ('[[spec]]\ncriterion = "disk_margin"\naxis = 3\n', "disk_margin.axis must be text, got 3"),
        ('scale = true\n[[spec]]\ncriterion = "damping"\n', "scale must be a number, got True"),
        ("[[spec]]\ncriterion = []\n", r"it has criterion = \[\]; there are actuator_onset"),
        *(
            (
                f'[[spec]]\ncriterion = "{name}"\naxis = "lat"\nrate_limit = {value}\n',
                f"{name}.rate_limit must be a (finite )?number above 0, got {value}",
            )
            for name in ("actuator_use", "actuator_onset")
            for value in ("nan", "inf", "-1.0")
        ),
        ('scale = -1.0\n[[spec]]\ncriterion = "damping"\n', "above 0"),
        (
            '[[spec]]\ncriterion = "attitude_quickness"\naxis = "lat"\nborder = [1.0]\n',
            "attitude_quickness.border must be a table",
        ),
        (
            '[[spec]]\ncriterion = "attitude_bandwidth"\naxis = "lat"\nfit = 1\n',
            "fit must be true or false, got 1",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text, words, tmp_path):
    path = tmp_path / "specs.toml"
    path.write_text(text)
    with pytest.raises(HelisimError, match=words) as caught:
        read_specs(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", STANDARDS)
def test_a_standard_rates_a_loop(name):
    """Each of its specifications, at full scale and scaled, gives a rating of a loop."""
    loop = AttitudeLoop()
    for scale in (1.0, 10.7):
        specs = standard(name, axes=("roll",), scale=scale)
        assert specs
        for one in specs:
            assert one.kind in KINDS
            assert one.criterion.scale == scale
            assert one.criterion.rate(loop).level in (1, 2, 3)
    assert len(standard(name)) > len(specs)


def test_an_own_criterion_is_read_from_a_file(tmp_path):
    """A dataclass that is defined is known by its name, its numbers by theirs."""

    @dataclass(frozen=True, kw_only=True)
    class Slowness(criteria.Criterion):
        most: float
        name = "slowness"
        source = "this test"
        units = {"slowness": "s"}  # noqa: RUF012

        def rate(self, loop):
            found = 1.0 / abs(loop.poles).min()
            return self.rated({"slowness": found}, [1.0 - found / self.most])

        def chart(self):
            raise NotImplementedError

    path = tmp_path / "specs.toml"
    path.write_text('[[spec]]\ncriterion = "slowness"\naxis = "lat"\nmost = 2.0\n')
    (spec,) = read_specs(path)
    assert spec == Spec(Slowness(axis="lat", most=2.0))
    assert spec.criterion.rate(AttitudeLoop()).level == 1


def test_a_specification_is_of_a_criterion():
    with pytest.raises(InputError, match="got 'margins'"):
        Spec("margins")


def test_an_unknown_standard_is_said():
    with pytest.raises(InputError, match="did you mean margins"):
        standard("margin")


def test_froude_keeps_the_froude_number_and_what_follows_from_it():
    """Speed squared over length and g; frequency times time; a pendulum of the rotor's length."""
    law = Froude.of(1.534)
    assert law.ratio == pytest.approx(10.67, rel=1e-3)
    assert law.speed**2 / law.length == pytest.approx(1.0)
    assert law.frequency * law.time == pytest.approx(1.0)
    pendulum = np.sqrt(9.81 / 1.534) / np.sqrt(9.81 / 16.36)
    assert law.frequency == pytest.approx(pendulum)
    assert law.speed / law.time == pytest.approx(law.acceleration)
    assert law.angular_acceleration == pytest.approx(law.frequency**2)
    assert law.inertia == pytest.approx(law.mass * law.length**2)
    for wrong in (lambda: Froude(0.0), lambda: Froude.of(-1.0)):
        with pytest.raises(InputError, match="above 0"):
            wrong()


def test_a_scaled_criterion_rates_a_scaled_loop_alike():
    """A loop sqrt N times as fast, rated by the scaled criteria, has the same distances."""
    ratio = 10.67
    faster = np.sqrt(ratio)
    slow = AttitudeLoop(b=4.0, k=2.0, k_rate=1.6, lag=0.05, delay=0.03)
    fast = AttitudeLoop(
        b=4.0 * ratio,
        k=2.0,
        k_rate=1.6 / faster,
        lag=0.05 / faster,
        delay=0.03 / faster,
        frequency=tuple(faster * np.array(slow.frequency)),
    )
    for one in EVERY:
        criterion = replace(one.criterion, scale=1.0)
        if criterion.name in ("actuator_onset", "actuator_use", "pole_limits"):
            continue  # the servo is what it is
        here = criterion.rate(slow)
        there = replace(criterion, scale=ratio).rate(fast)
        assert there.distance == pytest.approx(here.distance, rel=2e-2, abs=1e-6), criterion
