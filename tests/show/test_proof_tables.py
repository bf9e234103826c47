"""The tables of a proof: numbers in degrees and SI, of what is there; a gust before and after."""

from types import SimpleNamespace

import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.design.proof import ComparedCriterion, ComparedFigure, Deviation, Stops, deviations
from helisim.handling.criteria import Limit, StabilityMargins
from helisim.handling.measured.interval import Interval
from helisim.handling.spec import Spec
from helisim.records.record import CHANNELS, FlightRecord
from helisim.show import tables
from helisim.show.table import as_text


def test_figures_stand_side_by_side():
    """The phase margin in degrees, to two digits of its interval; a dash where nobody knows."""
    limit = Limit(np.pi / 4.0, np.pi / 8.0)
    flown = Interval(1.0, 0.99, 1.01)
    figures = (
        ComparedFigure("phase_margin", "rad", limit, None, 1.002, flown),
        ComparedFigure("crossover", "rad/s", None, 10.0, 10.1, None),
    )
    row = ComparedCriterion(Spec(StabilityMargins(axis="lat")), figures, None, None, None, None, {})
    stops = Stops({"PED": 0.1}, {"lat": 0.123}, 60.0)
    proof = SimpleNamespace(table=(row,), flights=SimpleNamespace(stops=stops))
    lines = as_text(tables.proof(proof)).splitlines()
    words = next(line for line in lines if "phase" in line).split()
    assert words == [
        "roll",
        "phase",
        "margin",
        "45",
        "-",
        "57.4",
        "-",
        "57.3",
        "56.7",
        "57.9",
        "deg",
    ]
    assert "at its stops in rough air: PED 10 %" in lines
    assert not any("crossover" in line for line in lines)  # no border, not flown


def test_a_gust_is_told_before_and_after():
    """Peak and rms of each angle, degrees."""
    angles = {"phi": Deviation(np.deg2rad(2.0), np.deg2rad(0.5))}
    text = as_text(tables.gust(SimpleNamespace(gust_deviations={"before": angles, "law": angles})))
    assert text.count("0.5") == 2
    assert "with the law" in text


def test_a_deviation_is_from_where_the_angle_was():
    """A step of 0.1 rad at 1 s, on top of a trim angle: peak and rms are 0.1."""
    time = np.arange(300) / 100.0
    step = 0.3 + 0.1 * (time >= 1.0)
    values = np.column_stack([step, -step, 0.0 * time])
    record = FlightRecord(time, values, tuple(CHANNELS[n] for n in ("phi", "theta", "psi")), {})
    found = deviations(record, 1.0)
    assert found["phi"].peak == pytest.approx(0.1, rel=1e-12)
    assert found["theta"].rms == pytest.approx(0.1, rel=1e-12)
    assert found["psi"].peak == 0.0
    with pytest.raises(InputError, match="an event at 5 s needs a record"):
        deviations(record, 5.0)
