"""A proof: sweeps as large as stays linear, stops, comparisons, and what is missed."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import detrend
from small_design import PERIOD, SmallLaw, SmallPlant

import helisim as hs
from helisim.base.settings import to_plain
from helisim.design import proof
from helisim.design.exact import exact_loop, hands_off
from helisim.handling.closed_loop import ClosedLoop
from helisim.handling.criteria import Damping, StabilityMargins
from helisim.handling.measured.margins import MeasuredLoop
from helisim.handling.spec import Spec
from helisim.records.record import IN1, IN2
from helisim.sim import FlightPlan, Pilot, Pulse, Recorder, Weather
from own_laws import HOLDS
from tabled import tabled

TRUE = Recorder(noise={}, resolution={}, latency={})


@pytest.mark.parametrize("name", ["sticks_lat+lon", "sticks_ped"])
def test_a_sweep_reaches_its_limit_as_the_loop_does_tick_by_tick(jr700, name):
    """Of axes at once each its share, 1 / sqrt n of the first limit, or a half of the stick."""
    short = replace(proof.SWEEPS[name], period=8.0, duration=26.0, band=(4.0, 60.0))
    loop = exact_loop(hands_off(jr700).with_controller(HOLDS))
    wave, whole = proof.sweep(short, loop, jr700), loop._whole
    time = 0.002 * np.arange(10_000)  # 5 s at rest, most of a period until it is steady, and one
    sticks = wave.sticks(time)
    assert (wave.periods, wave.trim_time) == (2, 5.0)
    assert not sticks[time < 5.0].any()
    for axis, amplitude in zip(wave.axes, np.atleast_1d(wave.amplitude)):
        stick = axis.upper()
        moved = whole.select((stick,)).simulate(sticks[:, [IN2.index(stick)]])[6_000:]
        moved = detrend(moved, axis=0)  # speeds have not settled
        peaks = dict(zip(whole.outputs, np.abs(moved).max(axis=0)))
        turning = np.abs(np.diff(moved[:, [whole.outputs.index(one) for one in IN1]], axis=0))
        used = [peak / proof.LINEAR[one] for one, peak in peaks.items() if one in proof.LINEAR]
        used.append(turning.max() / 0.002 / (0.6 * jr700.parameters["servo.rate_limit"]))
        # 2 %: peaks between ticks, and what is left of the start
        share = max(*used, amplitude / 0.5 / np.sqrt(len(wave.axes)))
        assert share == pytest.approx(1.0 / np.sqrt(len(wave.axes)), rel=0.02)


@pytest.mark.parametrize(("turned", "size"), [(0.0, 0.3), (0.5, 0.3), (1.0, 0.25), (5.0, 0.05)])
def test_steps_turn_no_further_than_stays_linear(turned, size):
    """A quarter of a radian by the angle that is turned most, and 0.3 of the stick at most."""
    angles = {"phi": 0.3 * turned, "theta": -turned, "psi": 0.0}
    signals = {name: np.array([0.0, one, 0.1 * one]) for name, one in angles.items()}
    loop = SimpleNamespace(step=lambda axis, size, duration: SimpleNamespace(signals=signals))
    assert proof.step_size(loop, "lat") == pytest.approx(size, rel=1e-12)


def test_a_comparison_has_what_each_loop_says_and_why_one_says_nothing():
    specs = (Spec(StabilityMargins(axis="lat"), "hard"), Spec(Damping(low=2.0)))
    loop = ClosedLoop(SmallPlant(), SmallLaw().linear(PERIOD))
    table = proof.compare(specs, predicted=loop, exact=None, flown=MeasuredLoop((), (), 2))
    assert [one.predicted for one in table] == [one.criterion.rate(loop) for one in specs]
    assert [one.unknown for one in table] == [
        {"flown": "nothing was injected into lat at actuators; there is no cut"},
        {"flown": "responses that were measured have no poles"},
    ]
    first, _, last = table[0].to_dict()["figures"]
    known = {"predicted": table[0].predicted.figures["gain_margin"], "exact": None, "flown": None}
    assert first == {"name": "gain_margin", "unit": "dB", "level1": 6.0, "level2": 3.0} | known
    assert "level1" not in last


def test_what_is_at_its_stops_is_told(jr700):
    kick = Pulse(axis="ped", amplitude=0.5, trim_time=0.3, width=0.2, duration=2.0)
    plan = FlightPlan(excitation=kick, pilot=Pilot(remnant=0.0))
    assert proof.stops(hands_off(jr700), plan)["PED"] == pytest.approx(0.1, abs=0.005)
    calm = Pulse(axis="ped", amplitude=0.01, trim_time=0.3, width=0.2, duration=2.0)
    plan = FlightPlan(excitation=calm, pilot=Pilot(remnant=0.0))
    assert not proof.stops(hands_off(jr700), plan)


def test_the_usual_is_told_whether_asked_or_not():
    own = Spec(StabilityMargins(axis="lat", at="sensors"), "hard")
    found = proof.with_usual((own, Damping()), ("lat", "ped"))
    assert found[0] is own
    assert [one.kind for one in found] == ["hard"] + 6 * ["check"]
    assert sum(isinstance(one.criterion, StabilityMargins) for one in found) == 2


@pytest.fixture(scope="module")
def short(jr700):
    with pytest.MonkeyPatch.context() as patch:
        for name in ("actuators_ped", "sensors_ped"):
            few = {"period": 8.0, "duration": 26.0, "band": (4.0, 80.0)}
            patch.setitem(proof.SWEEPS, name, replace(proof.SWEEPS[name], **few))
        for name in proof.SWEEPS.keys() - {"actuators_ped", "sensors_ped"}:
            patch.delitem(proof.SWEEPS, name)
        plan = proof.ProofPlan(weather=Weather(), recorder=TRUE, repeats=1)
        return proof.prove(jr700, HOLDS, (Damping(),), plan=plan)


def test_a_short_proof_has_the_exact_figures_of_what_it_swept(short):
    off = {
        name: abs(flown.value / row.exact.figures[name] - 1.0)
        for row in short.table
        for name, flown in row.intervals.items()
        if name in ("crossover", "phase_margin", "drb")
    }
    assert off.keys() == {"crossover", "phase_margin", "drb"}
    assert max(off.values()) < 0.03
    whole, lat, *_ = short.table
    assert (whole.flown, lat.flown) == (None, None)
    assert whole.unknown == {"flown": "responses that were measured have no poles"}
    assert lat.unknown["flown"].startswith("nothing was injected into lat at actuators")
    assert [record.duration for (record,) in short.sweeps.values()] == [26.0, 26.0]
    asked = [one for one in short.table if one.spec.kind in ("hard", "soft")]
    level_1 = all((one.flown or one.exact).level == 1 for one in asked)
    assert short.to_dict()["met"] is level_1


def test_events_of_a_proof_are_steps_from_rest_and_one_gust_with_both_laws(short):
    for axis, angle in (("lat", "phi"), ("lon", "theta"), ("ped", "psi")):
        for events in (short.events, short.before):
            step = events[f"step_{axis}"]
            moved = np.abs(step[angle] - step[angle][0])
            assert step.duration == 4.0
            assert moved[step.time < 0.5].max() < 1e-3 < moved.max() < 0.3
    stick = short.events["step_ped"]["PED"]
    assert stick[-1] - stick[0] == pytest.approx(proof.step_size(short.exact, "ped"), rel=1e-3)
    gusts = [events["gust"] for events in (short.events, short.before)]
    north, east = (np.ptp(gusts[0][name]) for name in ("air_u", "air_v"))
    assert north == pytest.approx(6.0, rel=0.2)
    assert east == pytest.approx(6.0, rel=0.2)
    assert gusts[0].provenance["weather"] == gusts[1].provenance["weather"]
    assert np.abs(gusts[0]["phi"] - gusts[1]["phi"]).max() > 0.01  # by two laws


def test_a_proof_is_written_with_every_record(short, tmp_path):
    short.write(tmp_path)
    events = {f"{name}.parquet": one for name, one in short.events.items()}
    events |= {f"before_{name}.parquet": one for name, one in short.before.items()}
    events |= {f"{name}_0001.parquet": one for name, (one,) in short.sweeps.items()}
    assert {one.name for one in tmp_path.iterdir()} == {*events, "proof.json"}
    for name, one in events.items():
        np.testing.assert_array_equal(hs.read_record(tmp_path / name).values, one.values)
    assert json.loads((tmp_path / "proof.json").read_text())["stops"] == short.stops


def rated(level):
    return None if level is None else SimpleNamespace(level=level)


@tabled("kind", "flown", "exact", "said")
def test_hard_and_soft_specifications_are_held_against_flight_first(kind, flown, exact, said):
    spec = hs.Spec(hs.criteria.StabilityMargins(axis="lat"), kind)
    row = SimpleNamespace(spec=spec, flown=rated(flown), exact=rated(exact))
    misses = proof.Proof.misses.fget(SimpleNamespace(table=(row,)))
    assert misses == (() if said is None else (f"stability_margins of roll: {said}",))


def test_a_short_proof_is_as_kept(short, kept):
    kept([short.to_dict(), {name: to_plain(wave) for name, wave in proof.SWEEPS.items()}])
