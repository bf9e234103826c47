"""Unstable models against flights of them: the true one is acceptable, wrong ones are not.

The flights come from integrations of their own: the rig's exact discretisation of plant and
feedback, and the closed form of a plant of first order. What the errors must be is estimation
theory's closed form.
"""

import json
from dataclasses import asdict, replace
from functools import cache

import numpy as np
import pytest
from closed_loop import Aircraft
from fleet import FLEET

from helisim.base.errors import InputError
from helisim.ident import Structure, verify
from helisim.ident.verification import ACCEPTABLE_TIC, theil
from helisim.records.record import FlightRecord, channel
from helisim.study.results import IdentifiedModel
from ident_data import found as exactly
from tabled import tabled

UNSTABLE = ("blade_360", "lynx")


@cache
def aircraft(name: str) -> Aircraft:
    return FLEET[name]()


@cache
def flight(name: str) -> FlightRecord:
    one = aircraft(name)
    sweep = {**asdict(one.sweeps[0]), "duration": 24.0}
    return replace(one.rig, gust={}).fly(seed=5, **sweep)


def verified(name: str, **changes: float):
    one = aircraft(name)
    return verify(exactly(one.structure, **{**one.truth, **changes}), flight(name))


@pytest.mark.parametrize("name", UNSTABLE)
def test_the_true_model_of_an_unstable_aircraft_is_acceptable(name):
    """In closed loop it is predicted to the sensors' noise, which scatters J_rms by 2 %."""
    found = verified(name)
    noise = aircraft(name).rig.noise
    assert found.acceptable
    for output in found.outputs:
        assert 0.95 * noise[output] < found.j_rms_by_output[output] < 1.3 * noise[output]
    assert "unstable: its pole" in str(found)


def off_by_30_percent() -> dict[str, float]:
    truth = aircraft("blade_360").truth
    names = [name for name in truth if name != "tau"]
    return {name: (1.3, 0.7)[k % 2] * truth[name] for k, name in enumerate(names)}


@pytest.mark.parametrize(
    "changes", [off_by_30_percent(), {"tau": 0.0}], ids=["derivatives off by 30 %", "no delay"]
)
def test_a_wrong_model_of_an_unstable_aircraft_is_not_acceptable(changes):
    """However free the segments' initial states are; the Blade's delay is 40 ms."""
    found = verified("blade_360", **changes)
    assert not found.acceptable
    assert "above 0.25" in str(found)
    assert found.j_rms > 3.0 * verified("blade_360").j_rms


FREE = {"L_p": {"unit": "1/s", "start": 1.0}, "L_lat": {"unit": "1/s^2", "start": 1.0}}
MATRICES = {"F": {"p": {"p": "L_p"}}, "G": {"p": {"lat": "L_lat"}}, "H0": {"p": {"p": 1}}}
NAMES = {"name": "roll", "inputs": ["lat"], "outputs": ["p"], "states": ["p"]}
ROLL = Structure.from_dict({**NAMES, **MATRICES, "parameters": FREE})
STEP, GROWTH, EFFECT, NOISE = 0.02, 0.8, 5.0, 0.05


