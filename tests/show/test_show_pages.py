"""Pages of a run, of a fit and in a notebook: whole, escaped, and with the files' numbers."""

import json
import pickle
import re
import shutil

import numpy as np
import pytest
from matplotlib.figure import Figure

from helisim.base.errors import InputError, StorageError, UnknownNameError
from helisim.records.record import Channel, FlightRecord
from helisim.show.report import write_fit_report, write_report
from helisim.show.table import common_form, number
from helisim.study.results import read_run
from html_page import Page
from made_run import make_flight, make_model, write_run

PAIRS = ("w_col", "p_lat", "p_lon", "q_lat", "q_lon")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("run")
    write_run(made)
    write_report(made)
    return made


@pytest.fixture(scope="module")
def page(folder) -> Page:
    return Page((folder / "report.html").read_text())


def test_every_number_is_that_of_the_results(folder, page):
    results = json.loads((folder / "results.json").read_text())
    for table in results["tables"]:
        for row in table["parameters"]:
            values = [row[name] for name in ("paper", "truth", "identified")]
            texts = [number(value, common_form(values)) for value in values]
            (found,) = [one for one in page.rows if one[:5] == [row["name"], row["unit"], *texts]]
            assert found[5] == number(row["standard_error"], ".2g")
            assert found[9:] == [row["support"], "agrees"]
    found = {row[0]: row for row in reversed(page.rows) if row}
    assert found["L_b"][8] == "14"  # Table 3: 13.9 %
    assert found["l_f"][2] == "1.332"
    assert found["m"][2:4] == ["8.01", "8.01"]
    text = (folder / "report.html").read_text()
    for said in (
        "Z_w: within 3 % of the truth (for the test)",
        "-0.12 dB at 20 rad/s",
        "flight lat_01: its mean coherence",
        'id="errata"',
        "Seed 7",
        "4.0.0",
        "a note with &lt; and &amp;",
    ):
        assert said in text


def test_the_page_has_every_figure_needs_nothing_else_and_runs_nothing(folder, page):
    expected = {f"bode_heave_{PAIRS[0]}", *(f"bode_rollpitch_in1_{pair}" for pair in PAIRS[1:])}
    expected |= {"sweep_lat", "sweep_col", "time_rollpitch_in1_1"}
    assert sorted(page.figures) == sorted(expected)
    files = {path.stem: path.suffix for path in (folder / "figures").iterdir()}
    assert files == dict.fromkeys(expected, ".svg")
    assert read_run(folder).sweeps["lat"].provenance["flight"] == "lat_02"  # lat_01 was left out
    assert all(address.startswith(("data:", "#")) for address in page.addresses)
    assert not {"script", "iframe", "object"} & page.seen
    before = (folder / "report.html").read_bytes()
    assert b"default-src 'none'" in before
    write_report(folder)
    assert (folder / "report.html").read_bytes() == before


def test_a_run_with_tables_alone_has_a_report(folder, tmp_path):
    with pytest.raises(StorageError, match=r"has no results\.json"):
        write_report(tmp_path)
    shutil.copy(folder / "results.json", tmp_path)
    page = Page(write_report(tmp_path).read_text())
    assert "Z_w" in {row[0] for row in page.rows}
    assert page.figures == []
    (tmp_path / "results.json").write_text('{"tables": []}')
    with pytest.raises(InputError, match="not the results of a run"):
        write_report(tmp_path)


def test_anyones_fit_has_a_report(tmp_path):
    item = make_model("heave")
    drawn = []
    flights = {"one": make_flight()}
    path = tmp_path / "fit.html"
    write_fit_report(path, item.fit, records=flights, on_progress=drawn.append)
    assert drawn == ["one"]
    page = Page(path.read_text())
    values = {row[0]: row[2] for row in reversed(page.rows) if len(row) > 2}
    for name, value in item.fit.values.items():
        assert values[name] == number(value)
    assert page.figures == ["bode_heave_w_col", "flight_0"]


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """One value of each class that a notebook shows as a page."""
    item = make_model("rollpitch_in1", verified=True)
    return {
        "record": make_flight(("LAT", "lat", "p", "q", "u"), vehicle="jr700", seed=3),
        "response": item.fit.data,
        "fit": item.fit,
        "verification": item.verification,
        "results": write_run(tmp_path_factory.mktemp("run")),
    }


