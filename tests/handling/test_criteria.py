"""Criteria: levels, distances and charts say the same, and distances can be searched over."""

from dataclasses import replace

import numpy as np
import pytest
from attitude_loop import AttitudeLoop

from helisim.base.errors import InputError, UnknownNameError
from helisim.handling import criteria
from helisim.handling.criteria import Border, Criterion, Limit, LoadRejection
from helisim.handling.criterion import MOST

ALL = [
    criteria.StabilityMargins(axis="lat"),
    criteria.Crossover(axis="lat", frequency=Limit(6.0, 3.0)),
    criteria.CrossoverOrder(axis="lat"),
    criteria.NicholsExclusion(axis="lat"),
    criteria.NicholsExclusion(axis="lat", shape="ellipse"),
    criteria.DiskMargin(axis="lat"),
    criteria.DisturbanceRejection(axis="lat"),
    criteria.AttitudeBandwidth(axis="lat"),
    criteria.AttitudeBandwidth(axis="lat", command="rate", task="target_acquisition", fit=True),
    criteria.AttitudeQuickness(axis="lat"),
    criteria.AttitudeHold(axis="lat"),
    criteria.Damping(),
    criteria.PoleLimits(fastest=Limit(200.0, 400.0)),
    criteria.ActuatorOnset(axis="lat", rate_limit=4.0),
    criteria.ActuatorUse(axis="lat", rate_limit=4.0),
    criteria.Coupling(axis="lat"),
    criteria.LoadRejection(axis="lat", high=2.0, turned=Limit(6.0, 12.0)),
]
NAMES = [f"{one.name} {k}" for k, one in enumerate(ALL)]
SCALES = (1.0, 10.7)


def loops():
    """Loops from far too slow to unstable: gains over five decades, and a delay."""
    for gain in np.geomspace(1e-3, 1e2, 26):
        yield AttitudeLoop(k=0.4 * gain, k_rate=0.12 * gain, delay=0.02)
    yield AttitudeLoop(k_rate=-0.05, delay=0.02)


@pytest.mark.parametrize("criterion", ALL, ids=NAMES)
@pytest.mark.parametrize("scale", SCALES)
def test_ratings_are_finite_and_agree_with_the_chart(criterion, scale):
    """Whatever the loop, the level is that of the place on the chart, and that of the distance."""
    scaled = replace(criterion, scale=scale)
    chart = scaled.chart()
    levels = set()
    for loop in loops():
        rating = scaled.rate(loop)
        assert set(rating.figures) == set(criterion.units)
        assert all(np.isfinite(value) for value in rating.figures.values()), rating
        assert np.isfinite(rating.distance)
        assert abs(rating.distance) <= MOST
        assert rating.level == (1 if rating.distance >= 0 else 2 if rating.distance >= -1 else 3)
        levels.add(rating.level)
        names = [one.figure for one in (chart.across, chart.up) if one is not None]
        on_border = min(abs(rating.distance), abs(rating.distance + 1.0)) < 1e-6
        if all(names) and not on_border and len(criterion.units) >= len(names):
            drawn = chart.level_at(*(rating.figures[name] for name in names))
            assert drawn == rating.level or criterion.name == "pole_limits", rating
    assert len(levels) > 1 or criterion.name == "coupling" or scale > 1.0


SMOOTH = [
    one
    for one in ALL
    # by definition a settling time jumps by a swing, and the gain's bandwidth as a hump appears;
    # an attitude settles or runs on, and is then changed by a pulse
    if one.name not in ("attitude_hold", "attitude_quickness")
    and getattr(one, "command", "") != "rate"
]


@pytest.mark.parametrize("criterion", SMOOTH, ids=[one.name for one in SMOOTH])
def test_distances_change_little_where_the_loop_does(criterion):
    """A search over gains, five decades in steps of 4 %, meets no jump across a level.

    Where the distance is steep, as that of a peak is where the loop becomes unstable, smaller
    steps of gain are smaller steps of distance.
    """

    def steps(gains):
        loops = [AttitudeLoop(k=0.4 * one, k_rate=0.12 * one, delay=0.02) for one in gains]
        return np.abs(np.diff([criterion.rate(one).distance for one in loops]))

    gains = np.geomspace(1e-3, 1e2, 301)
    found = steps(gains)
    steepest = int(np.argmax(found))
    finer = steps(np.geomspace(gains[steepest], gains[steepest + 1], 201))
    assert min(found.max(), 4.0 * finer.max()) < 0.5, gains[steepest]


@pytest.mark.parametrize(
    ("criterion", "words"),
    [
        (criteria.StabilityMargins(axis="lat"), "crossover is extended"),
        (criteria.Crossover(axis="lat", frequency=Limit(6.0, 3.0)), "extended"),
        (criteria.DisturbanceRejection(axis="lat"), "DRB is extended"),
        (criteria.AttitudeBandwidth(axis="lat"), "what is missing was continued"),
        (criteria.ActuatorOnset(axis="lat", rate_limit=1e4), "the rate limit is not met"),
    ],
    ids=lambda one: getattr(one, "name", ""),
)
def test_what_lies_outside_of_the_band_is_remarked(criterion, words):
    """A loop that is too fast for its band, and the same seen wholly."""
    narrow = AttitudeLoop(delay=0.02, frequency=tuple(np.geomspace(0.05, 0.5, 60)))
    assert words in criterion.rate(narrow).remark
    if not isinstance(criterion, criteria.ActuatorOnset):
        assert "extended" not in criterion.rate(AttitudeLoop(delay=0.02)).remark
        assert "continued" not in criterion.rate(AttitudeLoop(delay=0.02)).remark