def rolled(samples: int, *, seed: int = 0, bias: float = 0.0, noise: float = NOISE) -> FlightRecord:
    """Fly p' = 0.8 p + 5 lat under lat = stick - 0.5 p, by the closed form of a linear input."""
    random = np.random.default_rng(seed)
    stick = np.repeat(random.normal(0.0, 0.3, samples // 25 + 1), 25)[:samples]
    transition = np.exp(GROWTH * STEP)
    held_for = (transition - 1.0) / GROWTH
    risen = (transition - 1.0 - GROWTH * STEP) / (GROWTH**2 * STEP)
    p, lat = np.zeros(samples), np.zeros(samples)
    for k in range(samples - 1):
        lat[k + 1] = stick[k] - 0.5 * p[k]
        rise = lat[k + 1] - lat[k]
        p[k + 1] = transition * p[k] + EFFECT * (held_for * lat[k] + risen * rise)
    p += bias + noise * random.standard_normal(samples)
    time = np.arange(samples) * STEP
    return FlightRecord(time, np.stack([lat, p], axis=1), (channel("lat"), channel("p")))


def roll(effect: float = EFFECT):
    return exactly(ROLL, L_p=GROWTH, L_lat=effect)


def test_the_exact_flight_is_predicted_and_a_gain_that_is_off_shows_as_its_share():
    found = verify(roll(), rolled(1500, bias=0.3, noise=0.0))
    assert found.j_rms < 1e-10
    assert found.traces[0].bias[0] == pytest.approx(0.3, abs=1e-9)
    assert found.approach.kind == "segments"
    assert found.approach.growth < 8.001  # three doublings
    assert np.max(np.diff(found.traces[0].starts)) <= 3.0 * np.log(2.0) / GROWTH + STEP
    found = verify(roll(effect=0.7 * EFFECT), rolled(3000, noise=0.0))
    assert found.tic == pytest.approx(0.3 / 1.7, rel=1e-3)


def test_numbers_that_are_estimated_do_not_shrink_the_error():
    """J_rms is the noise's also where each 10 samples give a state: of 9 degrees of freedom."""
    found = verify(roll(), rolled(20000), segment=0.2)
    assert found.approach.estimated == found.traces[0].estimated == 2000 + 1  # and a bias
    assert found.j_rms == pytest.approx(NOISE, rel=0.03)  # 20 000 samples scatter by 0.5 %


def test_the_states_of_segments_flatter_no_model():
    """A model on which the stick has no effect explains nothing, though its states follow p.

    Judged with them a model in segments of half a second would be acceptable.
    """
    found = verify(roll(effect=1e-9), rolled(3000, noise=0.0), segment=0.5)
    assert found.tic > 0.99
    (trace,) = found.traces
    mean = np.mean(trace.measured, axis=0)
    assert theil(trace.measured - mean, trace.predicted - mean) < ACCEPTABLE_TIC


def test_units_of_outputs_change_no_coefficient():
    """A second sensor of p, in a unit 1000 times smaller or larger: segments weigh it alike."""
    flown, random = rolled(3000, bias=0.1), np.random.default_rng(1)
    second = flown["p"] + NOISE * random.standard_normal(3000)
    found = []
    for unit in (1e-3, 1.0, 1e3):
        plain = {**ROLL.to_dict(), "outputs": ["p", "q"], "H0": [[1], [unit]]}
        plain = {key: x for key, x in plain.items() if key not in ("H1", "D")}
        both = exactly(Structure.from_dict(plain), L_p=GROWTH, L_lat=0.8 * EFFECT)
        values = np.column_stack([flown.values, unit * second])
        one = verify(both, FlightRecord(flown.time, values, (*flown.channels, channel("q"))))
        own = one.j_rms_by_output
        found.append([one.tic, *one.tic_by_output.values(), own["p"], own["q"] / unit])
    # rounding of the motions, which the gain of 8 of a segment and the projections amplify
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert found[2] == pytest.approx(found[1], rel=1e-6)


def test_what_was_done_is_in_text_and_json(tmp_path):
    found = verify(roll(), rolled(1500))
    text, plain = str(found), json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert "unstable: its pole 0.8 rad/s doubles an error in 0.866 s" in text
    assert "in segments of 2.5 s" in text
    assert max(map(len, text.splitlines())) <= 80
    assert plain["approach"]["doubling_s"] == pytest.approx(np.log(2.0) / GROWTH)
    assert plain["approach"]["message"] == str(found.approach)
    stored = IdentifiedModel("roll", roll(), verification=found).to_dict()
    again = IdentifiedModel.from_dict(json.loads(json.dumps(stored))).verification
    assert again == found
    assert str(again) == text


@tabled("options", "message")
def test_what_can_not_be_predicted_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        verify(roll(), rolled(1500), **options)
