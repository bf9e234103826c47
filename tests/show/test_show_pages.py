"""Pages of a run, of a fit and in a notebook: whole, escaped, and with the files' numbers."""

import json
import pickle
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from rerun.chunk import RrdReader

from closed_loops import flown, known_loop
from helisim import margins
from helisim.base.errors import InputError, StorageError
from helisim.cli.design import record_gust
from helisim.design.design import DesignResult, Judged
from helisim.design.laws import AttitudeAxis, AttitudeCommand, YawAxis
from helisim.design.proof import Proof, compare
from helisim.handling.criteria import Crossover, DisturbanceRejection, Limit, StabilityMargins
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.spec import Spec
from helisim.records.record import Channel, FlightRecord
from helisim.show import tables
from helisim.show.charts import draw_loops
from helisim.show.design_page import verdict, write_design_page
from helisim.show.report import write_fit_report, write_report
from helisim.show.table import as_text, common_form, number
from helisim.study.results import read_run
from html_page import Page
from made_run import make_flight, make_model, write_run
from tabled import tabled

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
    labels = ["magnitude, dB (SI)", "phase, deg", "coherence, usable from 0.6"]
    assert titles(figure) == labels
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


@tabled("kind", "choice", "error", "said")
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


# The page of a design: every number of the proof on it, every chart, and nothing but itself.

OMEGA = np.geomspace(1.0, 60.0, 80)
SPECS = (
    Spec(StabilityMargins(axis="lat"), "hard"),
    Spec(Crossover(axis="lat", frequency=Limit(4.0, 2.0)), "soft"),
    Spec(DisturbanceRejection(axis="lat"), "check"),
)


class Roll:
    """A loop k / s with a delay, of roll alone."""

    axes = ("lat",)

    def __init__(self, gain=5.0):
        self.gain = gain

    def broken(self, axis, at="actuators"):
        if axis != "lat":
            raise NoResponse(f"no loop of {axis}")
        return Curve(OMEGA, self.gain / (1j * OMEGA) * np.exp(-0.05j * OMEGA))

    def disturbance(self, axis):
        return Curve(OMEGA, 1.0 / (1.0 + self.broken(axis).response))


def made_result():
    """Return a made-up design: one law in two models, worse before."""
    axis = AttitudeAxis(stick=0.6, frequency=6.0, k_angle=0.6, k_rate=0.05)
    yaw = YawAxis(stick=3.0, frequency=8.0, k_angle=1.0, k_rate=0.2)
    law = AttitudeCommand(lat=axis, lon=axis, ped=yaw)
    judged = []
    for spec in SPECS:
        before, now, one, other = map(spec.criterion.rate, map(Roll, (3.0, 5.0, 5.5, 4.5)))
        judged.append(Judged(spec, before, now, one, 0.5, (one, other)))
    found = {"judged": tuple(judged), "margin": 0.1, "share": 0.5, "samples": 2}
    changed = law.replace({"lat.k_rate": 0.0625})
    return DesignResult(before=law, law=changed, **found, provenance={"made_by": "<a test>"})


@pytest.fixture(scope="module")
def proof():
    """Of the same, measured in noise, as if it were another loop."""
    measured = margins(flown(known_loop(), seed=3, noise=0.02), band=(4.0, 9.0), draws=10).loop
    table = compare(SPECS, predicted=Roll(), exact=Roll(5.1), flown=measured)
    names = ("step_lat", "gust")
    events, before = ({one: make_flight(seed=k) for one in names} for k in (1, 3))
    loops = {"exact": Roll(5.1), "measured": measured, "predicted": Roll()}
    told = {"stops": {"lat": 0.125}, "remarks": ("a remark & more",)}
    return Proof(table=table, sweeps={}, events=events, before=before, **loops, **told)


def test_a_level_worse_than_before_stands_in_the_table_also_where_it_was_not_asked():
    made = made_result()
    swapped = [replace(one, before=one.nominal, nominal=one.before) for one in made.judged]
    rows = tables.design(replace(made, judged=swapped)).rows
    assert {row[1]: row[7] for row in rows if row[1] in ("crossover", "DRB", "DRP")} == {
        "crossover": "2 (was 1)",  # 3 rad/s, Level 1 from 4
        "DRB": "1",
        "DRP": "1",
    }


