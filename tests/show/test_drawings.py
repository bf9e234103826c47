"""Drawings: ticks, phases on their turn, data that nothing hides, charts where levels are."""

import itertools
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.handling.criteria import Limit, Rating, StabilityMargins
from helisim.handling.spec import known_criteria
from helisim.ident import FrequencyResponse
from helisim.show import page, plots, tables
from helisim.show.canvas import to_figure
from helisim.show.charts import Shown, draw_chart
from helisim.show.figure import Drawing, Mark, Panel, Scale, extent, outline
from helisim.show.plots import beside, draw_bode, draw_pair, phase_degrees
from helisim.show.table import PERCENT, as_text, common_form, number, table  # noqa: F401  (rows name it)
from helisim.show.terminal import render_results
from helisim.study.comparison import ComparisonTable, ParameterRow
from helisim.study.results import Exclusion, Results
from made_run import make_model
from tabled import tabled

OMEGA = np.geomspace(0.3, 30.0, 200)
S = 1j * OMEGA
NEEDED = {
    "actuator_use": {"rate_limit": 5.0},
    "crossover": {"frequency": Limit(5.0, 3.0)},
    "load_rejection": {"high": 2.0, "turned": Limit(-6.0, 0.0)},
}


@pytest.fixture(scope="module")
def drawings() -> list[Drawing]:
    item = make_model("rollpitch_in1", verified=True)
    pairs = [draw_pair(item, *pair) for pair in plots.pairs_of(item.fit)]
    return [*pairs, *plots.draw_verifications("time", item.verification)]


@tabled("low", "high", "most", "steps", "texts")
def test_ticks_are_round_numbers(low, high, most, steps, texts):
    assert Scale.of(low, high, most=most, steps=steps).texts == texts


def test_every_range_has_two_ticks_and_few_and_a_constant_has_none():
    rng = np.random.default_rng(1)
    for _ in range(500):
        low = rng.normal() * 10.0 ** rng.uniform(-3.0, 3.0)
        scale = Scale.of(low, low + 10.0 ** rng.uniform(-5.0, 5.0), most=4)
        assert 2 <= len(set(scale.texts)) == len(scale.ticks) <= 8
    assert extent([np.array([0.1, 0.1 + 2.776e-17])]) == pytest.approx((0.09, 0.11))
    assert extent([np.full(3, np.nan)]) == (-1.0, 1.0)


def test_a_thinned_history_has_the_same_outline():
    time = np.linspace(0.0, 90.0, 9001)
    values = np.sin(time**2)
    values[4321] = 7.0
    x, y = outline(time, values, 700)
    assert len(x) <= 2 * 700 + 2
    ends = np.linspace(0, 9001, 701).astype(int)
    for start, stop in itertools.pairwise(ends):
        inside = y[(x >= time[start]) & (x <= time[stop - 1])]
        piece = values[start:stop]
        assert (inside.min(), inside.max()) == (piece.min(), piece.max())


@tabled("line", "starts", "ends")
def test_a_phase_starts_on_its_own_turn(line, starts, ends):
    """As one reads it in a book: no response starts at a turn more."""
    phase = phase_degrees(line)
    assert phase[[0, -1]] == pytest.approx([starts, ends], abs=2.0)  # the lag's 0.03 rad


def test_noise_below_the_coherent_band_moves_no_phase():
    random = np.random.default_rng(3)
    line, good = np.exp(-0.1 * S) / (S + 1.0), OMEGA > 1.0
    wound = line.copy()
    wound[~good] = np.exp(1j * random.uniform(-np.pi, np.pi, np.count_nonzero(~good)))
    shown = phase_degrees(wound, good)
    assert np.allclose(shown[good], phase_degrees(line)[good], atol=1e-9)
    # a model moves to the turn of the data, not the data to it
    model = beside(OMEGA, line, (OMEGA[good], shown[good] - 360.0))
    assert np.allclose(model, phase_degrees(line) - 360.0, atol=1e-9)