def titles(figure):
    return [ax.get_title(loc="left") for ax in figure.axes]


def line(ax, label):
    return next(one for one in ax.lines if one.get_label() == label)


def test_each_value_is_drawn_as_it_is_and_leaves_nothing_behind(shown):
    import matplotlib.pyplot as plt  # python-control imports it in any case

    figure = shown["record"].plot("p")
    assert isinstance(figure, Figure)
    again = pickle.loads(pickle.dumps(figure))
    assert again._repr_png_().startswith(b"\x89PNG")
    assert plt.get_fignums() == []
    data = shown["response"]
    figure = data.plot("p/lat")
    assert titles(figure) == ["magnitude, dB (SI)", "phase, deg", "coherence"]
    magnitude, phase, coherence = figure.axes
    pair = data.index("p", "lat")
    drawn = line(magnitude, "flight data")
    np.testing.assert_allclose(drawn.get_ydata(), 20 * np.log10(np.abs(data.response[pair])))
    np.testing.assert_allclose(line(coherence, "partial").get_ydata(), data.coherence[pair])
    turn = np.exp(1j * np.deg2rad(phase.lines[0].get_ydata()))
    np.testing.assert_allclose(turn, data.response[pair] / np.abs(data.response[pair]))
    assert len(data.plot().axes) == 3 * len(data.pairs)
    assert len(shown["fit"].plot(["p/lat", "q/lon"]).axes) == 10
    verification, record = shown["verification"], shown["record"]
    figure = verification.plot()
    assert [one.get_label() for one in figure.axes[0].lines] == list(verification.inputs)
    measured = line(figure.axes[1], "flight").get_ydata()
    np.testing.assert_allclose(measured, np.rad2deg(verification.traces[0].measured[:, 0]))
    families = ["sticks, unitised", "controls, unitised", "rates, deg/s", "velocity, m/s"]
    assert titles(record.plot()) == families
    figure = record.plot(["p", "u"])
    np.testing.assert_allclose(figure.axes[1].lines[0].get_ydata(), record["u"])


@pytest.mark.parametrize(
    ("kind", "choice", "error", "said"),
    [
        ("record", "x", UnknownNameError, "unknown channel 'x'; available: LAT"),
        ("record", [], InputError, "channels is empty"),
        ("fit", "p/ped", UnknownNameError, "unknown response 'p/ped'; available: p/lat"),
    ],
)
def test_what_there_is_not_is_not_drawn(kind, choice, error, said, shown):
    with pytest.raises(error, match=said):
        shown[kind].plot(choice)


def test_a_notebooks_pages_are_whole_and_need_nothing(shown):
    pages = {kind: value._repr_html_() for kind, value in shown.items()}
    for text in pages.values():
        assert not {"script", "link", "iframe"} & Page(text).seen
        assert not re.search(r"https?://(?!www.w3.org/2000/svg)|@import|url\(", text)
        assert len(text) < 400_000  # a notebook holds it in its file
    assert "300 samples over 2.99 s; vehicle jr700; seed 3" in pages["record"]
    assert "L_b" in pages["fit"]
    assert "Theil&#x27;s coefficient 0.051: acceptable" in pages["verification"]
    assert "tolerances hold" in pages["results"]


def test_names_of_others_are_text(tmp_path):
    names = ("<b>&", "$x_1^{2$")
    channels = (Channel(names[0], "<i>", "OTHER", "</style><script>"), Channel(names[1], "1", "X"))
    values = np.arange(20.0).reshape(10, 2)
    record = FlightRecord(np.arange(10.0), values, channels, {"vehicle": "<img src=x>"})
    page = record._repr_html_()
    assert not {"b", "i", "script", "img"} & Page(page).seen
    assert "&lt;b&gt;&amp;" in page
    record.plot().savefig(tmp_path / "a.svg")
    assert "$x_1^{2$" in (tmp_path / "a.svg").read_text(encoding="utf-8")