def test_the_page_says_what_was_asked_predicted_exact_and_flown(proof, tmp_path):
    path = write_design_page(tmp_path / "report.html", made_result(), proof=proof, before=Roll(3.0))
    text = path.read_text(encoding="utf-8")
    wanted = ["roll", "stability margins", "phase margin"]
    (row,) = [row for row in Page(text).rows if row[:3] == wanted]
    compared = proof.table[0].intervals["phase_margin"]
    assert row[3:5] == ["deg", "45"]
    # of k / s e^-Ts: 90 deg less k T, at its crossover k
    for cell, gain in ((row[5], 3.0), (row[6], 5.0), (row[7], 5.1)):
        assert float(cell) == pytest.approx(90.0 - np.rad2deg(0.05 * gain), abs=0.1)
    assert float(row[8]) == pytest.approx(np.rad2deg(compared.value), rel=0.01)
    assert "lat was at its stops 12 % of the time in rough air" in text
    assert "Level 1 in 50 % of the sampled models" in text
    assert "a remark &amp; more" in text
    assert "k_rate = 0.0625" in text
    assert "&lt;a test&gt;" in text
    assert not re.search(r'="[^"]*\bnan\b', text)
    assert max(map(len, as_text(tables.proof(proof)).splitlines())) <= 80
    charts = ["stability_margins_lat_actuators", "crossover_lat_actuators"]
    charts += ["disturbance_rejection_lat", "loop_lat", "step_lat", "gust"]
    assert Page(text).figures == charts


def test_what_is_worse_than_before_is_said_first():
    """As flown where it flew, else as predicted; what was as bad before is not worse."""

    def made(level, before):
        said = {"name": "attitude_quickness", "word": "roll", "axis": "lat"}
        rated = SimpleNamespace(level=level, criterion=SimpleNamespace(**said, at=None))
        was = None if before is None else SimpleNamespace(level=before)
        return SimpleNamespace(nominal=rated, before=was, spec=SimpleNamespace(kind="shown"))

    def text(*judged):
        return verdict(SimpleNamespace(judged=judged, share=1.0, samples=2), None)

    assert text(made(3, 1)).startswith(
        "Worse than with the law before: roll attitude quickness Level 3 (was 1). 0 of 0"
    )
    assert "Worse" not in text(made(3, 3), made(1, 2), made(3, None))


def test_a_design_that_did_not_fly_has_a_page_and_is_shown(tmp_path):
    text = write_design_page(tmp_path / "a.html", made_result(), predicted=Roll()).read_text()
    assert 'id="loop_lat"' in text
    assert 'id="numbers"' not in text
    result = made_result()
    assert len(result.plot().axes) == 3
    assert "Level 1 in 50 % of 2 sampled models" in result._repr_html_()


def test_a_loop_as_measured_has_bars_of_its_draws(proof):
    """They hold the curve, on the turn of the others, and reach as far as 95 % of the draws."""
    curve = proof.measured.broken("lat")
    drawing = draw_loops("a", "a", {"exact": Roll(5.1).broken("lat"), "flown": curve})
    for panel in drawing.panels:
        (bars,) = [mark for mark in panel.marks if mark.kind == "bars"]
        (dots,) = [mark for mark in panel.marks if mark.kind == "dots"]
        assert np.all(bars.y <= bars.top)
        inside = (bars.y <= dots.y) & (dots.y <= bars.top)
        assert np.mean(inside) > 0.9


def test_a_gust_before_and_after_is_one_recording(proof, jr700, tmp_path):
    path = tmp_path / "gust.rrd"
    record_gust(SimpleNamespace(proof=proof, vehicle=jr700), path)
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    for name in ("shipped gyro", "designed law"):
        assert "/" + name.replace(" ", "\\ ") + "/attitude" in entities
