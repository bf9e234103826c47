"""What records, simulated by scripts/proof/verdicts.py, say against a response."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import chirp, cont2discrete, lfilter

import helisim as hs
import script
from helisim.ident.evidence import _driven, _filled, _frozen, held, left_of  # noqa: F401  (rows name them)
from helisim.ident.feedback import _cells, _regressed  # noqa: F401  (rows name them)
from helisim.ident.response import opposes
from ident_data import record
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


# A roll of 90 / (s + 6) by SciPy, with what is wrong with it.

STEP = 0.01
TIME = np.arange(4000) * STEP


def swept(duration, seed=0):
    time = TIME[: round(duration / STEP)]
    fade = np.clip(np.minimum(time, time[-1] - time) / 2.0, 0.0, 0.1)
    band = np.array([0.8, 30.0]) / (2.0 * np.pi)
    return fade * chirp(time, band[0], duration, band[1], "logarithmic", phi=-90.0 - 37.0 * seed)


def rolled(lat, gain=90.0, damping=6.0):
    b, a, _ = cont2discrete(([gain], [1.0, damping]), STEP, "zoh")
    return lfilter(b.ravel(), a, lat)


def told(records, inputs="lat", band=(1.0, 25.0), **settings):
    frf = hs.frequency_response(records, inputs=inputs, outputs="p", band=band, **settings)
    return [(one.kind, one.text) for one in frf.evidence]


@tabled("share", "noise", "inputs", "percent")
def test_sides_count_of_inputs_that_make_a_tenth_of_an_output(share, noise, inputs, percent):
    """One side of lon does 0.7 of the other: 0.3 over the mean of 0.85. It has `share` of lat."""
    dice, records = np.random.default_rng(0), []
    for k in range(4):
        moves = [swept(40.0, k), 0.002 * dice.normal(size=TIME.size)]
        lat, lon = moves if k % 2 else moves[::-1]
        sides = np.where(lon > 0.0, lon, 0.7 * lon) * share**0.5 / 0.85
        p = rolled(lat + sides) + noise * dice.normal(size=TIME.size)
        records.append(record(STEP, lat=lat, lon=lon, p=p))
    given = dict(zip(("inputs", "conditioning"), inputs))
    said = [NUMBER.findall(text) for _, text in told(records, **given) if "of lon" in text]
    # a whole percent is said, which is 1.4 % of it at most; as much by noise, three deviations
    assert [float(one) for (one,) in said] == pytest.approx([percent] if percent else [], rel=0.06)


@tabled("change", "noise", "settings", "percent")
def test_a_response_that_changes_within_its_records_drifts(change, noise, settings, percent):
    """Gains 1 and 1 + c differ by c / (1 + c / 2) of their mean; each half has a sweep."""
    dice, records = np.random.default_rng(1), []
    for k in range(2):
        lat = np.tile(swept(20.0, k), 2)
        p = rolled(lat * np.where(TIME < 20.0, 1.0, 1.0 + change))
        p += noise * dice.normal(size=TIME.size)
        records.append(record(STEP, lat=lat, LAT=lat, p=p))
    said = [text for kind, text in told(records, **settings) if kind == "drift"]
    # a whole percent is said
    assert [float(NUMBER.findall(one)[0]) for one in said] == ([percent] if percent else [])


def test_an_input_that_a_hand_moves_is_no_controllers():
    """-40 / (s + 3) is a law's inverse as it looks, of proportional and derivative part."""
    lat = np.where(np.isin(TIME // 0.5 % 7, (1, 2, 4)), 0.1, 0.0) * np.sign(np.sin(TIME))
    for gain, kinds in ((-40.0, ["driven"]), (40.0, [])):
        p = rolled(lat, gain, 3.0) + 0.01 * np.random.default_rng(0).normal(size=TIME.size)
        assert [kind for kind, _ in told([record(STEP, lat=lat, p=p)])] == kinds


@tabled("moves", "rests", "swings", "holds", "takes", "is_")
def test_who_moves_an_input_is_told_by_what_rests(moves, rests, swings, holds, takes, is_):
    """Steps, or ramps of so many s, of u and y at 5, 10 and 15 s: the first is their whole motion.

    In a band from 1 to 25 rad/s half a period is 0.63 s; a ramp is seen for 0.15 and 0.5 of that.
    """
    u, y = (
        sum(size * np.clip((TIME - at) / max(s, STEP), 0.0, 1.0) for at, size, s in steps)
        for steps in (
            ((5.0, 1.0, 0.0), (10.0, -moves, takes[0]), (15.0, holds, 0.0)),
            ((5.0, 1.0, 0.0), (10.0, -rests, 0.0), (15.0, -swings, takes[1])),
        )
    )
    frf = SimpleNamespace(frequency=np.array([1.0, 25.0]), inputs=("lat",), outputs=("p",))
    assert len(list(_driven([record(STEP, lat=u, p=y)], frf))) == is_


@tabled("actuator", "noise", "said")
def test_play_is_told_from_a_dead_zone_and_both_from_chance(actuator, noise, said):
    dice, records = np.random.default_rng(3), []
    for k in range(2):
        lat = swept(40.0, k)
        p = rolled(actuator(lat)) + noise * dice.normal(size=TIME.size)
        records.append(record(STEP, lat=lat, p=p))
    assert [text[: len(said)] for _, text in told(records)] == [said] * bool(said)


@tabled("still", "moves", "is_")
def test_an_output_is_frozen_for_a_hundredth_while_inputs_move_by_a_fifth(still, moves, is_):
    p = np.random.default_rng(0).normal(size=TIME.size)
    p[2000 : 2000 + still] = 0.0
    lat = np.where(TIME < 10.0, 0.0, 1.0)
    lat[2000 : 2000 + still] = 1.0 - moves * np.linspace(0.0, 1.0, still)
    found = _frozen([record(STEP, lat=lat, p=p)], SimpleNamespace(outputs=("p",)), ("lat",))
    assert [one.kind for one in found] == ["frozen"] * is_


@tabled("every", "off", "changes", "late")
def test_an_output_that_was_logged_slower_is_late_by_half_its_step(every, off, changes, late):
    """Of held samples the newest is new and the oldest every - 1 steps old; `off` come later."""
    at = every * np.arange(1, changes + 1)
    at[: round(off * changes)] += 1
    p = np.zeros(every * (changes + 1))
    p[at] = np.random.default_rng(0).normal(size=changes)
    p = np.cumsum(p)
    flight = record(STEP, lat=np.zeros(p.size), p=p)
    found = _frozen([flight], SimpleNamespace(outputs=("p",)), ("lat",))
    said = [list(map(float, NUMBER.findall(one.text))) for one in found]
    assert said == ([[every, pytest.approx(late)]] if late else [])


@tabled("filled", "every", "top", "lack")
def test_a_column_that_lines_fill_lacks_what_they_do_not_reach(filled, every, top, lack):
    """Columns that are filled alike lack the same."""
    lat, ticks = swept(40.0), every * np.arange(1 + 4000 // every)
    columns = {"lat": lat, "p": np.roll(rolled(lat), 7)} | {
        name: np.interp(np.arange(4000), ticks[ticks < 4000] + shift, y[ticks[ticks < 4000]])
        for name, shift, y in (("lat", 0, lat), ("p", 2, rolled(lat)))
        if name in filled.split()
    }
    found = list(_filled([record(STEP, **columns)], ("lat", "p"), top))
    said = [(one.text.split()[0], *map(float, NUMBER.findall(one.text))) for one in found]
    assert said == ([(filled, every, pytest.approx(lack, rel=0.05))] if lack else [])


def noise(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@tabled("made", "wanted")
def test_parts_and_what_they_tell(made, wanted):
    assert made() == wanted