def test_bars_reach_two_random_errors():
    """A tenth of random error is bars of 20 %, and of 0.2 rad; an exact model leaves nothing."""
    lag = (1.0 / (S + 1.0))[None, None]
    one = FrequencyResponse.exact(OMEGA, lag, inputs=["lat"], outputs=["p"])
    data = replace(one, random_error=np.full((1, 1, OMEGA.size), 0.1))
    panels = draw_bode("", "p", "lat", data, identified=one).panels
    for panel, half in ((panels[0], 20.0 * np.log10(1.2)), (panels[2], np.rad2deg(0.2))):
        (bars,) = [mark for mark in panel.marks if mark.kind == "bars"]
        assert np.allclose(bars.top - bars.y, 2.0 * half)
    (dots,) = [mark for mark in panels[1].marks if mark.kind == "dots"]
    assert np.allclose(dots.y, 0.0)


def test_a_file_is_plain_svg_that_other_programs_read(drawings):
    for drawing in drawings:
        root = ElementTree.fromstring(drawing.svg.encode())
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert "var(" not in drawing.svg
        assert not re.search(r'="[^"]*(nan|inf\b)', drawing.svg)
        ElementTree.fromstring(drawing.inline)
    flat = Mark("line", "identified", OMEGA, np.zeros(200), label="flat")
    gap = Mark("line", "data", OMEGA, np.where(OMEGA > 1.0, OMEGA, np.nan))
    drawing = Drawing("a", "a & b", "<c>", (Panel("y", (flat, gap), 50.0),), "x")
    assert "a &amp; b" in drawing.svg
    assert to_figure([[drawing]])._repr_png_().startswith(b"\x89PNG")


def test_a_difference_is_drawn_of_the_numbers_above_it(drawings):
    above, apart = drawings[0].panels[:2]
    assert apart.label == "magnitude less the identified, dB"
    (dots,) = [mark for mark in above.marks if mark.kind == "dots"]
    (model,) = [mark for mark in above.marks if mark.ink == "identified"]
    (less,) = [mark for mark in apart.marks if mark.kind == "dots"]
    expected = dots.y - np.interp(np.log(dots.x), np.log(model.x), model.y)
    np.testing.assert_allclose(less.y, expected, atol=1e-9)
    (drawing,) = [one for one in drawings if one.name.startswith("time")]
    labels = [panel.label for panel in drawing.panels]
    k = labels.index("p, flight less model, deg/s")
    flight, model = drawing.panels[k - 1].marks
    np.testing.assert_array_equal(drawing.panels[k].marks[0].y, flight.y - model.y)


OURS = {  # other tests register their own
    name: kind for name, kind in known_criteria().items() if kind.__module__.startswith("helisim.")
}


@pytest.mark.parametrize("name", sorted(OURS))
def test_every_criterion_has_a_chart_with_its_levels(name):
    drawing = draw_chart(name, OURS[name](axis="lat", **NEEDED.get(name, {})))
    areas = drawing.panels[0].marks
    assert [area.kind for area in areas] == ["area"] * len(areas)
    assert [area.label for area in areas if area.label] == ["Level 1", "Level 2", "Level 3"]
    assert [area.ink for area in areas] == sorted(area.ink for area in areas)
    ElementTree.fromstring(drawing.svg.encode())
    assert not re.search(r'="[^"]*nan', drawing.svg)


def test_a_rating_lies_at_its_figures_or_widens_its_chart():
    criterion = StabilityMargins(axis="lat")
    figures = {"gain_margin": 8.0, "phase_margin": math.radians(50.0)}
    around = [{"gain_margin": 8.0 + k, "phase_margin": math.radians(50.0 - k)} for k in range(3)]
    one = Shown("flown", figures, around, {"phase_margin": (math.radians(48), math.radians(53))})
    *_, cloud, interval, point = draw_chart("a", criterion, [one]).panels[0].marks
    np.testing.assert_allclose((point.x, point.y), ([8.0], [50.0]))
    np.testing.assert_allclose(cloud.x, [8.0, 9.0, 10.0])
    np.testing.assert_allclose(cloud.y, [50.0, 49.0, 48.0])
    np.testing.assert_allclose(interval.y, [48.0, 53.0])
    assert (point.label, cloud.label) == ("flown", "")
    both = [
        Shown(name, {"gain_margin": gain, "phase_margin": 1.0})
        for name, gain in (("x", 99.0), ("y", math.inf), ("z", math.nan))
    ]
    drawing = draw_chart("a", StabilityMargins(axis="lat"), both)
    assert drawing.limits[1] == pytest.approx(99.0 + 0.1 * 2.0 * (6.0 - 3.0))  # of both levels
    (endless,) = [mark for mark in drawing.panels[0].marks if mark.label == "y"]
    assert endless.x[0] == drawing.limits[1]
    assert "z" not in {mark.label for mark in drawing.panels[0].marks}
    criterion = StabilityMargins(axis="lat")
    one = Rating(criterion, {"gain_margin": 8.0, "phase_margin": 1.0}, 1, 0.3)
    assert len(criterion.plot(one).axes) == 1
    figure = criterion.plot({"predicted": [one, one], "flown": one, "before": None})
    words = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert words == {"Level 1", "Level 2", "Level 3", "predicted", "flown"}
    with pytest.raises(InputError, match="expected ratings by stability_margins, got 3"):
        criterion.plot({"flown": [3]})


