"""Everything public is a value: short in words, whole after a copy, equal where it is the same."""

import inspect
import multiprocessing
import pickle
import re
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace

import numpy as np
import pytest

import helisim as hs
from helisim.base.settings import FrozenMap, same
from helisim.design.design import Judged
from helisim.handling.measured.interval import Interval
from helisim.handling.measured.margins import Driven, MeasuredFigure, MeasuredLoop
from helisim.logs import Column
from helisim.logs.timing import Options
from helisim.look.sweeps import FlownSweep
from helisim.look.systemid import Inferred, InferredFit, InferredLog, TakenChannel
from helisim.sitl.parameters import Setting
from helisim.study.results import Run
from made_run import make_flight, make_model, write_run
from own_laws import HOLDS

LONGEST = 400
"""Characters of a `repr`: five lines of a terminal."""


def lagging_yaw(seen, state):
    state[0] += 0.1 * (seen.PED - state[0])
    return state[0] - 0.1 * seen.r


def make_design(law):
    spec = hs.standard("margins", axes=("lat",))[1]
    rating = spec.criterion.rated({"gain_margin": 9.0, "phase_margin": 1.0, "crossover": 12.0})
    judged = (Judged(spec, None, rating, rating, 1.0),)
    told = {"margin": 0.1, "share": 1.0, "samples": 200, "provenance": {"seed": 1}}
    return hs.DesignResult(before=law, law=law, judged=judged, **told)


def make_inferred():
    sweep = FlownSweep(12, 10.0, 70.0, 0.1, 2.0, 60.0, True, "complete")
    channel = TakenChannel("ped", Column("RATE.YOut", "1"), 400.0, "by name")
    parameters = FrozenMap({"H_SW_TYPE": 3.0})
    log = InferredLog("a.bin", "ArduCopter", True, (sweep,), (channel,), parameters, 0.0)
    fit = InferredFit("yaw_base", ("ped",), ("r",), (), ("mixer_yaw",), (2.0, 60.0), "yaw")
    return Inferred((log,), Options(200.0, (), 0.25), (fit,), ())


@pytest.fixture(scope="module")
def values(jr700, tmp_path_factory):
    item = make_model("rollpitch_in1", verified=True)
    results = write_run(tmp_path_factory.mktemp("run"))
    record, fit, roll = make_flight(seed=3), item.fit, hs.structures.rollpitch
    plan = hs.FlightPlan(
        excitation=hs.Sweep(axis="lat", band=(1.0, 20.0)),
        pilot=hs.Pilot(remnant=0.0),
        recorder=hs.Recorder.of(jr700),
        weather=hs.Weather(gust=hs.Gust(north=1.0)),
        ground=hs.Ground(deck=hs.Deck(heave=hs.Swing(amplitude=0.3))),
        faults=(hs.ServoStuck(servo="servo_tail", at=30.0),),
    )
    parts = (hs.Step(axis="lat"), hs.Step(axis="lon"))
    history = hs.History.of([0.0, 2.0], [0.0, 0.1], axis="lat")
    rates, matrices = hs.RateCommand.of(jr700), {"a": [[0.5]], "b": [[1.0]], "c": [[0.1]] * 4}
    cut = hs.Cut("roll", "sensors", "phi_disturbance", "phi_sum")
    driven = Driven("phi_disturbance", ("phi_sum",), [1.0, 2.0], [[0.1, 1.0j]], 0.01 * np.eye(2))
    figure = MeasuredFigure("DRP", "lat", "sensors", "dB", Interval(3.0, 2.5, 3.5))
    return (
        *(jr700, jr700.linearize(), jr700.linearize("IN2"), jr700.parameters, jr700.trim),
        *(plan, plan.excitation, plan.pilot, plan.recorder, plan.weather, plan.weather.gust),
        *(plan.ground, plan.ground.deck, plan.ground.deck.heave, plan.envelope, plan.faults[0]),
        *(hs.missions.Forward(speed=20.0), hs.Doublet(axis="ped"), hs.ThreeTwoOneOne(axis="lon")),
        *(parts[0], hs.Pulse(axis="lat"), hs.Multisine(amplitude=0.03, band=(1.0, 20.0))),
        hs.Chirp(axis="r", at="sensors", amplitude=0.1, band=(1.0, 20.0)),
        *(hs.Sequence(parts=parts), hs.Together(parts=parts), history),
        *(hs.FlightPlan(excitation=history), hs.Recorder(), hs.ProofPlan(repeats=2)),
        *(hs.Controller(tail=lagging_yaw, states=1), HOLDS, rates, rates.on(jr700)),
        hs.Rotorflight.of(jr700),
        hs.Seen(*(0.1 * number for number in range(len(hs.Seen._fields)))),
        hs.StateSpaceLaw(period=0.002, inputs=("p",), **matrices, d=[[0.2]] * 4),
        hs.Airframe(mass=4.2, rotor=1.35, rpm=2100.0),
        *(hs.SampleLoss(share=0.1), hs.RecordGap(at=3.0, lasts=1.0), hs.examples()["logger"]),
        *(record, hs.screen(record), hs.screen(record).report, make_inferred()),
        *(roll, roll.parameters[0], fit, fit.data, fit["L_b"], fit.residual, fit.modes),
        *(fit.modes.poles[0], item, item.verification, item.verification.figures),
        *(item.verification.traces[0], results, Run(results, (item,), {"lat": (record,)})),
        *(cut, hs.MeasuredMargins(MeasuredLoop((driven,), (cut,)), (figure,), ("short",))),
        *(hs.Plant((fit,), late={"p": 0.0035}), make_design(rates)),
        hs.ArduPilotModel({"Nr": -2.0, "Nped": 63.0}),
        hs.AutopilotParameters("jr700", {"hover": (Setting("H_COL_HOVER", 0.5),)}),
        hs.standard("disturbance_rejection", scale=10.7)[0],
        hs.criteria.AttitudeQuickness(axis="lat"),
        hs.criteria.Damping().rated({"damping": 0.5, "frequency": 7.0}),
    )


