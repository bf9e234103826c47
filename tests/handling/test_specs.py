"""Specifications as TOML: what is written is read again, and what is wrong is said in one line."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.handling import criteria
from helisim.handling.criteria import Limit, LoadRejection
from helisim.handling.criterion import MOST, froude_scale
from helisim.handling.loop import Curve, History, NoResponse
from helisim.handling.spec import (
    STANDARDS,
    Spec,
    known_criteria,
    read_specs,
    specs_to_toml,
    standard,
    write_specs,
)
from tabled import rows, tabled

ALL = rows(globals(), "ALL")
NAMES = [f"{one.name} {k}" for k, one in enumerate(ALL)]
EVERY = (
    *map(Spec, ALL),
    Spec(criteria.StabilityMargins(axis="lat", phase=Limit(0.7, 0.3)), "hard"),
    Spec(criteria.Crossover(axis="lon", at="sensors", frequency=Limit(20.0, 40.0)), "objective"),
    Spec(criteria.AttitudeQuickness(axis="lat", scale=4.0), "check"),
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


OF_TASK = {"attitude_bandwidth lat soft", "attitude_quickness lat soft", "damping all soft"}
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
        units = {"slowness": "s"}  # noqa: RUF012  (as a user writes it)

        def rate(self, loop):
            found = 1.0 / abs(loop.poles).min()
            return self.rated({"slowness": found}, [1.0 - found / self.most])

    path = tmp_path / "specs.toml"
    path.write_text('[[spec]]\ncriterion = "slowness"\naxis = "lat"\nmost = 2.0\n')
    (spec,) = read_specs(path)
    assert spec == Spec(Slowness(axis="lat", most=2.0))
    assert spec.criterion.rate(AttitudeLoop()).level == 1


# Criteria: levels, distances and charts say the same, and distances can be searched over.


def loops():
    for gain in np.geomspace(1e-3, 1e2, 16):
        yield AttitudeLoop(k=0.4 * gain, k_rate=0.12 * gain, delay=0.02)
    yield AttitudeLoop(k_rate=-0.05, delay=0.02)


def worst_level(rating):
    return max(
        min(k for k, span in enumerate(limit.spans(), 1) if min(span) <= value <= max(span))
        for limit, value in (
            (limit, rating.figures[name]) for name, limit in rating.criterion.limits.items()
        )
    )


@pytest.mark.parametrize("criterion", ALL, ids=NAMES)
def test_ratings_are_finite_and_agree_with_the_borders(criterion):
    levels = set()
    for loop in loops():
        rating = replace(criterion, scale=10.7).rate(loop)
        assert set(rating.figures) == set(criterion.units)
        unknown = {name for name, value in rating.figures.items() if not np.isfinite(value)}
        assert not unknown or (unknown == {"gain_bandwidth"} and "continued" in rating.remark)
        assert abs(rating.distance) <= MOST
        levels.add(rating.level)
        if min(abs(rating.distance), abs(rating.distance + 1.0)) > 1e-6:
            assert worst_level(rating) == rating.level
    assert len(levels) > 1 or criterion.name == "coupling"


@pytest.mark.parametrize("criterion", ALL, ids=NAMES)
def test_borders_scale_as_their_units_do(criterion):
    """By Froude's law: frequencies by sqrt N, times by its inverse, all else not at all."""
    power = {"rad/s": 0.5, "1/s": 0.5, "s": -0.5}
    scaled = replace(criterion, scale=9.0).limits
    for name, one in criterion.limits.items():
        factor = 9.0 ** power.get(criterion.units[name], 0.0)
        ends = one.level1 * factor, one.level2 * factor
        assert (scaled[name].level1, scaled[name].level2) == pytest.approx(ends)


SMOOTH = [
    one
    for one in ALL
    # the gain's bandwidth jumps as a hump appears; an attitude settles or runs on, and is then
    # changed by a pulse
    if one.name != "attitude_quickness" and getattr(one, "command", "") != "rate"
]


