"""Everything public is a value: short in words, whole after a copy, equal where it is the same."""

import copy
import inspect
import math
import multiprocessing
import pickle
import re
from collections.abc import Mapping
from dataclasses import FrozenInstanceError, fields, is_dataclass, replace

import control
import numpy as np
import pytest

import helisim as hs
from helisim.base.errors import DivergedError, HelisimError, RecordError, UnknownNameError
from helisim.base.settings import FrozenMap, Value, same
from helisim.design.design import Judged
from helisim.design.problem import Step
from helisim.handling.measured.interval import Interval
from helisim.handling.measured.margins import Driven, MeasuredFigure, MeasuredLoop
from helisim.ident import Reduction
from helisim.ident.verification import Trace
from helisim.logs import Column
from helisim.logs.read import reading_options
from helisim.look.sweeps import FlownSweep
from helisim.look.systemid import Inferred, InferredFit, InferredLog, TakenChannel
from helisim.sitl.parameters import Setting
from helisim.study.results import Run
from made_run import make_flight, make_model, make_verification, write_run

LONGEST = 400
"""Characters of a `repr`: five lines of a terminal."""


def lagging_yaw(seen, state):
    """Return the tail servo's command of a law with a state."""
    state[0] += 0.1 * (seen.PED - state[0])
    return state[0] - 0.1 * seen.r


def make_design(law):
    """Return a design of one specification that left a law as it was."""
    spec = hs.standard("margins", axes=("lat",))[1]
    rating = spec.criterion.rated({"gain_margin": 9.0, "phase_margin": 1.0, "crossover": 12.0})
    return hs.DesignResult(
        before=law,
        law=law,
        judged=(Judged(spec, None, rating, rating, 1.0),),
        margin=0.1,
        share=1.0,
        drawn=200,
        history=(Step("soft", 1, 0.2, 0.1, -3.0),),
        provenance={"seed": 1},
    )


def make_inferred():
    """Return what a log with one sweep says."""
    sweep = FlownSweep(12, 10.0, 70.0, 0.1, 2.0, 60.0, True, "complete")
    channel = TakenChannel("ped", Column("RATE.YOut", "1"), 400.0, "by name")
    log = InferredLog("a.bin", "ArduCopter", True, (sweep,), (channel,), {"H_SW_TYPE": 3.0}, 0.0)
    fit = InferredFit("yaw_base", ("ped",), ("r",), (), ("mixer_yaw",), (2.0, 60.0), "yaw")
    return Inferred((log,), reading_options(200.0, (), 0.25), (fit,), ())


