"""What a notebook shows of a value: figures by `plot`, a page by `_repr_html_`."""

import copy
import gc
import pickle
import re
import subprocess
import sys
import weakref
from html.parser import HTMLParser

import browser
import numpy as np
import pytest
from matplotlib.figure import Figure

from helisim.base.errors import InputError, UnknownNameError
from helisim.records.record import CHANNELS, Channel, FlightRecord
from helisim.sim import Chirp, FlightPlan, Step, Sweep, Together
from made_run import make_flight, make_model, write_run


@pytest.fixture(scope="module")
def item():
    return make_model("rollpitch_in1", verified=True)


@pytest.fixture(scope="module")
def shown(item, jr700, tmp_path_factory):
    """One value of each class that a notebook shows as a page."""
    return {
        "record": make_flight(("LAT", "lat", "p", "q", "u"), vehicle="jr700", seed=3),
        "response": item.fit.data,
        "fit": item.fit,
        "verification": item.verification,
        "vehicle": jr700,
        "linearization": jr700.linearize(),
        "plan": FlightPlan(excitation=Sweep(axis="lat")),
        "results": write_run(tmp_path_factory.mktemp("run")),
    }


KINDS = (
    "record",
    "response",
    "fit",
    "verification",
    "vehicle",
    "linearization",
    "plan",
    "results",
)
PLOTTED = ("record", "response", "fit", "verification", "linearization")


def titles(figure):
    return [ax.get_title(loc="left") for ax in figure.axes]


def line(ax, label):
    return next(one for one in ax.lines if one.get_label() == label)


@pytest.mark.parametrize("kind", PLOTTED)
def test_a_plot_is_a_figure_that_leaves_nothing_behind(kind, shown):
    """A picture by itself; pyplot doesn't know of it, and it is gone with its last name."""
    import matplotlib.pyplot as plt  # python-control imports it in any case

    figure = shown[kind].plot()
    assert isinstance(figure, Figure)
    png, size = figure._repr_png_()
    assert png.startswith(b"\x89PNG")
    assert size["width"] > 300
    assert plt.get_fignums() == []
    kept = weakref.ref(figure)
    del figure
    gc.collect()
    assert kept() is None


def test_a_response_is_drawn_with_error_band_and_coherence(item):
    """The numbers of the response, in dB and degrees, for every pair."""
    data = item.fit.data
    figure = data.plot("p/lat")
    assert titles(figure) == ["magnitude, dB (SI)", "phase, deg", "coherence"]
    magnitude, phase, coherence = figure.axes
    o, i = data.index("p", "lat")
    drawn = line(magnitude, "flight data")
    np.testing.assert_allclose(drawn.get_xdata(), data.frequency)
    np.testing.assert_allclose(drawn.get_ydata(), 20 * np.log10(np.abs(data.response[o, i])))
    assert magnitude.collections  # the band of one random error
    np.testing.assert_allclose(line(coherence, "partial").get_ydata(), data.coherence[o, i])
    np.testing.assert_allclose(
        np.exp(1j * np.deg2rad(phase.lines[0].get_ydata())),
        data.response[o, i] / np.abs(data.response[o, i]),
    )
    assert len(data.plot().axes) == 3 * len(data.pairs)


def test_a_fit_is_drawn_with_data_model_and_residual(item):
    """What the model leaves of the data has a panel of its own."""
    figure = item.fit.plot(["p/lat", "q/lon"])
    assert len(figure.axes) == 10
    magnitude, rest = figure.axes[:2]
    model = line(magnitude, "identified").get_ydata()
    data = line(magnitude, "flight data").get_ydata()
    left = np.asarray(rest.lines[-2].get_ydata()) - np.asarray(rest.lines[-1].get_ydata())
    assert titles(figure)[1] == "magnitude less the identified, dB"
    np.testing.assert_allclose(np.abs(left), np.abs(data - model), atol=1e-9)  # rounding of dB


def test_a_verification_is_drawn_measured_and_predicted(item):
    """Inputs by their names, rates in degrees."""
    figure = item.verification.plot(0)
    assert titles(figure)[0] == "inputs, unitised"
    assert [one.get_label() for one in figure.axes[0].lines] == list(item.fit.structure.inputs)
    measured = line(figure.axes[1], "flight").get_ydata()
    trace = item.verification.traces[0]
    np.testing.assert_allclose(measured, np.rad2deg(trace.measured[:, 0]))


