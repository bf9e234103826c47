"""Damaged flights are not called sound; undamaged ones are, and are right."""

import pytest

import script

proof = script.loaded("proof/verdicts")


@pytest.mark.parametrize(
    "damage",
    [
        *("saturates at half", "p and q swapped", "lat and lon swapped", "servo lag, quiet"),
        *("two trims", "clock 10 % fast", "rates in deg/s, no attitude"),
        *("16 % lost in bursts, filled", "2 % dropped, restamped"),
    ],
)
def test_a_damaged_flight_is_not_sound(damage):
    truth = proof.TRUTHS["rollpitch"]
    assert proof.judged(truth, proof.DAMAGES[damage](truth, 3)).word in ("doubtful", "wrong")


@pytest.mark.parametrize("name", ["rollpitch", "yaw", "heave", "ship"])
def test_a_clean_flight_is_sound_and_right(name):
    found = proof.judged(proof.TRUTHS[name], proof.flights(proof.TRUTHS[name], 5))
    assert found.word == "sound"
    assert found.errors < proof.ERRORS
