"""Figures: ticks that people read, data that nothing hides, colours that are seen."""

import itertools
import re
from xml.etree import ElementTree

import numpy as np
import pytest

from helisim.show.canvas import to_png
from helisim.show.figure import DARK, LIGHT, Drawing, Mark, Panel, Scale, extent, outline
from helisim.show.plots import draw_pair, draw_verifications, pairs_of
from made_run import make_model

X = np.linspace(0.0, 1.0, 5)


@pytest.mark.parametrize(
    ("low", "high", "most", "steps", "texts"),
    [
        (-0.3, 0.9, 3, (), ["0.0", "0.5"]),
        (-0.45, 0.45, 3, (), ["\u22120.4", "0.0", "0.4"]),
        (-0.1, 0.2, 6, (), ["\u22120.1", "0.0", "0.1", "0.2"]),
        (
            -200.0,
            10.0,
            6,
            (15.0, 45.0, 90.0),
            ["\u2212180", "\u2212135", "\u221290", "\u221245", "0"],
        ),
        (1.0, 1.0001, 3, (15.0,), ["1.00000", "1.00005", "1.00010"]),
        (-1e-9, 1e-9, 3, (), ["\u22121e\u221209", "0", "1e\u221209"]),
        (0.0, 3e6, 4, (), ["0", "1e+06", "2e+06", "3e+06"]),
    ],
)
def test_ticks_are_round_numbers(low, high, most, steps, texts):
    """1, 2 or 5 times a power of ten, or the steps that are asked for; a plain zero."""
    scale = Scale.of(low, high, most=most, steps=steps)
    assert list(scale.texts) == texts
    assert low - 1e-9 * (high - low) <= scale.ticks[0] < scale.ticks[-1]
    assert scale.ticks[-1] <= high + 1e-9 * (high - low)


def test_every_range_has_two_ticks_and_few():
    """Over ten decades, wherever the range lies, and no two read the same."""
    rng = np.random.default_rng(1)
    for _ in range(2000):
        low = rng.normal() * 10.0 ** rng.uniform(-3.0, 3.0)
        high = low + 10.0 ** rng.uniform(-5.0, 5.0)
        scale = Scale.of(low, high, most=4)
        assert 2 <= len(scale.ticks) <= 6
        assert len(set(scale.texts)) == len(scale.texts)


def test_what_rounding_left_of_a_constant_is_no_range():
    """A trace of 0.1 and 0.1 + 2e-17 is drawn as a constant, and nothing at all as zero."""
    low, high = extent([np.array([0.1, 0.1 + 2.776e-17])])
    assert (low, high) == pytest.approx((0.09, 0.11))
    assert extent([np.full(3, np.nan)]) == (-1.0, 1.0)


def test_a_thinned_history_has_the_same_outline():
    """No column of it lost its lowest or highest sample; a single spike is still there."""
    time = np.linspace(0.0, 90.0, 9001)
    values = np.sin(time**2)
    values[4321] = 7.0
    x, y = outline(time, values, 700)
    assert len(x) <= 2 * 700 + 2
    assert np.all(np.diff(x) > 0.0)
    ends = np.linspace(0, 9001, 701).astype(int)
    for start, stop in itertools.pairwise(ends):
        inside = y[(x >= time[start]) & (x <= time[stop - 1])]
        piece = values[start:stop]
        assert (inside.min(), inside.max()) == (piece.min(), piece.max())
    assert y.max() == 7.0
    short, _ = outline(time[:100], values[:100], 700)
    assert len(short) == 100


def drawings() -> list[Drawing]:
    item = make_model("rollpitch_in1", verified=True)
    return [*(draw_pair(item, *pair) for pair in pairs_of(item.fit)), *draw_verifications(item)]


def test_a_file_is_plain_svg_that_other_programs_read():
    """Well formed, with title, literal colours and nothing that an editor may not know."""
    for drawing in drawings():
        root = ElementTree.fromstring(drawing.svg.encode())
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert root[0].text == drawing.title
        assert "var(" not in drawing.svg
        assert not re.search(
            "nan|inf[^o]",
            re.sub("<(title|desc|style|text).*?</.*?>", "", drawing.svg, flags=re.DOTALL),
        )
        ElementTree.fromstring(drawing.inline)
        assert "id=" not in drawing.inline  # those of several in a page would meet