def test_a_faster_scale_asks_for_more():
    """A hundredth of the length asks for ten times the frequency, and a tenth of the delay."""
    loop = AttitudeLoop(delay=0.02)
    for one in (
        criteria.DisturbanceRejection(axis="lat"),
        criteria.AttitudeBandwidth(axis="lat"),
        criteria.AttitudeQuickness(axis="lat"),
    ):
        near, far = one.rate(loop), replace(one, scale=100.0).rate(loop)
        if one.name != "attitude_quickness":  # it looks for a tenth of the time
            assert near.figures == far.figures
        assert far.distance < near.distance


def test_a_limit_is_met_from_its_side():
    more, less = Limit(6.0, 3.0), Limit(5.0, 8.0)
    assert [more.distance(x) for x in (9.0, 6.0, 3.0, 0.0)] == [1.0, 0.0, -1.0, -2.0]
    assert [less.distance(x) for x in (2.0, 5.0, 8.0, 11.0)] == [1.0, 0.0, -1.0, -2.0]
    border = Border((0.0, 1.0), (2.0, 4.0), (1.0, 2.0))
    assert border.distance(3.0, 0.5) == 0.0
    assert border.distance(1.5, 0.5) == -1.0
    assert border.distance(4.0, 7.0) == 0.0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Limit(3.0, 3.0), "can't end at the same value, 3"),
        (lambda: Limit(np.inf, 3.0), "finite"),
        (lambda: Border((0.0, 1.0), (2.0, 1.0), (1.0, 1.0)), "above that of Level 2"),
        (lambda: Border((1.0, 1.0), (2.0, 2.0), (1.0, 1.0)), "increasing"),
        (lambda: criteria.StabilityMargins(axis="rol"), "did you mean roll"),
        (lambda: criteria.AttitudeBandwidth(axis="lat", task="otter"), "did you mean other"),
        (lambda: criteria.AttitudeBandwidth(axis="col"), "no bandwidth of heave"),
        (lambda: criteria.AttitudeQuickness(axis="col"), "no quickness of heave"),
        (lambda: criteria.NicholsExclusion(axis="lat", shape="disk"), "hexagon, ellipse"),
        (lambda: criteria.Coupling(axis="ped"), "give another axis as `onto`"),
        (lambda: criteria.StabilityMargins(axis="lat", scale=0.0), "above 0"),
    ],
)
def test_what_cannot_be_asked_is_said(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_an_axis_answers_to_both_of_its_names():
    assert criteria.StabilityMargins(axis="roll") == criteria.StabilityMargins(axis="lat")
    with pytest.raises(UnknownNameError):
        criteria.Damping(axis="everything")


def test_coupling_is_looked_at_for_a_scaled_time():
    """Four seconds of a helicopter are 1.2 s of one a tenth as long."""
    asked = []

    class Watched(AttitudeLoop):
        def step(self, axis, *, size, duration):
            asked.append(duration)
            return super().step(axis, size=size, duration=duration)

    for scale in (1.0, 10.0):
        criteria.Coupling(axis="lat", scale=scale).rate(Watched())
    assert asked == [4.0, pytest.approx(4.0 / np.sqrt(10.0))]


def test_an_own_criterion_needs_a_rate_and_a_chart():
    """A subclass of three names and two methods is rated like those of the house."""

    class Overshoot(Criterion):
        name, source = "overshoot", "this test"
        units = {"overshoot": ""}  # noqa: RUF012

        def rate(self, loop):
            angle = loop.step(self.axis, size=0.1, duration=5.0).signals["phi"]
            found = float(angle.max() / angle[-1] - 1.0)
            return self.rated({"overshoot": found}, [Limit(0.2, 0.4).distance(found)])

        def chart(self):
            raise NotImplementedError

    rating = Overshoot(axis="roll").rate(AttitudeLoop())
    assert rating.level == 1
    assert rating.figures["overshoot"] == pytest.approx(
        np.exp(-np.pi * 0.6 / 0.8), abs=0.03
    )  # of the 2nd order


LIMIT = Limit(0.0, 6.0)


def test_a_slow_load_turns_the_vehicle_as_a_spring_does():
    """Far below the bandwidth the angle is the load over the angle's gain: a servo's stiffness."""
    loop = AttitudeLoop(k=0.4)
    rating = LoadRejection(axis="lat", low=0.21, high=0.23, turned=LIMIT).rate(loop)
    # next is w k_rate / k of it in quadrature, 0.2 % at 0.21 rad/s: 0.02 dB
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(1.0 / 0.4), abs=0.02)


def test_a_loop_that_is_left_open_gives_way_as_the_vehicle_alone():
    """Angle over command is b / w^2 below the lag: the most at the slowest load."""
    loop = AttitudeLoop(k=0.0, k_rate=0.0, lag=0.0)
    rating = LoadRejection(axis="lat", low=2.0, high=10.0, turned=LIMIT).rate(loop)
    slowest = rating.figures["frequency"]
    assert 2.0 <= slowest < 2.05  # 400 points over two and a half decades are 1.7 % apart
    assert rating.figures["turned"] == pytest.approx(20.0 * np.log10(40.0 / slowest**2), rel=1e-12)
    assert rating.level == 3


def test_borders_of_a_smaller_vehicle_are_of_faster_loads():
    asked = LoadRejection(axis="roll", high=2.0, turned=LIMIT, by="pitch", scale=4.0)
    assert (asked.axis, asked.by, asked.band) == ("lat", "lon", (0.6, 4.0))
