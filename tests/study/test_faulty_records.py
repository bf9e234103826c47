"""From a faulty recorder to a model: what was left out is told, and what is found still holds."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from helisim import ident
from helisim.logs import screen
from helisim.sim import RecordGap, SampleLoss, Sweep, fly
from helisim.study.comparison import identify_model
from helisim.study.models import YAW_BASE

SWEEP = Sweep(axis="ped")
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


class Spikes:
    """Six samples a minute of rate and input are off by 0.5."""

    def apply(self, record, rng):
        values = record.values.copy()
        for name in ("r", "ped"):
            hit = rng.random(len(record)) < 0.001
            values[hit, record.names.index(name)] += rng.choice([-0.5, 0.5], hit.sum())
        return replace(record, values=values)


class Dead:
    """The yaw rate freezes for two seconds."""

    def apply(self, record, _):
        out = (record.time >= 40.0) & (record.time < 42.0)
        values = record.values.copy()
        values[out, record.names.index("r")] = record["r"][np.argmax(out) - 1]
        return replace(record, values=values)


SPIKES, DEAD = Spikes(), Dead()


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
    pairs = [(fit[name].value, one) for name, one in good.parameters.items()]
    return max(abs(value - one.value) / one.standard_error for value, one in pairs)


@pytest.mark.parametrize(
    ("faults", "noted", "errors"),
    [
        # single samples are interpolated: nothing of the sweep is lost
        pytest.param((SPIKES,), {"spikes"}, 0.2, marks=pytest.mark.slow),
        # a sweep that is cut loses frequencies, and what is left scatters by its own error
        ((SPIKES, DEAD, LOSS, GAP), {"spikes", "frozen", "gap"}, 2.0),
    ],
)
def test_a_screened_record_gives_the_model_that_it_should(
    jr700, flown, good, faults, noted, errors
):
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


def test_an_unscreened_record_misleads_and_says_so(flown, good):
    fit = identified(faulty(flown, SPIKES))
    assert shift(fit, good) > 5.0
    assert any("'r'" in flag for flag in fit.data.flags)