def test_lines_lie_on_wider_data():
    """What was measured is drawn first and wider than what explains it: seen on both sides."""
    compared = 0
    for drawing in drawings():
        for panel in drawing.panels:
            labels = [mark.label for mark in panel.marks]
            measured = {"flight data", "flight"} & set(labels)
            if not measured:
                continue
            alone = Drawing("a", "", "", (panel,), "x", logarithmic=drawing.logarithmic)
            found = re.findall(r'class="(\w+ \w+)" stroke-width="([\d.]+)"', alone.inline)
            widths = {style: float(width) for style, width in found}
            data = widths.get("dots data") or widths["line data"]
            model = next(k for k, label in enumerate(labels) if label.startswith("identified"))
            assert labels.index(measured.pop()) < model
            assert data > 2.0 * widths["line identified"]
            compared += 1
    assert compared == 4 + 2  # pairs of the model, outputs of the verified flight


def test_what_a_prediction_leaves_is_drawn():
    """Below each output is flight less model, of the numbers that are drawn above it."""
    (drawing,) = [one for one in drawings() if one.name.startswith("time")]
    labels = [panel.label for panel in drawing.panels]
    assert "p, flight less model, deg/s" in labels
    k = labels.index("p, flight less model, deg/s")
    flight, model = drawing.panels[k - 1].marks
    np.testing.assert_array_equal(drawing.panels[k].marks[0].y, flight.y - model.y)


def test_the_difference_panel_is_the_estimate_less_the_model():
    """Band, points and truth, each less the identified curve; the curve itself is zero."""
    drawing = drawings()[0]
    above, apart = drawing.panels[:2]
    assert apart.label == "magnitude less the identified, dB"
    (dots,) = [mark for mark in above.marks if mark.kind == "dots"]
    (model,) = [mark for mark in above.marks if mark.ink == "identified"]
    (less,) = [mark for mark in apart.marks if mark.kind == "dots"]
    there = np.isin(model.x, less.x)
    np.testing.assert_allclose(less.y, dots.y[np.isin(dots.x, less.x)] - model.y[there], atol=1e-9)
    (zero,) = [mark for mark in apart.marks if mark.ink == "identified"]
    np.testing.assert_array_equal(zero.y, 0.0)


def luminance(colour: str) -> float:
    """Relative luminance by WCAG 2.2."""
    channels = [int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return float(np.dot((0.2126, 0.7152, 0.0722), linear))


@pytest.mark.parametrize("colours", [LIGHT, DARK], ids=["light", "dark"])
def test_words_and_lines_are_seen_on_their_paper(colours):
    """WCAG 2.2 AA: a contrast of 4.5 for words (1.4.3) and 3 for graphics (1.4.11)."""

    def contrast(name: str, ground: str) -> float:
        bright, dim = sorted((luminance(colours[name]), luminance(colours[ground])), reverse=True)
        return (bright + 0.05) / (dim + 0.05)

    levels = ("level1", "level2", "level3")
    for ground in ("paper", "unused", *levels):
        for name in ("ink", "soft"):
            assert contrast(name, ground) >= 4.5, name
    for ground in levels:  # what is lighter, such as "data", has a halo of paper there
        for name in ("identified", "truth", "third", "fourth", "grey"):
            assert contrast(name, ground) >= 3.0, name
    for name in ("data", "identified", "truth", "third", "fourth", "grey", "frame"):
        assert contrast(name, "paper") >= 3.0, name


def test_a_figure_of_a_constant_or_of_nothing_is_drawn():
    """Neither a flat line nor a gap breaks it."""
    flat = Mark("line", "identified", X, np.zeros(5), label="flat")
    gap = Mark("line", "data", X, np.array([1.0, np.nan, np.nan, 2.0, 3.0]))
    drawing = Drawing("a", "a & b", "<c>", (Panel("y", (flat, gap), 50.0),), "x")
    assert "a &amp; b" in drawing.svg
    assert drawing.svg.count('class="line data"') == 1
    assert to_png(drawing).startswith(b"\x89PNG")
