"""The page of a design: every number of the proof on it, every chart, and nothing but itself."""

import re
from html.parser import HTMLParser
from types import SimpleNamespace

import browser
import numpy as np
import pytest
from rerun.chunk import RrdReader

from closed_loops import flown, known_loop
from helisim import margins
from helisim.base.settings import FrozenMap
from helisim.cli.design import record_gust
from helisim.design.design import DesignResult, Judged
from helisim.design.laws import AttitudeAxis, AttitudeCommand, YawAxis
from helisim.design.proof import Proof, ProofFlights, Stops, compare
from helisim.handling.criteria import (
    DisturbanceRejection,
    NicholsExclusion,
    StabilityMargins,
)
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.spec import Spec
from helisim.show.charts import draw_loops
from helisim.show.design_page import draw_step, write_design_page
from helisim.sim import Gust
from made_run import make_flight

OMEGA = np.geomspace(1.0, 60.0, 80)
SPECS = (
    Spec(StabilityMargins(axis="lat"), "hard"),
    Spec(NicholsExclusion(axis="lat"), "soft"),
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
    judged = tuple(
        Judged(
            spec,
            spec.criterion.rate(Roll(3.0)),
            spec.criterion.rate(Roll()),
            spec.criterion.rate(Roll(5.5)),
            0.5,
            (spec.criterion.rate(Roll(5.5)), spec.criterion.rate(Roll(4.5))),
        )
        for spec in SPECS
    )
    return DesignResult(
        before=law,
        law=law.replace({"lat.k_rate": 0.0625}),
        judged=judged,
        margin=0.1,
        share=0.5,
        drawn=2,
        provenance={"made_by": "<a test>"},
    )


@pytest.fixture(scope="module")
def proof():
    """Of the same, measured in noise, as if it were another loop."""
    measured = margins(flown(known_loop(), seed=3, noise=0.02), band=(4.0, 9.0), draws=10).loop
    table = compare(SPECS, predicted=Roll(), exact=Roll(5.1), flown=measured)
    step, gust = (make_flight(seed=k) for k in (1, 2))
    flights = ProofFlights(
        FrozenMap({}),
        FrozenMap({}),
        FrozenMap({"lat": step}),
        gust,
        gust,
        Stops({"lat": 0.125}, {"lat": 0.5}, 60.0),
    )
    before = FrozenMap({"step_lat": make_flight(seed=3), "gust": make_flight(seed=4)})
    return Proof(
        table=table,
        flights=flights,
        exact=Roll(5.1),
        measured=measured,
        predicted=Roll(),
        gust=Gust(north=3.0),
        before=before,
        remarks=("a remark & more",),
    )


class Cells(HTMLParser):
    """Rows of a page's tables as texts."""

    def __init__(self):
        super().__init__()
        self.rows, self._open = [], False

    def handle_starttag(self, tag, attributes):
        if tag == "tr":
            self.rows.append([])
        self._open = tag in ("td", "th")
        if self._open:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        self._open = self._open and tag not in ("td", "th")

    def handle_data(self, data):
        if self._open:
            self.rows[-1][-1] += data


def test_the_page_says_what_was_asked_predicted_exact_and_flown(proof, tmp_path):
    """Each figure of the proof with its numbers, degrees for people; what is missed is said."""
    path = write_design_page(tmp_path / "report.html", made_result(), proof=proof, before=Roll(3.0))
    text = path.read_text(encoding="utf-8")
    cells = Cells()
    cells.feed(text)
    rows = {row[0]: row[1:] for row in cells.rows}
    row = rows["roll: stability margins, phase margin"]
    compared = next(one for one in proof.table[0].figures if one.name == "phase_margin")
    assert row[:2] == ["deg", "45"]
    # of k / s e^-Ts: 90 deg less k T, at its crossover k
    for cell, gain in ((row[2], 3.0), (row[3], 5.0), (row[4], 5.1)):
        assert float(cell) == pytest.approx(90.0 - np.rad2deg(0.05 * gain), abs=0.1)
    assert float(row[5]) == pytest.approx(np.rad2deg(compared.flown.value), rel=0.01)
    assert "lat was at its stops 12 % of the time in rough air" in text
    assert "Level 1 in 50 % of the models drawn" in text
    assert "a remark &amp; more" in text
    assert "k_rate = 0.0625" in text
    assert "&lt;a test&gt;" in text
    assert not re.search(r'="[^"]*\bnan\b', text)


def test_the_page_has_every_figure(proof, tmp_path):
    """Charts, the loop over frequency and on a Nichols chart, step, gust."""
    path = write_design_page(tmp_path / "report.html", made_result(), proof=proof, before=Roll(3.0))
    names = re.findall(r'<figure id="(\w+)"', path.read_text(encoding="utf-8"))
    assert names == [
        "stability_margins_lat_actuators",
        "disturbance_rejection_lat",
        "loop_lat",
        "nichols_lat",
        "step_lat",
        "gust",
    ]


def test_a_design_that_did_not_fly_has_a_page(tmp_path):
    """Without anything of a flight."""
    text = write_design_page(tmp_path / "a.html", made_result(), predicted=Roll()).read_text()
    assert 'id="loop_lat"' in text
    assert "measured in flight" not in text
    assert 'id="numbers"' not in text


def test_a_loop_as_measured_has_bars_of_its_draws(proof):
    """They hold the curve, on the turn of the others, and reach as far as 95 % of the draws."""
    curve = proof.measured.measured("broken", "lat")
    drawing = draw_loops("a", "a", {"exact": Roll(5.1).broken("lat"), "flown": curve})
    for panel in drawing.panels:
        (bars,) = [mark for mark in panel.marks if mark.kind == "bars"]
        (dots,) = [mark for mark in panel.marks if mark.kind == "dots"]
        assert np.all(bars.y <= bars.top)
        inside = (bars.y <= dots.y) & (dots.y <= bars.top)
        assert np.mean(inside) > 0.9


def test_a_step_without_one_before_is_drawn_alone():
    drawing = draw_step("lat", None, make_flight(seed=1))
    assert [panel.label for panel in drawing.panels] == [
        "LAT, unitised",
        "phi, deg",
        "p, deg/s",
        "lat, unitised",
    ]
    assert [mark.label for mark in drawing.panels[0].marks] == ["designed"]


def test_a_design_is_plotted_and_shown_in_a_notebook():
    """All charts, also those of curves."""
    result = made_result()
    assert len(result.plot().axes) == 3
    assert "every hard and soft one keeps Level 1 in 50 %" in result._repr_html_()


def test_a_gust_before_and_after_is_one_recording(proof, jr700, tmp_path):
    """Both flights, each with the vehicle in a view of its own."""
    path = tmp_path / "gust.rrd"
    record_gust(SimpleNamespace(proof=proof, vehicle=jr700), path)
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    for name in ("shipped gyro", "designed law"):
        assert "/" + name.replace(" ", "\\ ") + "/attitudes" in entities


@pytest.mark.slow
@pytest.mark.skipif(browser.find() is None, reason="needs a Chromium")
def test_the_page_is_read_on_a_phone_and_fetches_nothing(proof, tmp_path):
    """No wider than the screen; no complaint."""
    path = write_design_page(tmp_path / "report.html", made_result(), proof=proof, before=Roll(3.0))
    with browser.Browser(tmp_path / "profile") as page:
        for width in (360, 1920):
            page.open(path.as_uri(), width)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.complaints == []
        assert [url for url in page.fetched if not url.startswith(("file:", "data:"))] == []