@pytest.fixture(scope="module")
def values(jr700, tmp_path_factory):
    """An instance of each public class, and of what public functions return, by its name."""
    folder = tmp_path_factory.mktemp("run")
    item = make_model("rollpitch_in1", verified=True)
    results = write_run(folder)
    record = make_flight(seed=3)
    sweep = hs.Sweep(axis="lat", band=(1.0, 20.0))
    plan = hs.FlightPlan(
        excitation=sweep,
        pilot=hs.Pilot(remnant=0.0),
        recorder=hs.Recorder.of(jr700),
        weather=hs.Weather(gust=hs.Gust(north=1.0)),
        ground=hs.Ground(deck=hs.Deck(heave=hs.Swing(amplitude=0.3))),
        faults=(
            hs.ServoStuck(servo="servo_tail", at=30.0),
            hs.SensorDropout(channels=("p",), at=3.0, lasts=1.0),
        ),
    )
    fit = item.fit
    cut = hs.Cut("roll", "sensors", "phi_disturbance", "phi_sum")
    driven = Driven("phi_disturbance", ("phi_sum",), [1.0, 2.0], [[0.1, 1.0j]], 0.01 * np.eye(2))
    return {
        "Vehicle": jr700,
        "Linearization": jr700.linearize(),
        "sampled Linearization": jr700.linearize("IN2"),
        "Parameters": jr700.parameters,
        "Trim": jr700.trim,
        "GyroSettings": jr700.settings,
        "FlightPlan": plan,
        "Sweep": sweep,
        "Mission": hs.missions.Forward(speed=20.0),
        "Doublet": hs.Doublet(axis="ped"),
        "ThreeTwoOneOne": hs.ThreeTwoOneOne(axis="lon"),
        "Step": hs.Step(axis="lat"),
        "Pulse": hs.Pulse(axis="lat"),
        "Chirp": hs.Chirp(axis="r", at="sensors", amplitude=0.1, band=(1.0, 20.0)),
        "Multisine": hs.Multisine(amplitude=0.03, band=(1.0, 20.0)),
        "History": hs.Manoeuvre(math.sin, axis="lat").on(jr700.parameters),
        "Manoeuvre": hs.Manoeuvre(math.sin, axis="lat"),
        "Sequence": hs.Sequence(parts=(hs.Step(axis="lat"), hs.Step(axis="lon"))),
        "Together": hs.Together(parts=(hs.Step(axis="lat"), hs.Step(axis="lon"))),
        "plan of a History": hs.FlightPlan(
            excitation=hs.Manoeuvre(math.sin, axis="lat").on(jr700.parameters)
        ),
        "Pilot": plan.pilot,
        "Recorder": plan.recorder,
        "default Recorder": hs.Recorder(),
        "Controller": hs.Controller(tail=lagging_yaw, states=1),
        "Law": hs.laws.AttitudeCommand(
            lat=hs.laws.AttitudeAxis(stick=0.6, frequency=6.0, k_angle=0.6, k_rate=0.05),
            lon=hs.laws.AttitudeAxis(stick=0.6, frequency=6.0, k_angle=1.0, k_rate=0.1),
            ped=hs.laws.YawAxis(stick=3.0, frequency=8.0, k_angle=1.0, k_rate=0.2),
        ),
        "RateCommand": hs.RateCommand.of(jr700),
        "Controller of a law": hs.RateCommand.of(jr700).on(jr700),
        "Seen": hs.Seen(*(0.1 * number for number in range(len(hs.Seen._fields)))),
        "ProofPlan": hs.ProofPlan(repeats=2),
        "Weather": plan.weather,
        "Gust": plan.weather.gust,
        "Ground": plan.ground,
        "Deck": plan.ground.deck,
        "Swing": plan.ground.deck.heave,
        "FlightEnvelope": plan.envelope,
        "StickFeel": hs.StickFeel(),
        "ServoStuck": plan.faults[0],
        "SensorDropout": plan.faults[1],
        "ServoWeak": hs.ServoWeak(servo="servo_tail", at=3.0, rate_limit=1.0),
        "GyroRestart": hs.GyroRestart(at=3.0),
        "GyroDropout": hs.GyroDropout(at=3.0, lasts=1.0),
        "SensorSpikes": hs.SensorSpikes(channels=("p",), size=1.0),
        "SampleLoss": hs.SampleLoss(share=0.1),
        "RecordGap": hs.RecordGap(at=3.0, lasts=1.0),
        "ClockDrift": hs.ClockDrift(ppm=50.0),
        "FlightRecord": record,
        "Example": hs.examples()["logger"],
        "Log": hs.screen(record),
        "LogReport": hs.screen(record).report,
        "Inferred": make_inferred(),
        "FrequencyResponse": fit.data,
        "Structure": hs.structures.rollpitch,
        "Parameter": hs.structures.rollpitch.parameters[0],
        "Fit": fit,
        "FittedParameter": fit["L_b"],
        "Misfit": fit.misfit,
        "Modes": fit.modes,
        "Mode": fit.modes.poles[0],
        "Reduction": Reduction(fit, fit, (), (), 0.1),
        "Verification": item.verification,
        "VerificationFigures": item.verification.figures,
        "Trace": item.verification.traces[0],
        "Cut": cut,
        "MeasuredMargins": hs.MeasuredMargins(
            MeasuredLoop((driven,), (cut,)),
            (MeasuredFigure("DRP", "lat", "sensors", "dB", Interval(3.0, 2.5, 3.5)),),
            ("short",),
        ),
        "Plant": hs.Plant((fit,), late={"p": 0.0035}),
        "DesignResult": make_design(hs.RateCommand.of(jr700)),
        "Tracked": hs.Tracked(output="phi", stick="LAT", gain=0.6, frequency=6.0),
        "LqgWeights": hs.LqgWeights(effort={"lat": 0.1}),
        "StateSpaceLaw": hs.StateSpaceLaw(
            period=0.002, inputs=("p",), a=[[0.5]], b=[[1.0]], c=[[0.1]] * 4, d=[[0.2]] * 4
        ),
        "ArduPilotModel": hs.ArduPilotModel({"Nr": -2.0, "Nped": 63.0}),
        "AutopilotParameters": hs.AutopilotParameters(
            "jr700", {"hover": (Setting("H_COL_HOVER", 0.5),)}
        ),
        "IdentifiedModel": item,
        "Results": results,
        "Spec": hs.standard("disturbance_rejection", scale=10.7)[0],
        "Froude": hs.Froude.of(1.534),
        "Criterion": hs.criteria.AttitudeQuickness(axis="lat"),
        "Rating": hs.criteria.Damping().rated({"damping": 0.5, "frequency": 7.0}),
        "Run": Run(results, (item,), {"lat": (record,)}),
    }