@pytest.mark.parametrize("criterion", SMOOTH, ids=[one.name for one in SMOOTH])
def test_distances_change_little_where_the_loop_does(criterion):
    """Five decades of gains by 8 %; where the distance is steep, by smaller steps."""

    def steps(gains):
        loops = [AttitudeLoop(k=0.4 * one, k_rate=0.12 * one, delay=0.02) for one in gains]
        return np.abs(np.diff([criterion.rate(one).distance for one in loops]))

    gains = np.geomspace(1e-3, 1e2, 151)
    found = steps(gains)
    steepest = int(np.argmax(found))
    finer = steps(np.geomspace(gains[steepest], gains[steepest + 1], 201))
    assert min(found.max(), 4.0 * finer.max()) < 0.5, gains[steepest]


@tabled("criterion", "words")
def test_what_lies_outside_of_the_band_is_remarked(criterion, words):
    narrow = AttitudeLoop(delay=0.02, frequency=tuple(np.geomspace(0.05, 0.5, 60)))
    assert words in criterion.rate(narrow).remark
    assert words not in criterion.rate(AttitudeLoop(delay=0.02)).remark


def test_a_scaled_criterion_rates_a_scaled_loop_alike():
    """A loop sqrt N times as fast, rated by the scaled criteria, has the same distances."""
    ratio = froude_scale(1.534)
    assert ratio == pytest.approx(10.66, rel=1e-3)
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
    for one in ALL:
        if one.name not in ("actuator_use", "pole_limits"):  # the servo is what it is
            here, there = one.rate(slow), replace(one, scale=ratio).rate(fast)
            assert there.distance == pytest.approx(here.distance, rel=2e-2, abs=1e-6), one


