import math

import pytest

from helisim.base.errors import InputError
from helisim.handling.chart import Chart, ChartAxis, ChartLine, Region

INF = math.inf
BANDWIDTH = ChartAxis("bandwidth", "bandwidth", "rad/s", 0.0, 5.0)
DELAY = ChartAxis("phase_delay", "phase delay", "s", 0.0, 0.4)


def slanted():
    """A chart of two levels: open to the right, their border from (1, 0) to (3, 0.2) and on."""
    first = Region(1, [1.0, INF, INF, 3.0], [0.0, 0.0, 0.2, 0.2])
    second = Region(2, [-INF, 1.0, 3.0, INF, INF, -INF], [0.0, 0.0, 0.2, 0.2, INF, INF])
    return Chart("two levels", BANDWIDTH, DELAY, (first, second))


def test_a_place_has_the_level_of_the_region_around_it():
    """Also far beyond the axes, and on both sides of a slanted border."""
    chart = slanted()
    assert chart.level_at(1e4, 0.1) == 1
    assert chart.level_at(2.01, 0.1) == 1
    assert chart.level_at(1.99, 0.1) == 2
    assert chart.level_at(1e4, 0.21) == 2
    assert chart.level_at(2.0, -0.1) is None


def test_straight_is_as_drawn():
    """The middle of an edge from 1 to 100 is 10 on a logarithmic axis, 50.5 on a linear one."""
    corners = ([1.0, 100.0, 100.0], [0.0, 0.4, 0.0])
    for logarithmic, middle in ((True, 10.0), (False, 50.5)):
        axis = ChartAxis("w", "w", "rad/s", 1.0, 100.0, logarithmic)
        chart = Chart("edge", axis, DELAY, (Region(1, *corners),))
        assert chart.level_at(1.01 * middle, 0.2) == 1
        assert chart.level_at(0.99 * middle, 0.2) is None


def test_the_worse_level_holds_where_regions_overlap():
    axis = ChartAxis("zeta", "damping ratio", "1", 0.0, 1.0)
    square, height = [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]
    strips = (Region(1, [0.3, INF, INF, 0.3], height), Region(3, square, height))
    whole = Chart("strip", axis, None, strips)
    assert whole.level_at(0.5) == 3
    assert whole.level_at(1.5) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ChartAxis("x", "x", "dB", 3.0, 1.0), "from 3 to 1: not in order"),
        (lambda: ChartAxis("x", "x", "rad/s", 0.0, 1.0, True), "starts at 0"),
        (lambda: Region(4, [0, 1, 1], [0, 0, 1]), "level 4: there are levels 1, 2 and 3"),
        (lambda: Region(1, [0, 1], [0, 0]), "3 points or more"),
        (lambda: ChartLine([0, 1, 2], [0, 0]), "as many across as up"),
        (lambda: ChartLine([0, math.nan], [0, 0]), "not a number"),
    ],
)
def test_what_is_no_chart_is_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
