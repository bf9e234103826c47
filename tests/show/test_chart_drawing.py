"""Charts of criteria: every level where the criterion says it is, every rating on its chart."""

import math
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.handling.chart import Chart, ChartAxis, ChartLine, Region
from helisim.handling.criteria import Limit, Rating, StabilityMargins
from helisim.handling.loop import Curve
from helisim.handling.spec import known_criteria
from helisim.show.canvas import to_png
from helisim.show.charts import Shown, clipped_line, clipped_polygon, draw_chart, inside

INF = math.inf
NEEDED = {
    "actuator_onset": {"rate_limit": 5.0},
    "actuator_use": {"rate_limit": 5.0},
    "crossover": {"frequency": Limit(5.0, 3.0)},
    "load_rejection": {"high": 2.0, "turned": Limit(-6.0, 0.0)},
}


def bandwidth():
    """A chart with a slanted border from (1, 0) to (3, 0.2) and on to the right."""
    across = ChartAxis("bandwidth", "bandwidth", "rad/s", 0.0, 5.0)
    up = ChartAxis("phase_delay", "phase delay", "s", 0.0, 0.4)
    first = Region(1, np.array([1.0, INF, INF, 3.0]), np.array([0.0, 0.0, 0.2, 0.2]))
    second = Region(
        2, np.array([-INF, 1.0, 3.0, INF, INF, -INF]), np.array([0.0, 0.0, 0.2, 0.2, INF, INF])
    )
    guide = ChartLine(np.array([0.0, 5.0]), np.array([0.1, 0.1]), "guide", boundary=False)
    return Chart("Bandwidth", across, up, (first, second), (guide,), "a source")


def at(bandwidth, delay):
    return {"bandwidth": bandwidth, "phase_delay": delay}


def level_drawn(drawing, x, y):
    """Return the ground that is seen at a place of a drawing: the last area that holds it."""
    (panel,) = drawing.panels
    place = np.array([[x, y]])
    grounds = [
        area.ground
        for area in panel.areas
        if len(area.x) and inside(np.stack([area.x, area.y], axis=-1), place)[0]
    ]
    return int(grounds[-1].removeprefix("level"))


def test_levels_are_drawn_where_the_chart_has_them():
    """Clipping to the frame, open sides and the unit for people change no level."""
    drawing = draw_chart("a", bandwidth(), [Shown("flown", at(9.0, 0.1))])
    rng = np.random.default_rng(1)
    for x, y in zip(rng.uniform(0.0, 9.0, 200), rng.uniform(0.0, 0.4, 200)):
        assert level_drawn(drawing, x, y) == bandwidth().level_at(x, y)


@pytest.mark.parametrize("name", sorted(known_criteria()))
def test_every_criterion_has_a_chart_that_is_drawn(name):
    """Levels 1 and 3 are in sight and named, and the figure is whole SVG."""
    kind = known_criteria()[name]
    if not kind.__module__.startswith("helisim."):
        pytest.skip("a criterion of another test")
    drawing = draw_chart(name, kind(axis="lat", **NEEDED.get(name, {})).chart())
    (panel,) = drawing.panels
    grounds = {area.ground for area in panel.areas}
    assert {"level1", "level3"} <= grounds
    assert "Level 1" in {area.label for area in panel.areas}
    ElementTree.fromstring(drawing.svg.encode())
    assert not re.search(r'="[^"]*nan', drawing.svg)


def test_a_rating_lies_at_its_figures():
    """Radians as degrees; the cloud below, the interval from end to end, the point on top."""
    criterion = StabilityMargins(axis="lat")
    figures = {"gain_margin": 8.0, "phase_margin": math.radians(50.0)}
    around = [{"gain_margin": 8.0 + k, "phase_margin": math.radians(50.0 - k)} for k in range(3)]
    one = Shown("flown", figures, around, {"phase_margin": (math.radians(48), math.radians(53))})
    drawing = draw_chart("a", criterion.chart(), [one])
    (panel,) = drawing.panels
    cloud, interval, point = panel.marks[-3:]
    np.testing.assert_allclose((point.x, point.y), ([8.0], [50.0]))
    np.testing.assert_allclose(cloud.x, [8.0, 9.0, 10.0])
    np.testing.assert_allclose(cloud.y, [50.0, 49.0, 48.0])
    np.testing.assert_allclose(interval.y, [48.0, 53.0])
    assert (point.label, cloud.label) == ("flown", "")


def test_what_lies_beyond_a_chart_widens_it_and_infinity_is_at_its_end():
    drawing = draw_chart("a", bandwidth(), [Shown("x", at(12.0, 0.1)), Shown("y", at(INF, 0.1))])
    low, high = drawing.limits
    assert low == 0.0
    assert 12.0 < high < 13.0
    (endless,) = [mark for mark in drawing.panels[0].marks if mark.label == "y"]
    assert endless.x[0] == pytest.approx(high)
    assert draw_chart("a", bandwidth()).limits == (0.0, 5.0)


def test_a_loop_crosses_its_chart_where_it_has_its_margin():
    """An integrator with a delay: at 0 dB it is 90 deg and the delay's phase below 0."""
    frequency = np.geomspace(0.1, 40.0, 400)
    curve = Curve(frequency, 5.0 / (1j * frequency) * np.exp(-0.1j * frequency))
    chart = known_criteria()["nichols_exclusion"](axis="lat").chart()
    drawing = draw_chart("a", chart, curves={"exact": [curve]})
    (line,) = [mark for mark in drawing.panels[0].marks if mark.label == "exact"]
    there = np.isfinite(line.y)
    order = np.argsort(line.y[there])
    phase = np.interp(0.0, line.y[there][order], line.x[there][order])
    assert phase == pytest.approx(-90.0 - math.degrees(0.5), abs=0.05)  # between its points


def test_ratings_are_plotted_one_several_or_by_label():
    """On axes of one's own too; what is no rating of the criterion is refused."""
    criterion = StabilityMargins(axis="lat")
    one = Rating(criterion, {"gain_margin": 8.0, "phase_margin": 1.0}, 1, 0.3)
    assert len(criterion.plot(one).axes) == 1
    figure = criterion.plot({"predicted": [one, one], "flown": one})
    words = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert words == {"predicted", "flown"}
    assert len(criterion.plot({"before": None, "flown": one}).axes) == 1
    assert criterion.plot(one, axes=figure.axes[0]) is figure
    with pytest.raises(InputError, match="expected ratings by stability_margins, got 3"):
        criterion.plot({"flown": [3]})
    with pytest.raises(InputError, match="no rating under 'flown'"):
        criterion.plot({"flown": []})


def test_a_polygon_is_cut_at_the_frame():
    """The area of a triangle, half of it outside: by the closed form."""
    corners = clipped_polygon(np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    x, y = corners.T
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    assert area == pytest.approx(0.75)  # a trapezium from 1/2 to 1
    assert len(clipped_polygon(corners + 2.0)) == 0


def test_a_line_is_cut_at_the_frame():
    """It leaves through the top, comes back, and has a gap between."""
    line = clipped_line(np.array([[0.0, 0.5], [0.5, 1.5], [1.0, 0.5], [INF, 0.5]]))
    np.testing.assert_allclose(
        line, [[0.0, 0.5], [0.25, 1.0], [np.nan, np.nan], [0.75, 1.0], [1.0, 0.5]], atol=1e-12
    )


def test_a_chart_is_a_picture_too():
    assert to_png(draw_chart("a", bandwidth(), [Shown("flown", at(2.0, 0.1))])).startswith(
        b"\x89PNG"
    )
