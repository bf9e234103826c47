"""What records, simulated by scripts/proof/verdicts.py, say against a response."""

import re
from dataclasses import replace

import numpy as np
import pytest

import helisim as hs
import script
from helisim.ident.response import opposes
from tabled import tabled

verdicts = script.loaded("proof/verdicts")
TRUTH = replace(verdicts.TRUTHS["rollpitch"], length=24.0, band=(1.0, 40.0))
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")


@pytest.mark.filterwarnings("ignore:record")
@tabled("damage", "kinds", "said")
def test_what_records_say_against_a_response(damage, kinds, said):
    """Numbers within 3 %, three stated errors of the slopes; what is said is of the truth."""
    records = verdicts.DAMAGES.get(damage, verdicts.flights)(TRUTH, 3)
    names = {"inputs": ("lat", "lon"), "outputs": ("p", "q")}
    found = hs.frequency_response(records, band=TRUTH.band, **names).evidence
    assert [one.kind for one in found] == kinds.split()
    text = found[0].text if found else ""
    assert NUMBER.sub("N", text) == NUMBER.sub("N", said)
    numbers = [list(map(float, NUMBER.findall(one))) for one in (text, said)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.03)


@tabled("rate", "is_")
def test_a_controllers_inverse_is_told_from_a_vehicle(rate, is_):
    s = 1j * np.geomspace(0.8, 30.0, 60)
    assert opposes(s.imag, rate(s)) is is_
