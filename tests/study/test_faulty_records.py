"""From a faulty recorder to a model: what was left out is told, and what is found still holds."""

import warnings

import numpy as np
import pytest

from helisim import ident
from helisim.cli import main
from helisim.logs import screen
from helisim.sim import (
    ClockDrift,
    FlightPlan,
    RecordGap,
    SampleLoss,
    SensorDropout,
    SensorSpikes,
    Sweep,
    fly,
)
from helisim.study.comparison import identify_model
from helisim.study.models import YAW_BASE

SWEEP = Sweep(axis="ped")
SPIKES = SensorSpikes(channels=("r", "ped"), size=0.5)
DEAD = SensorDropout(channels="r", at=40.0, lasts=2.0)
LOSS = SampleLoss(share=0.01)
GAP = RecordGap(at=55.0, lasts=1.0)
REPAIR = ("spikes", "frozen", "gaps")
LONG_ENOUGH = 22.0
"""s: two windows of a period of the band's lowest frequency, 0.6 rad/s."""


def identified(records):
    """Return the yaw base model of records, as the paper's experiment finds it."""
    with warnings.catch_warnings():
        for expected in (ident.RecordQualityWarning, ident.ClosedLoopWarning):
            warnings.simplefilter("ignore", expected)
        return identify_model(YAW_BASE, {"ped": records})


@pytest.fixture(scope="module")
def flown(jr700):
    return fly(jr700, SWEEP, count=2, seed=1)


@pytest.fixture(scope="module")
def good(flown):
    return identified(flown)


def faulty(flown, *faults):
    """Return the same flights as a faulty recorder would have written them."""
    records = []
    for number, record in enumerate(flown):
        for fault in faults:
            record = fault.apply(record, np.random.default_rng(number))
        records.append(record)
    return records


def shift(fit, good):
    """Return the greatest difference of a parameter, in the second fit's standard errors."""
    return max(
        abs(fit[name].value - good[name].value) / good[name].standard_error
        for name in good.parameters
    )


@pytest.mark.parametrize(
    ("faults", "noted", "errors"),
    [
        # single samples are interpolated: nothing of the sweep is lost
        ((SPIKES,), {"spikes"}, 0.2),
        ((LOSS,), {"lost samples"}, 0.2),
        # a sweep that is cut loses frequencies, and what is left scatters by its own error
        ((DEAD,), {"frozen", "gap"}, 2.0),
        ((GAP,), {"gap"}, 2.0),
        ((SPIKES, DEAD, LOSS, GAP), {"spikes", "frozen", "lost samples", "gap"}, 2.0),
    ],
    ids=["spikes", "lost samples", "dead sensor", "gap", "all"],
)
def test_a_screened_record_gives_the_model_that_it_should(
    jr700, flown, good, faults, noted, errors
):
    """What was left out is told, and each parameter moves by no more than its stated error."""
    logs = [
        screen(record, resample_hz=100.0, repair=REPAIR, min_duration=LONG_ENOUGH)
        for record in faulty(flown, *faults)
    ]
    for log in logs:
        assert {one.kind for one in log.report.repairs} - {"short part"} == noted
    fit = identified([record for log in logs for record in log.records])
    assert fit.data.flags == ()
    assert shift(good, fit) < errors
    truth = {**jr700.derivatives, "tau_r_base": 0.0505}
    for name, one in fit.parameters.items():
        assert abs(one.value - truth[name]) < one.cramer_rao


@pytest.mark.parametrize(("fault", "errors"), [(SPIKES, 5.0), (DEAD, 1.5)])
def test_an_unscreened_record_misleads_and_says_so(flown, good, fault, errors):
    """Left in, the same samples move the parameters by errors, and the estimate is flagged."""
    fit = identified(faulty(flown, fault))
    assert shift(fit, good) > errors
    assert any("'r'" in flag for flag in fit.data.flags)


def test_a_drifting_clock_is_told_and_its_effect_is_small(jr700, flown, good):
    """At 2000 ppm, far beyond a quartz, the yaw model moves by less than its error."""
    drift = ClockDrift(ppm=2000.0)
    fit = identified(faulty(flown, drift))
    assert shift(fit, good) < 1.0
    # a lateral sweep turns the helicopter enough to tell
    rolling = fly(jr700, FlightPlan(excitation=Sweep(axis="lat"), faults=[drift]), seed=1)[0]
    (finding,) = screen(rolling).report.findings
    assert finding.kind == "clock"
    assert "clock is fast" in finding.text


def test_the_command_line_tells_what_it_left_out(tmp_path, capsys):
    """`fly --fault`, then `identify --repair`: each fault in a line, and in the model's file."""
    path, model = tmp_path / "ped.parquet", tmp_path / "model.json"
    given = ["--fault", "r:spikes,size=2", "--fault", "recorder:loss,share=0.01"]
    assert main(["fly", "--axis", "ped", "--seed", "1", *given, "--out", str(path)]) == 0
    roles = ["--inputs", "ped", "--outputs", "r", "--conditioning", "v,col"]
    how = ["--band", "1", "20", "--resample", "100", "--repair", "spikes", "--quiet"]
    arguments = [str(path), "--structure", "yaw_base", *roles, *how, "--json", str(model)]
    assert main(["identify", *arguments]) == 0
    printed = capsys.readouterr().out
    assert "repaired: column 'r'" in printed
    assert "samples are spikes" in printed
    assert "samples were lost in" in printed
    assert '"kind": "spikes"' in model.read_text()