def test_a_record_is_drawn_by_kind_or_by_channel(shown):
    """All that was measured; or the named channels, a panel each."""
    record = shown["record"]
    assert titles(record.plot()) == [
        "sticks, unitised",
        "controls, unitised",
        "rates, deg/s",
        "velocity, m/s",
    ]
    figure = record.plot(["p", "u"])
    assert titles(figure) == ["p, deg/s", "u, m/s"]
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), record["u"])
    strange = FlightRecord(record.time, record.values, [Channel(n, "K", "OTHER") for n in "abcde"])
    assert titles(strange.plot()) == ["K", "K"]  # four lines in a panel are told apart


def test_axes_that_there_are_are_drawn_on(shown):
    """A panel each, and their own figure comes back; a wrong number is refused with the panels."""
    figure = Figure()
    axes = figure.subplots(2, 1)
    assert shown["record"].plot(["p", "q"], axes=axes) is figure
    assert titles(figure) == ["p, deg/s", "q, deg/s"]
    with pytest.raises(InputError, match="axes has 2 axes, and there are 3 panels to draw: magn"):
        shown["response"].plot("p/lat", axes=axes)


@pytest.mark.parametrize(
    ("kind", "choice", "error", "said"),
    [
        ("record", "x", UnknownNameError, "unknown channel 'x'; available: LAT"),
        ("record", [], InputError, "channels is empty"),
        ("fit", "p/ped", UnknownNameError, "unknown response 'p/ped'; available: p/lat"),
        ("response", [], InputError, "pairs is empty"),
        ("verification", 1, InputError, "there are records 0 to 0, got 1"),
    ],
)
def test_what_there_is_not_is_not_drawn(kind, choice, error, said, shown):
    """One line that says what there is."""
    with pytest.raises(error, match=said):
        shown[kind].plot(choice)


def test_a_figure_can_be_copied_and_pickled(shown):
    """As any matplotlib figure; it still shows itself."""
    figure = shown["record"].plot("p")
    for again in (pickle.loads(pickle.dumps(figure)), copy.deepcopy(figure)):
        assert again._repr_png_()[0].startswith(b"\x89PNG")


@pytest.mark.parametrize("kind", PLOTTED)
def test_a_notebook_shows_figures_and_pages(kind, shown):
    """By IPython's own formatter, as it comes, without its matplotlib mode."""
    from IPython.core.formatters import DisplayFormatter

    formats = DisplayFormatter()
    data, facts = formats.format(shown[kind].plot())
    assert data["image/png"].startswith(b"\x89PNG")
    assert facts["image/png"]["width"] > 300
    assert "text/html" in formats.format(shown[kind])[0]


class Balanced(HTMLParser):
    """Counts what is opened and closed."""

    EMPTY = ("br", "img")

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs):
        self.seen.append(tag)


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_whole_and_needs_nothing(kind, shown):
    """Every element is closed; nothing is fetched or run; both themes have their colours."""
    page = shown[kind]._repr_html_()
    found = Balanced()
    found.feed(page)
    assert not found.open
    assert not {"script", "link", "iframe"} & set(found.seen)
    assert not re.search(r"https?://|@import|url\(", page)
    assert "prefers-color-scheme: dark" in page
    assert '[data-jp-theme-light="false"] .helisim' in page
    assert len(page) < 400_000  # a notebook holds it in its file
    rules = re.sub(r"<style>|</style>", "", page[page.index("<style>") : page.index("</style>")])
    for rule in re.findall(
        r"^([^\s@/{][^{]*)\{", re.sub(r"/\*.*?\*/", "", rules, flags=re.S), re.M
    ):
        assert all(".helisim" in one for one in rule.split(",")), rule  # touches nothing else


def test_a_page_says_what_there_is(shown):
    """The numbers that one would ask for first."""
    assert "300 samples over 2.99 s; 100 Hz; vehicle jr700; seed 3" in shown["record"]._repr_html_()
    assert "L_b" in shown["fit"]._repr_html_()
    assert "Theil&#x27;s coefficient 0.051: acceptable" in shown["verification"]._repr_html_()
    assert "shaft power" in shown["vehicle"]._repr_html_()
    assert "Sweep(axis=" in shown["plan"]._repr_html_()
    assert "off" in shown["results"]._repr_html_() or "tolerances hold" in (
        shown["results"]._repr_html_()
    )


