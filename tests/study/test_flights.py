"""The experiment's flights: those that terminated early are left out, with the reason."""

from dataclasses import replace

import pytest

from helisim.base.errors import DivergedError
from helisim.records.record import AXES
from helisim.records.storage import read_record
from helisim.sim import Recorder, Sweep
from helisim.study import experiment
from helisim.study.experiment import fly_sweeps
from helisim.study.results import Exclusion

END = {"at": 12.5, "why": "the helicopter touched the ground", "state": [0.0]}


@pytest.fixture
def over(monkeypatch):
    """Let flights of these numbers be over, of sweeps that last 35 s: otherwise as flown."""

    def choose(*numbers):
        def ended(number, record):
            if number not in numbers:
                return record
            return replace(record, provenance={**record.provenance, "ended": END})

        def marked(vehicle, plan, which, then, **options):
            def do(number, record):
                return then(number, ended(number, record))

            return flown(vehicle, plan, which, do, **options)

        flown = experiment.fly_each
        monkeypatch.setattr(experiment, "fly_each", marked)
        monkeypatch.setattr(experiment, "Sweep", lambda axis: Sweep(axis=axis, duration=35.0))

    return choose


@pytest.mark.slow
def test_a_sweep_that_was_over_is_left_out(jr700, tmp_path, over):
    over(0)
    (tmp_path / "flights").mkdir()
    kept, excluded = fly_sweeps(jr700, 1, 1, 2, Recorder.of(jr700), tmp_path, lambda _: None)
    for axis in AXES:
        (record,) = kept[axis]
        assert record.provenance["flight"] == 1
        assert read_record(tmp_path / "flights" / f"{axis}_01.parquet").ended
    assert excluded == tuple(
        Exclusion(
            flight=f"{axis}_01",
            reason="terminated early",
            ended="the helicopter touched the ground at 12.50 s",
        )
        for axis in AXES
    )


def test_too_few_that_went_on_end_the_experiment(jr700, over):
    over(0, 1)
    with pytest.raises(DivergedError, match=r"2 of 2 sweeps of col .* ground at"):
        fly_sweeps(jr700, 1, 1, 2, Recorder.of(jr700), None, lambda _: None)