ROW = {"name": "L_b", "unit": "1/s^2", "identified": 541.2345, "truth": 539.5, "paper": 539.5}
ROW |= {"cr_percent": 3.14159, "insensitivity_percent": 0.987, "support": "good"}
ROW |= {"tolerance_percent": 3.0, "tolerance_reason": "asked for"}
TABLE = {"name": "rollpitch_in1", "input": "IN1", "cost": 1.2345, "band_rad_s": (3.0, 30.0)}


def make_row(**changes) -> ParameterRow:
    return ParameterRow(**{**ROW, **changes})


def make_table(*rows: ParameterRow) -> ComparisonTable:
    return ComparisonTable(**TABLE, parameters=rows)


@tabled("value", "form", "text")
def test_a_number_alone(value, form, text):
    assert number(value, form) == text


def test_a_rows_numbers_share_their_decimals():
    forms = {(0.0,): ".3f", (3602.6, 1.0): ".0f", (-0.05, None, math.inf): ".5f", (1e-7,): ".3e"}
    assert {values: common_form(values) for values in forms} == forms


def test_a_table_reads_as_expected_on_the_terminal_and_on_the_page():
    found = table("", "speed [m/s]|how<*", [("3", "a < b")])
    assert as_text(found).split() == ["speed", "m/s", "-----", "3"]
    text = page.table(found)
    assert ">speed, m/s</th>" in text
    assert "a &lt; b" in text
    assert page.table(table("", "a", [])) == ""
    unknown = {"truth": None, "paper": None, "tolerance_percent": None}
    shown = make_table(
        make_row(),
        make_row(name="tau_lon", unit="s", identified=-0.0085, truth=-0.0083, paper=None),
        make_row(name="bias", identified=1.0, cr_percent=None, support=None, **unknown),
    )
    assert as_text(tables.comparison(shown)).splitlines() == [
        "rollpitch_in1: from IN1, 3 to 30 rad/s, average cost 1.23",
        "parameter  unit   paper      truth  identified  s.e.  CR %  support  agreement",
        "-" * 78,
        "L_b        1/s^2  539.5      539.5       541.2     -   3.1  good     agrees",
        "tau_lon    s          -  -0.008300   -0.008500     -   3.1  good     agrees",
        "bias       1/s^2      -          -       1.000     -     -  -        not judged",
        "given: nothing",
    ]


def test_the_widest_table_fits_80_columns():
    found = {"identified": -0.00083456, "truth": -0.0008, "paper": -0.0008}
    bounds = {"cr_percent": float("inf"), "insensitivity_percent": 5e6, "support": "degenerate"}
    wide = make_row(name="tau_r_base", unit="rad/s^2", **found, **bounds, tolerance_percent=None)
    left = Exclusion(flight="lat_07", reason="less coherent", coherence=0.97123, limit=0.98, kept=3)
    ended = Exclusion(flight="lat_08", reason="terminated early", ended="flapping at 2.00 s " * 9)
    shown = (make_table(wide, make_row(identified=700.0)),)
    results = Results(tables=shown, seed=1, versions={}, excluded=(left, ended))
    assert "given:" not in render_results(results)
    text = render_results(results, verbose=True)
    assert "given: nothing" in text
    assert max(map(len, text.splitlines())) <= 80
    assert "Left out:\n- flight lat_07: its mean coherence of 0.9712 is not among the best" in text
    assert "1 missed:\n- rollpitch_in1: L_b is 700 1/s^2, 29.7 % from the truth's 539.5" in text
    assert not any(line.lstrip().startswith("%") for line in text.splitlines())
    good = Results(tables=(make_table(make_row()),), seed=1, versions={})
    assert render_results(good).endswith("All tolerances hold.")
    assert render_results(Results(tables=(), seed=1, versions={})) == ""