def test_a_plan_is_drawn_where_it_is_known():
    """What a manoeuvre adds, by place; not what a vehicle or a pilot has still to say."""
    known = FlightPlan(
        excitation=Together(
            parts=(
                Step(axis="lat", amplitude=0.1),
                Chirp(axis="r", at="sensors", amplitude=0.1, band=(1.0, 9.0)),
            )
        )
    )
    page = known._repr_html_()
    assert "lat at the sticks, unitised" in page
    assert "r at the sensors, rad/s" in page
    for excitation in (Step(axis="lat"), Sweep(axis="lat", amplitude=0.1, band=(1.0, 9.0))):
        assert "<svg" not in FlightPlan(excitation=excitation)._repr_html_()


def test_names_of_others_are_text():
    """A channel may be called anything: it is escaped, in figure and table."""
    record = FlightRecord(
        np.arange(10.0),
        np.arange(20.0).reshape(10, 2),
        (Channel("<b>&", "<i>", "OTHER", "</style><script>"), CHANNELS["p"]),
        {"vehicle": "<img src=x>"},
    )
    page = record._repr_html_()
    found = Balanced()
    found.feed(page)
    assert not found.open
    assert not {"b", "i", "script", "img"} & set(found.seen)
    assert "&lt;b&gt;&amp;" in page


def test_a_dollar_begins_no_formula(tmp_path):
    """In channels' names, which a title, a panel or a legend shows."""
    time = np.linspace(0.0, 1.0, 11)
    names = ("$x_1^{2$", "$y$")
    channels = tuple(Channel(name, "1", "IN1") for name in names)
    record = FlightRecord(time, np.column_stack([time, -time]), channels)
    for number, figure in enumerate((record.plot(), record.plot(names))):
        figure.savefig(tmp_path / f"{number}.svg")
        drawn = (tmp_path / f"{number}.svg").read_text(encoding="utf-8")
        assert "$x_1^{2$" in drawn


def test_showing_a_log_needs_no_simulator():
    """Neither MuJoCo nor the compiler is imported to draw a record."""
    code = (
        "import sys, numpy as np, helisim as hs\n"
        "from helisim.records.record import CHANNELS\n"
        "record = hs.FlightRecord(np.arange(9.0), np.ones((9, 1)), [CHANNELS['p']])\n"
        "assert 'matplotlib' not in sys.modules\n"
        "record._repr_html_()\n"
        "record.plot()\n"
        "print(*sorted({'mujoco', 'numba', 'rerun', 'pyarrow'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, ""), done.stderr


LOOK = "getComputedStyle(document.querySelector('{}')).{}"


@pytest.mark.slow
@pytest.mark.skipif(browser.find() is None, reason="no Chromium is installed")
def test_a_page_is_read_in_light_and_dark(shown, tmp_path):
    """In a page that says its theme it follows it, whatever the system has; nothing sticks out."""
    inner = shown["fit"]._repr_html_()
    with browser.Browser(tmp_path / "profile") as tab:
        for theme, system in (("true", "dark"), ("false", "light")):
            feature = {"name": "prefers-color-scheme", "value": system}
            tab.call("Emulation.setEmulatedMedia", features=[feature])
            path = tmp_path / f"{theme}.html"
            path.write_text(
                f'<!doctype html><meta charset="utf-8"><body data-jp-theme-light="{theme}">{inner}'
            )
            tab.open(path.as_uri(), 900)
            look = "getComputedStyle(document.querySelector('.helisim {}')).{}"
            paper = tab.evaluate(look.replace(" {}", "", 1).format("backgroundColor"))
            ink = tab.evaluate(look.format("td", "color"))
            bright = (
                sum(map(int, re.findall(r"\d+", paper))),
                sum(map(int, re.findall(r"\d+", ink))),
            )
            assert (bright[0] > bright[1] + 400) == (theme == "true"), (paper, ink)
            assert abs(bright[0] - bright[1]) > 400
            assert tab.evaluate("document.documentElement.scrollWidth") <= 900
        assert tab.complaints == []
