"""Feedback without a recorded reference is seen where gusts go round it, and only there."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from helisim.cli import main
from helisim.ident import frequency_response
from helisim.ident.feedback import answered
from helisim.ident.frf import ClosedLoopWarning
from helisim.records.record import FlightRecord
from helisim.records.storage import write_record
from script import loaded

gusts = loaded("proof/gusts")
YAW = replace(gusts.TRUTHS["yaw"], length=60.0, count=2)


def test_gusts_that_go_round_a_loop_are_told_and_a_reference_ends_that():
    (records,) = gusts.fly(YAW, 0)
    direct = gusts.estimated(YAW, records, reference=False)
    assert direct.verdict.word != "sound"
    (note,) = [note for note in direct.verdict.reasons if note.kind == "feedback"]
    assert "comes back in ped" in note.text
    assert "record the sticks" in note.text
    joint = gusts.estimated(YAW, records, reference=True)
    assert joint.verdict.word == "sound", str(joint)
    for name, value in YAW.values.items():
        # three standard errors: one parameter in 370 is beyond
        assert abs(joint[name].value - value) < 3.0 * joint[name].standard_error


@pytest.mark.parametrize("change", [gusts.open_loop, gusts.calm])
def test_gusts_without_a_loop_and_a_loop_without_gusts_are_no_feedback(change):
    for seed in range(2):
        (records,) = gusts.fly(change(YAW), seed)
        frf = frequency_response(records, inputs="ped", outputs="r", band=(0.6, 25.0))
        assert frf.evidence == ()


@pytest.mark.parametrize("reference", [None, ("PED", "LAT")])
def test_the_answer_to_a_conditioning_input_is_no_feedback(reference):
    # a mode that rings for 3 s after a sweep of the other axis has passed it
    dice, step, records = np.random.default_rng(0), 0.02, []
    servo = cont2discrete(([30.0], [1.0, 30.0]), step, "zoh")
    own = cont2discrete(([60.0], [1.0, 1.5]), step, "zoh")
    ringing = cont2discrete(([200.0, 0.0], [1.0, 0.6, 9.0]), step, "zoh")
    every = round(step / gusts.FINE)
    for k in range(4):
        stick = 0.02 * gusts.sweeps(YAW, dice, 2)[::every]
        stick[:, k % 2] *= 50.0
        at = [lfilter(servo[0].ravel(), servo[1], one) for one in stick.T]
        r = sum(lfilter(b.ravel(), a, u) for (b, a, _), u in zip((own, ringing), at))
        columns = np.column_stack([*at, *stick.T, r + dice.normal(0.0, 0.01, len(r))])
        names = map(gusts._channel, ("ped", "lat", "PED", "LAT", "r"))
        records.append(FlightRecord(np.arange(len(r)) * step, columns, tuple(names)))
    frf = frequency_response(
        records,
        inputs="ped",
        conditioning="lat",
        outputs="r",
        band=(0.6, 25.0),
        reference=reference,
    )
    assert not [note for note in frf.evidence if note.kind == "feedback"]


def test_a_reference_that_answers_gusts_is_told():
    (records,) = gusts.fly(YAW, 0)
    assert records[0].names == ("ped", "PED", "r")
    # a pilot who closes the loop himself
    held = [replace(one, values=one.values[:, [0, 0, 2]]) for one in records]
    frf = frequency_response(held, inputs="ped", outputs="r", band=(0.6, 25.0), reference="PED")
    (note,) = frf.evidence
    assert note.kind == "feedback"
    assert "fly hands off" in note.text


def test_the_bias_that_noise_in_a_loop_makes_is_measured():
    # y = 2 u + v and u = r - v / 2, white: H = 2 + S_vu / S_uu of least squares
    dice = np.random.default_rng(0)
    count, step = 40_000, 0.05
    swept = np.where(np.arange(count) % 4000 < 1000, 1.0, 0.1)
    r, v = swept * dice.normal(size=count), 0.3 * dice.normal(size=count)
    u = r - 0.5 * v
    bias = -0.5 * 0.09 / np.mean(u**2)
    rest, made = (2.0 * u + v) - (2.0 + bias) * u, (2.0 + bias) * u
    found = answered([(u[:, None], rest[:, None], made[:, None])], [step], (1.0, 20.0), 1)
    assert np.mean(found.surprise) > 20.0
    # of 7 bands, with 5 % error each by `chance`
    size = np.sqrt(np.mean(found.bias - found.chance))
    assert size == pytest.approx(abs(bias) / (2.0 + bias), rel=0.2)
    noise = answered([(r[:, None], v[:, None], made[:, None])], [step], (1.0, 20.0), 1)
    assert np.mean(noise.surprise) < 3.0  # exponential: one of 7 in 10 million


@pytest.mark.slow
def test_intervals_of_joint_estimates_hold_an_unstable_hover_in_gusts():
    truth = gusts.TRUTHS["hover"]
    found = gusts.Counted.of(truth, gusts.fly(truth, 5, 12), reference=True)
    # of 60 intervals of 95 %, 51 hold the truth but for one time in 3000
    assert np.mean(found.inside) >= 0.85
    assert found.words.count("sound") >= 10
    direct = gusts.Counted.of(truth, gusts.fly(truth, 5, 12), reference=False)
    assert "sound" not in [word for word, bad in zip(direct.words, direct.harmful(truth)) if bad]


def test_gusts_in_a_loop_leave_the_sticks_the_reference(tmp_path, capsys):
    """Gusts that come back are coherent with the input, and make the sticks look idle."""
    (records,) = gusts.fly(replace(YAW, gust=(2.4, 0.5, {"r": 1.0})), 0)
    logs = [str(write_record(one, tmp_path / f"{k}.parquet")) for k, one in enumerate(records)]
    with pytest.warns(ClosedLoopWarning):
        status = main(["identify", *logs, "--structure", "yaw_base", "--quiet"])
    said = capsys.readouterr().out
    assert "joint input-output" in said
    assert status != 1