@tabled("make", "words")
def test_what_cannot_be_asked_is_said(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize("criterion", ALL, ids=NAMES)
def test_times_frequencies_and_sizes_are_above_0(criterion):
    least = {"low": -1e-9} if criterion.name == "damping" else {}
    for name in (name for name, value in vars(criterion).items() if type(value) is float):
        with pytest.raises(InputError):
            replace(criterion, **{name: least.get(name, 0.0)})


RIGHT_ANGLE = 0.5 * np.pi


@tabled("kind", "settings", "borders")
def test_borders_are_those_of_the_documents(kind, settings, borders):
    least = {} if kind in (criteria.Damping, criteria.PoleLimits) else {"axis": "lat"}
    found = kind(**least | settings)
    ends = [(one.level1, one.level2) for one in found.limits.values()]
    np.testing.assert_allclose(ends, borders, rtol=1e-12)
    usual = kind(**least | {name: 4.0 for name in settings if name == "rate_limit"})
    for name in settings.keys() - {"axis", "task"}:
        assert getattr(usual, name) == settings[name]


@tabled("axis", "points")
def test_quickness_ends_where_the_digitised_figure_does(axis, points):
    """Points of Prencipe's lines, most between those taken over: to 0.008 1/s.

    Between 38 and 50 degrees of roll Level 2 bends, by 0.024 1/s in the middle.
    """
    asked = criteria.AttitudeQuickness(axis=axis)
    for degrees, *levels in points:
        found = replace(asked, change=np.radians(degrees)).limits["quickness"]
        assert found.level1 == pytest.approx(levels[0], abs=0.008)
        bends = (axis, degrees) == ("roll", 44.0)
        assert found.level2 == pytest.approx(levels[1], abs=0.025 if bends else 0.008)
    assert asked.change == np.radians(20.0)


def test_quickness_is_judged_at_the_change_that_is_kept():
    """A step to 0.5 rad that falls back to 0.4 and stays; half of a wanted 0.25 is a peak of that.

    Of the least change after the peak, 0.2 rad, the border is ADS-33's.
    """
    time = np.linspace(0.0, 5.0, 501)
    phi = np.interp(time, [0.0, 1.0, 1.5], [0.0, 0.5, 0.4])
    signals = {"phi": phi, "p": np.gradient(phi, time)}
    seen = SimpleNamespace(step=lambda *_, **__: History(time, signals))
    found = criteria.AttitudeQuickness(axis="lat", change=0.25).rate(seen)
    assert dict(found.figures) == pytest.approx({"quickness": 1.0, "peak": 0.25, "least": 0.2})
    assert found.criterion == criteria.AttitudeQuickness(axis="lat", change=found.figures["least"])


@pytest.mark.parametrize("axis", ["lat", "lon", "ped"])
def test_of_a_rate_response_the_lesser_bandwidth_counts(axis):
    """ADS-33E-PRF, 3.3.5.1: yaw answers with a rate; of exp(-s / 10) / s^0.5 it is the gain's."""
    own = np.geomspace(0.5, 60.0, 2000)
    seen = SimpleNamespace(command=lambda *_: Curve(own, np.exp(-0.1j * own) / (1j * own) ** 0.5))
    rating = criteria.AttitudeBandwidth(axis=axis).rate(seen)
    assert ("look for oscillations" in rating.remark) == (axis != "ped")
    # -135 deg at 5 pi, -180 deg at 7.5 pi, where the gain is half of that at a quarter of it
    bandwidth = 7.5 * np.pi / 4.0 if axis == "ped" else 5.0 * np.pi
    assert rating.figures["bandwidth"] == pytest.approx(bandwidth, rel=1e-4)


@pytest.mark.parametrize("scale", [1.0, 16.0])
def test_actuator_use_of_an_angle_fed_back_is_that_of_filtered_noise(scale):
    """White noise behind two lags, from their corner to 100 rad/s: the integral's closed form."""
    wide, corner = np.geomspace(1.0, 100.0, 9), 3.0 * np.sqrt(scale)
    fed = SimpleNamespace(actuator=lambda axis, by: Curve(wide, np.full(wide.size, -2.0 + 0j)))
    own = {"rms": 0.1, "corner": 3.0, "travel": 0.4, "rate_limit": 5.0, "scale": scale}
    ends = np.array([1.0, 100.0 / corner])
    turned, part = np.ptp(np.arctan(ends)), np.diff(ends / (1.0 + ends**2))[0]
    position, rate = (np.sqrt(2.0 / np.pi * (turned + side * part)) for side in (1.0, -1.0))
    wanted = {"position": 0.2 / 0.4 * position, "rate": 0.2 * corner / 5.0 * rate}
    # 1e-3: trapezia of 400 points
    found = criteria.ActuatorUse(axis="lat", **own).rate(fed)
    assert dict(found.figures) == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("kind", [criteria.AttitudeQuickness, criteria.Coupling])
@pytest.mark.parametrize("kept", [("phi",), ("theta", "p")])
def test_a_step_that_lacks_an_attitude_rates_nothing(kind, kept):
    signals = {name: np.linspace(0.0, 1.0, 50) for name in kept}
    seen = SimpleNamespace(step=lambda *_, **__: History(np.linspace(0.0, 5.0, 50), signals))
    with pytest.raises(NoResponse, match=r"a step of lat shows no phi and (p|theta)"):
        kind(axis="lat").rate(seen)


def test_a_figure_that_is_no_number_is_level_3():
    assert criteria.Damping().rated({"damping": np.nan}).level == 3


def test_an_axis_answers_to_both_of_its_names():
    assert criteria.StabilityMargins(axis="roll") == criteria.StabilityMargins(axis="lat")
    words = [criteria.StabilityMargins(axis=one).word for one in ("lat", "lon", "ped", "col")]
    assert [*words, criteria.Damping().word] == ["roll", "pitch", "yaw", "heave", "whole loop"]
    with pytest.raises(UnknownNameError):
        criteria.Damping(axis="everything")


@pytest.mark.parametrize("gain", [0.4, 4.0])
def test_a_slow_load_turns_the_vehicle_as_a_spring_does(gain):
    """Far below the bandwidth the angle is the load over the angle's gain: a servo's stiffness."""
    loop = AttitudeLoop(k=gain)
    rating = LoadRejection(axis="lat", low=0.21, high=0.23, turned=Limit(0.0, 6.0)).rate(loop)
    # next is w k_rate / k of it in quadrature, 0.2 % at 0.21 rad/s: 0.02 dB
    assert rating.figures["turned"] == pytest.approx(-20.0 * np.log10(gain), abs=0.02)
    with pytest.raises(NoResponse, match=r"known from 0\.2 to 150 rad/s, not from 0\.1 to 2"):
        LoadRejection(axis="lat", low=0.1, high=2.0, turned=Limit(0.0, 6.0)).rate(loop)
