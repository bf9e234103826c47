"""The page of a design: every number of the proof on it, every chart, and nothing but itself."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from closed_loops import flown, known_loop
from helisim import margins
from helisim.cli.design import record_gust
from helisim.design.design import DesignResult, Judged
from helisim.design.laws import AttitudeAxis, AttitudeCommand, YawAxis
from helisim.design.proof import Proof, compare
from helisim.handling.criteria import Crossover, DisturbanceRejection, Limit, StabilityMargins
from helisim.handling.loop import Curve, NoResponse
from helisim.handling.spec import Spec
from helisim.show import tables
from helisim.show.charts import draw_loops
from helisim.show.design_page import verdict, write_design_page
from helisim.show.table import as_text
from html_page import Page
from made_run import make_flight

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
    found = {"judged": tuple(judged), "margin": 0.1, "share": 0.5, "drawn": 2}
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
    assert "Level 1 in 50 % of the models drawn" in text
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
        return verdict(SimpleNamespace(judged=judged, share=1.0, drawn=2), None)

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
    assert "Level 1 in 50 % of 2 models drawn" in result._repr_html_()


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