NAMES = """
Vehicle, Linearization, sampled Linearization, Parameters, Trim, GyroSettings, FlightPlan,
Sweep, Mission, Doublet, ThreeTwoOneOne, Step, Pulse, Chirp, Multisine, History, Manoeuvre,
Sequence, Together, plan of a History, Pilot, Recorder, default Recorder, Controller, Law,
RateCommand, Controller of a law, Seen, ProofPlan, Weather, Gust, Ground, Deck, Swing,
FlightEnvelope, StickFeel, ServoStuck, SensorDropout, ServoWeak, GyroRestart, GyroDropout,
SensorSpikes, SampleLoss, RecordGap, ClockDrift, FlightRecord, Example, Log, LogReport,
Inferred, FrequencyResponse, Structure, Parameter, Fit, FittedParameter, Misfit, Modes, Mode,
Reduction, Verification, VerificationFigures, Trace, Cut, MeasuredMargins, Plant, DesignResult,
Tracked, LqgWeights, StateSpaceLaw, ArduPilotModel, AutopilotParameters, IdentifiedModel,
Results, Spec, Froude, Criterion, Rating, Run
"""
NAMES = [name.strip() for name in NAMES.split(",")]
ABSTRACT = {"Excitation"}
"""Public classes without an instance of their own."""
NO_VALUE = {"HandFlight", "DataFlash"}
"""Public classes whose instances go on, or read a file."""


def test_every_public_class_is_looked_at(values):
    """A class that becomes public needs an instance here."""
    classes = {name for name in hs.__all__ if inspect.isclass(getattr(hs, name))}
    kinds = {kind.__name__ for one in values.values() for kind in type(one).__mro__}
    assert classes - kinds - ABSTRACT - NO_VALUE == set()
    assert list(values) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_repr_is_short_and_says_no_address(name, values):
    """One line that says what it is, no wall of numbers."""
    text = repr(values[name])
    assert len(text) <= LONGEST, text
    assert "\n" not in text
    assert not re.search(r" at 0x|object at|array\(", text), text
    assert type(values[name]).__name__.split("_")[0] in text


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "again",
    [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy, copy.copy],
    ids=["pickle", "deepcopy", "copy"],
)
def test_a_copy_is_the_same_value(name, again, values):
    """Equal, with the same hash, and as read-only as the original."""
    value = values[name]
    other = again(value)
    assert type(other) is type(value)
    assert other == value
    assert hash(other) == hash(value)
    assert len({value, other}) == 1
    assert repr(other) == repr(value)
    assert writable(other) == []
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


def test_what_could_be_changed_is_found():
    """The search for it is not blind."""
    trace = Trace(*(np.zeros(3) for _ in range(5)))
    assert writable(trace) == []
    assert writable((np.zeros(3), {})) == ["", ""]


def returned(value):
    """Return a value and its repr, from another process."""
    return repr(value), value


def test_values_pass_to_other_processes_and_back(values):
    """By spawn, where nothing is inherited: all of them at once."""
    given = list(values.values())
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for value, (text, back) in zip(given, pool.map(returned, given)):
            assert text == repr(value)
            assert back == value


def test_records_differ_where_a_number_a_name_or_an_origin_does():
    """Each field counts."""
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


def test_fits_and_responses_differ_where_a_number_does():
    """A fit is its numbers, its data and how it was made."""
    item = make_model("heave")
    fit = item.fit
    assert fit == make_model("heave").fit
    assert fit != replace(fit, searches_agreeing=fit.searches_agreeing + 1)
    assert fit != replace(fit, parameters={**fit.parameters, "Z_w": fit["Z_col"]})
    assert fit.data != replace(fit.data, flags=("noisy",))
    assert hs.Fit.from_dict(fit.to_dict()) == fit
    assert hs.FrequencyResponse.from_dict(fit.data.to_dict()) == fit.data