ABSTRACT = {"Excitation"}
"""Public classes without an instance of their own."""
NO_VALUE = {"HandFlight", "Blackbox", "DataFlash"}
"""Public classes whose instances go on, or read a file."""


def test_every_public_class_has_a_short_repr_and_copies_that_are_the_same(values):
    classes = {name for name in hs.__all__ if inspect.isclass(getattr(hs, name))}
    kinds = {kind.__name__ for one in values for kind in type(one).__mro__}
    assert classes - kinds - ABSTRACT - NO_VALUE == set()
    for value in values:
        text = repr(value)
        assert len(text) <= LONGEST, text
        assert "\n" not in text
        assert not re.search(r" at 0x|object at|array\(", text), text
        assert type(value).__name__.split("_")[0] in text
    for value in values:
        name = type(value).__name__
        other = pickle.loads(pickle.dumps(value))
        assert type(other) is type(value), name
        assert other == value, name
        assert hash(other) == hash(value), name
        assert repr(other) == repr(value), name
        assert writable(other) == [], name
        if is_dataclass(value):
            with pytest.raises(FrozenInstanceError):
                setattr(other, fields(value)[0].name, None)


def writable(value, name=""):
    """Return the names of what could be changed inside a value: arrays and mappings."""
    if isinstance(value, np.ndarray):
        return [name] if value.flags.writeable else []
    if isinstance(value, Mapping):
        # provenance and options are plain JSON data below their first level
        return [name] if isinstance(value, dict) else []
    if isinstance(value, tuple):
        return [found for one in value for found in writable(one, name)]
    if not is_dataclass(value):
        return []
    found = []
    for one in fields(value):
        if one.name not in ("scatter", "direct"):  # the error model, which no one is handed
            found += writable(getattr(value, one.name), f"{name}.{one.name}")
    return found


def returned(value):
    return repr(value), value


@pytest.mark.slow
def test_values_pass_to_other_processes_and_back(values):
    given = list(values)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for value, (text, back) in zip(given, pool.map(returned, given)):
            assert text == repr(value)
            assert back == value


def test_records_and_vehicles_differ_where_a_number_a_name_or_an_origin_does(jr700):
    """A vehicle that is loaded twice is one; with another setting, parameter or speed another."""
    record = make_flight(("p", "q"), seed=3)
    other = np.array(record.values)
    other[7, 1] += 1e-12
    changed = [
        replace(record, values=other),
        replace(record, time=record.time + 1.0),
        replace(record, channels=record.channels[::-1]),
        replace(record, provenance={"seed": 4}),
    ]
    assert all(one != record for one in changed)
    assert len({record, *changed}) == 5
    assert record != "record"
    assert record.__eq__("record") is NotImplemented
    again = hs.load("jr700")
    assert again == jr700
    assert {again: 1}[jr700] == 1
    assert jr700.with_settings({"gyro.k_p": 0.5}) != jr700
    assert jr700.trimmed(speed=5.0) != jr700
    assert hs.load("jr700", timestep=0.001) != jr700
    assert jr700.linearize() == again.linearize()


def test_a_frozen_map_cannot_be_changed_and_arrays_are_the_same_by_their_numbers():
    """A map is equal to a dict of its items; NaN in one place is NaN; minus zero is zero."""
    given = {"b": 1, "a": [1, {"x": float("nan")}]}
    frozen = FrozenMap(given)
    assert frozen == {"a": given["a"], "b": 1.0}
    assert list(frozen) == ["b", "a"]
    assert frozen != {"b": 1}
    with pytest.raises(TypeError):
        frozen["a"] = 3
    other = FrozenMap({"a": [1, {"x": float("nan")}], "b": 1.0})
    assert (other, hash(other)) == (frozen, hash(frozen))
    given["b"] = 2
    assert frozen["b"] == 1
    assert same(np.array([np.nan, -0.0]), np.array([np.nan, 0.0]))
    assert not same(np.zeros(3), np.zeros((3, 1)))
    assert not same(np.zeros(3), [0.0, 0.0, 0.0])
    assert not same((1, 2), [1, 2])
