"""A law designed on a small aircraft, judged by python-control and by scans of its gains."""

from dataclasses import dataclass
from itertools import product

import control
import numpy as np
import pytest
from small_design import SmallLaw, SmallLoop, SmallPlant
from small_specs import small_specs

from helisim.base.errors import InputError
from helisim.design.design import design
from helisim.design.problem import InfeasibleError, UnstableError, distance
from helisim.handling.criteria import Crossover, DisturbanceRejection, Limit, StabilityMargins
from helisim.handling.loop import Curve

PLANT = SmallPlant()


def designed(specs=None, law=None, **options):
    given = {"models": 0, "drawn": 0, "period": 0.002, "close": SmallLoop} | options
    return design(PLANT, law or SmallLaw(), specs or small_specs(), **given)


def cut_by_control(law: SmallLaw, axis: str) -> control.StateSpace:
    """Return L at one actuator, the other closed, by python-control's interconnection."""
    a, b, c = PLANT.matrices
    gains = law.linear(0.002).matrix[:, :4]
    cut = ("lat", "lon").index(axis)
    other = 1 - cut
    around = a + b[:, [other]] @ gains[[other]] @ c
    return control.ss(around, b[:, [cut]], -gains[[cut]] @ c, 0.0)


def rejection_by_control(law: SmallLaw, axis: str) -> float:
    """Return where |S| of the attitude rises through 1 / sqrt 2, rad/s: S = (I - P K)^-1 seen."""
    a, b, c = PLANT.matrices
    gains = law.linear(0.002).matrix[:, :4]
    angle = ("lat", "lon").index(axis)
    # a disturbance d of the angle, its derivative on the rate: what is sensed is y + [s d, d]
    closed = control.ss(a + b @ gains @ c, b @ gains, c, np.zeros((4, 4)))
    omega = np.geomspace(1.0, 60.0, 6000)
    moved = closed(1j * omega)
    sensed = 1.0 + moved[2 + angle, angle] * 1j * omega + moved[2 + angle, 2 + angle]
    return float(omega[np.argmax(np.abs(sensed) > np.sqrt(0.5))])


def test_a_designed_law_has_the_margins_and_the_rejection_that_were_asked_for():
    """By python-control's margins and its own interconnection, the design margin of 0.1 kept."""
    law = designed().law
    for axis, wanted in (("lat", 16.0), ("lon", 11.0)):
        gain, phase, *_ = control.stability_margins(cut_by_control(law, axis))
        assert 20.0 * np.log10(gain) > 6.0
        assert phase > 45.0
        # 1.05 of what is asked: 0.1 of the distance to half of it; 0.5 %: curves between points
        assert rejection_by_control(law, axis) > 1.05 * wanted * 0.995


@pytest.mark.slow
def test_the_cost_is_the_least_that_a_scan_of_all_gains_finds():
    specs = small_specs()
    found = designed(specs, margin=0.0)
    cost = sum(-one.nominal.distance for one in found.judged if one.spec.kind == "objective")
    least = np.inf
    for rates in product(np.geomspace(0.08, 0.3, 14), repeat=2):
        for angles in product((0.0034, 0.1, 0.6, 1.5), repeat=2):
            names = ("lat.k_rate", "lon.k_rate", "lat.k_angle", "lon.k_angle")
            loop = loop_of(SmallLaw().replace(dict(zip(names, (*rates, *angles)))))
            if loop.poles.real.max() >= 0.0:
                continue
            rated = [one.criterion.rate(loop) for one in specs]
            if all(r.distance >= 0.0 for r, one in zip(rated, specs) if one.kind != "objective"):
                own = [r.distance for r, one in zip(rated, specs) if one.kind == "objective"]
                least = min(least, -sum(own))
    assert np.isfinite(least)
    assert cost <= least + 1e-3


def loop_of(law: SmallLaw) -> SmallLoop:
    return SmallLoop(PLANT, law.linear(0.002), np.geomspace(0.3, 120.0, 120))


@pytest.mark.slow
def test_what_cannot_be_met_is_named_with_the_nearest_value_that_can():
    with pytest.raises(
        InfeasibleError, match=r"^rejects of roll can't be met with the others"
    ) as e:
        designed(small_specs(lat=25.0))
    nearest = e.value.nearest.figures["bandwidth"]
    assert f"bandwidth {nearest:.3g} rad/s instead of bandwidth 25 rad/s" in str(e.value)
    most = 0.0
    for rate, angle in product(np.linspace(0.2, 0.3, 51), (0.0034, 0.2, 1.0)):
        law = SmallLaw().replace({"lat.k_rate": rate, "lat.k_angle": angle, "lon.k_rate": 0.17})
        if loop_of(law).poles.real.max() < 0.0:
            gain, phase, *_ = control.stability_margins(cut_by_control(law, "lat"))
            if 20.0 * np.log10(gain) >= 6.0 and phase >= 45.0:
                most = max(most, rejection_by_control(law, "lat"))
    assert nearest == pytest.approx(most, rel=0.02)  # pitch's gain, that couples, is not scanned


def test_what_cannot_be_met_together_is_named_in_one_line():
    with pytest.raises(InfeasibleError, match="rejects of roll, rejects of pitch") as caught:
        designed(small_specs(lat=40.0, lon=28.0))
    assert "\n" not in str(caught.value)