def test_structures_are_equal_by_what_they_say():
    """A structure read back from TOML is the one that was written."""
    rollpitch = hs.structures.rollpitch
    assert rollpitch.with_starts({}) == rollpitch
    assert rollpitch != rollpitch.with_fixed({"L_b": 500.0})
    import tomllib

    assert hs.Structure.from_dict(tomllib.loads(rollpitch.to_toml())) == rollpitch


def test_verifications_are_equal_by_their_traces():
    """A copy made anew is equal; another prediction isn't."""
    one, other = (make_verification(hs.structures.heave) for _ in range(2))
    assert one == other
    trace = replace(one.traces[0], predicted=one.traces[0].measured)
    assert one != replace(other, traces=(trace,))


def test_vehicles_are_equal_by_parameters_and_flight(jr700):
    """Loaded twice it is one; with another setting, parameter or speed another."""
    again = hs.load("jr700")
    assert again == jr700
    assert {again: 1}[jr700] == 1
    assert jr700.with_settings({"gyro.k_p": 0.5}) != jr700
    assert jr700.trimmed(speed=5.0) != jr700
    assert hs.load("jr700", timestep=0.001) != jr700
    assert jr700.linearize() == again.linearize()


def test_a_copied_vehicle_flies_the_same(jr700):
    """What can be computed again is, and to the same bits."""
    other = pickle.loads(pickle.dumps(jr700))
    sweep = hs.Sweep(axis="lat", duration=12.0)
    assert hs.fly(other, sweep, seed=1) == hs.fly(jr700, sweep, seed=1)


def test_a_copied_fit_has_its_model(values):
    """The state space, which python-control can't pickle, is made again."""
    other = pickle.loads(pickle.dumps(values["Fit"]))
    assert isinstance(other.model, control.StateSpace)
    np.testing.assert_array_equal(other.model.A, values["Fit"].model.A)


@pytest.mark.parametrize(
    "error",
    [
        UnknownNameError("channel", "x", ("p", "q")),
        HelisimError("what"),
        RecordError("which"),
        DivergedError("why"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_cross_processes_with_their_words(error):
    """Words that were put before the message, such as a file's name, too."""
    error.args = (f"log.csv: {error}",)
    other = pickle.loads(pickle.dumps(error))
    assert type(other) is type(error)
    assert str(other) == str(error)
    assert str(other).startswith("log.csv: ")


class TestFrozenMap:
    """A mapping like any other, that can't be changed."""

    def test_it_is_a_mapping(self):
        """Equal to a dict of the same items; in the order that it was given."""
        frozen = FrozenMap({"b": 1, "a": 2})
        assert frozen == {"a": 2, "b": 1}
        assert list(frozen) == ["b", "a"]
        assert {**frozen, "c": 3} == {"a": 2, "b": 1, "c": 3}
        assert repr(frozen) == "{'b': 1, 'a': 2}"
        assert frozen != {"a": 2}
        assert frozen != 3

    def test_it_can_not_be_changed(self):
        """Nor through the mapping that it was made of."""
        given = {"a": 1}
        frozen = FrozenMap(given)
        given["a"] = 2
        assert frozen["a"] == 1
        with pytest.raises(TypeError):
            frozen["a"] = 3
        with pytest.raises(AttributeError):
            frozen.other = 3

    def test_equal_ones_have_one_hash(self):
        """Whatever their order, lists and NaN in them."""
        one = FrozenMap({"a": [1, {"x": float("nan")}], "b": 2.0})
        other = FrozenMap({"b": 2, "a": [1, {"x": float("nan")}]})
        assert one == other
        assert hash(one) == hash(other)


def test_arrays_are_the_same_by_shape_and_numbers():
    """NaN in one place is NaN; minus zero is zero, and hashes so."""

    class Held(Value):
        pass

    assert same(np.array([np.nan, -0.0]), np.array([np.nan, 0.0]))
    assert not same(np.zeros(3), np.zeros((3, 1)))
    assert not same(np.zeros(3), [0.0, 0.0, 0.0])
    assert not same((1, 2), [1, 2])
    one = make_flight(("p",))
    values = np.zeros_like(one.values)
    minus, plus = replace(one, values=-values), replace(one, values=values)
    assert minus == plus
    assert hash(minus) == hash(plus)
    assert Held.__eq__ is Value.__eq__