def test_models_drawn_keep_level_1_that_a_design_on_the_nominal_one_loses():
    options = {"margin": 0.0, "drawn": 60}
    alone, robust = designed(**options), designed(**options, models=20)
    # two bandwidths, each at its border in the model designed for: 1/4, or (20/21)^2, is expected;
    # three standard deviations of a binomial share of 60 are 0.17 and 0.11
    assert alone.share < 0.25 + 0.17
    assert robust.share > 0.91 - 0.13
    assert any(one.startswith("rejects of roll: Level 1 in") for one in alone.misses)
    assert all(one.worst.distance <= one.nominal.distance for one in robust.judged)


def test_an_unstable_start_is_made_stable_first():
    found = designed(law=SmallLaw().replace({"lat.k_rate": 0.9, "lon.k_rate": 1.1}))
    assert found.history[0].phase == "stable"
    assert found.judged[0].before is None
    assert all(one.nominal.level == 1 for one in found.judged)


def test_a_model_that_no_gain_stabilises_is_said_so():
    with pytest.raises(UnstableError, match=r"a pole stays at \+.* rad/s"):
        design(
            SmallPlant(damping=(-30.0, 7.0)),
            SmallLaw(),
            small_specs(),
            models=0,
            drawn=0,
            period=0.002,
            close=SmallLoop,
        )


def test_a_design_is_the_same_again():
    one, other = (designed(models=4, drawn=3).to_dict() for _ in range(2))
    assert one == other


def test_bad_input_is_one_line():
    lonely = SmallLaw()
    for options, words in (
        ({"only": ("lat.k_rte",)}, "did you mean lat.k_rate"),
        ({"bounds": {"lat.k_rate": (2.0, 1.0)}}, "can't be moved from 2 to 1"),
        ({"specs": small_specs()[:0] or ()}, "a design needs a specification"),
        ({"margin": -1.0}, "the design margin"),
        ({"models": -1}, "models must be 0 or more"),
        ({"period": 0.0}, "the law's period"),
    ):
        given = {"specs": small_specs(), "models": 0, "drawn": 0, "period": 0.002} | options
        specs = given.pop("specs")
        with pytest.raises(InputError, match=words) as caught:
            design(PLANT, lonely, specs, close=SmallLoop, **given)
        assert "\n" not in str(caught.value)


@dataclass
class Humped:
    """|S| rises by 20 dB a decade through -3.01 dB at 20 rad/s; a hump at 5 rad/s, dB."""

    hump: float

    def disturbance(self, axis):
        frequency = np.geomspace(0.3, 120.0, 400)
        size = -3.0103 + 20.0 * np.log10(frequency / 20.0)
        size += (self.hump - size) * np.exp(-((np.log(frequency / 5.0) / 0.2) ** 2))
        return Curve(frequency, 10.0 ** (size / 20.0))

    def broken(self, axis, at="actuators"):
        return Curve(np.array([1.0, 10.0]), np.array([2.0, 0.1 - 0.1j]))


@pytest.mark.parametrize("hump", [-9.0, -5.0, -3.1])
def test_a_hump_counts_by_its_height(hump):
    """Continuously: one unit in 15 dB, though the bandwidth itself is 20 rad/s."""
    asked = DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 9.9))
    loop = Humped(hump)
    assert asked.rate(loop).figures["drb"] == pytest.approx(20.0, rel=1e-3)
    # 2 %: the hump's top lies between points of the grid, and a little beside 5 rad/s
    expected = min(asked.rate(loop).distance, (-3.0103 - hump) / 15.0)
    assert distance(asked, loop) == pytest.approx(expected, abs=0.02)


def test_a_hump_beyond_costs_no_more_than_it_jumps():
    asked = DisturbanceRejection(axis="lat", bandwidth=Limit(12.9, 9.9))
    assert distance(asked, Humped(-2.9)) == asked.rate(Humped(-2.9)).distance < -1.0


def test_other_criteria_are_as_they_are():
    asked = StabilityMargins(axis="lat")
    assert distance(asked, Humped(-5.0)) == asked.rate(Humped(-5.0)).distance


@dataclass
class Dipped:
    """A gain that falls to -3 dB at 5 rad/s, and bulges to another, dB, at 30 rad/s."""

    bulge: float

    def broken(self, axis, at="actuators"):
        frequency = np.geomspace(0.3, 120.0, 400)
        corners = np.log([0.3, 5.0, 30.0, 120.0])
        size = np.interp(np.log(frequency), corners, [12.0, -3.0, self.bulge, self.bulge - 20.0])
        return Curve(frequency, 10.0 ** (size / 20.0) * np.exp(-2.0j))


@pytest.mark.parametrize("bulge", [-4.0, -1.5, -0.5])
def test_a_dip_of_the_gain_counts_by_its_depth(bulge):
    """One unit in 15 dB, where the crossover itself stays at 3.2 rad/s, whatever the bulge."""
    asked = Crossover(axis="lat", frequency=Limit(30.0, 29.0))
    loop = Dipped(bulge)
    assert asked.rate(loop).figures["crossover"] < 4.0
    # 0.01: the bulge's top lies between points of the grid
    assert distance(asked, loop) == pytest.approx(bulge / 15.0, abs=0.01)


def test_a_crossover_that_is_met_or_asked_to_be_slow_is_as_it_is():
    met, slow = Limit(30.0, 20.0), Limit(2.0, 4.0)
    for limit, loop in ((met, Dipped(3.0)), (slow, Dipped(-4.0))):
        asked = Crossover(axis="lat", frequency=limit)
        assert distance(asked, loop) == asked.rate(loop).distance
