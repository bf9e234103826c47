"""Excitations that are a class with `sticks`: shipped ones, and a user's own from a script."""

import json
from dataclasses import dataclass, field

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.cli import main
from helisim.physics.layout import HISTORY, PARAM
from helisim.physics.native import installed
from helisim.records.storage import read_record, write_record
from helisim.show.viewer import prepare_live
from helisim.sim import (
    Doublet,
    Excitation,
    FlightEnvelope,
    FlightPlan,
    Pilot,
    fly,
    fly_to,
    read_plan,
    simulate,
    write_plan,
)
from helisim.sim.excitation import EXCITATIONS, _injection, step_times
from helisim.sim.flight import prepare
from helisim.sim.manoeuvres import ThreeTwoOneOne
from helisim.vehicle import load
from helisim.vehicle.folder import model_folder
from helisim.vehicle.trim import addresses, place

DOUBLET = {"axis": "lat", "duration": 4.0, "amplitude": 0.05, "width": 0.7, "trim_time": 1.0}


@dataclass(frozen=True, kw_only=True)
class PythonDoublet(Excitation):
    """What `Doublet` is, in numpy."""

    axis: str = "lat"
    duration: float = 4.0
    amplitude: float = 0.05
    width: float = 0.7
    trim_time: float = 1.0

    def sticks(self, time):
        since = time - self.trim_time
        first = (since >= 0.0) & (since < 0.5 * self.width)
        second = (since >= 0.5 * self.width) & (since < self.width)
        return self.on_axis(self.amplitude * (1.0 * first - 1.0 * second))


KINDS = (Doublet, PythonDoublet)


@dataclass(frozen=True, kw_only=True)
class Given(Excitation):
    """Whatever a test wants to be added, or returned."""

    axis: str = "lat"
    duration: float = 2.0
    number: int = 0

    what = staticmethod(lambda time: np.zeros((time.size, 4)))

    def sticks(self, time):
        return type(self).what(time)


@pytest.fixture
def given(monkeypatch):
    """Return a function that makes an excitation whose `sticks` is a function of time."""

    def make(what):
        _injection.cache_clear()
        monkeypatch.setattr(Given, "what", staticmethod(what))
        return Given()

    yield make
    _injection.cache_clear()


@pytest.mark.parametrize("axis", ["col", "lon", "lat", "ped"])
@pytest.mark.parametrize(
    "settings", [{}, {"integrator": "Euler"}, {"timestep": 0.001}], ids=["RK4", "Euler", "1 ms"]
)
def test_a_doublet_in_python_flies_as_the_compiled_one(axis, settings):
    """To the bit: both add +-amplitude to the same sticks at the same steps.

    A product with +-1 has no rounding, and the times of the steps are added up as MuJoCo's.
    """
    vehicle = load(**settings)
    flown = [
        fly(vehicle, kind(**{**DOUBLET, "axis": axis}), count=2, seed=3, jobs=2) for kind in KINDS
    ]
    for compiled, python in zip(*flown):
        assert np.array_equal(compiled.values, python.values)
        assert np.ptp(python[axis.upper()]) > 0.08


@pytest.mark.parametrize("timestep", [0.002, 0.001, 1.0 / 3000.0])
def test_the_times_are_mujocos_own(jr700, timestep):
    """To the last bit over a minute, or an edge would come a step early or late."""
    model = mujoco.MjModel.from_xml_string(f"<mujoco><option timestep='{timestep}'/></mujoco>")
    data, seen = mujoco.MjData(model), []
    for _ in range(round(60.0 / timestep) + 1):
        seen.append(data.time)
        mujoco.mj_step(model, data)
    assert np.array_equal(step_times(60.0, timestep), seen)


def test_all_four_sticks_can_move(jr700, given):
    """What is returned is added to the pilot's sticks, at each tick, and nothing else is."""
    quiet = {"pilot": Pilot(remnant=0.0), "envelope": FlightEnvelope.off()}

    def waves(time):
        return 1e-3 * np.sin(np.outer(time, [3.0, 5.0, 7.0, 9.0]))

    moved = next(simulate(jr700, FlightPlan(excitation=given(waves), **quiet), jobs=1))
    held = next(simulate(jr700, FlightPlan(excitation=given(lambda t: 0.0 * waves(t)), **quiet)))
    added = (moved.sticks - held.sticks)[:100]
    # in 0.2 s the pilot answers: by up to 3 % of the wave
    assert added == pytest.approx(waves(moved.time[:100]), abs=5e-5)
    assert np.abs(added).max(axis=0).min() > 4e-4


def test_beyond_the_travel_the_stick_stops(jr700, given):
    """The pilot's trim and what is added are clipped together at the stick's end."""
    excitation = given(lambda time: np.column_stack([np.full(time.size, 0.5)] * 4))
    plan = FlightPlan(excitation=excitation, envelope=FlightEnvelope.off())
    sticks = next(simulate(jr700, plan, jobs=1, keep_ended=True)).sticks
    assert sticks.max() == 0.5
    assert sticks[0].min() > 0.49  # the pilot trims by less than 0.01


def test_a_flight_that_ends_early_is_flown_again_with_its_sticks(jr700):
    """The last state of a terminated flight is the compiled doublet's, to the bit."""
    tight = FlightEnvelope(tilt=0.15)
    plans = [FlightPlan(excitation=kind(**DOUBLET), envelope=tight) for kind in KINDS]
    ends = [next(simulate(jr700, plan, jobs=1, keep_ended=True)).end for plan in plans]
    assert 1.0 < ends[0].at < 2.0
    assert ends[0].at == ends[1].at
    assert np.array_equal(ends[0].state, ends[1].state)


def test_a_class_that_inherits_a_compiled_formula_flies_its_own_sticks(jr700):
    """`sticks` wins over the formula of the class that it is derived from."""

    @dataclass(frozen=True, kw_only=True)
    class HalfDoublet(Doublet):
        def sticks(self, time):
            return 0.5 * PythonDoublet(**DOUBLET).sticks(time)

    (flown,) = fly(jr700, HalfDoublet(**DOUBLET), seed=3, jobs=1)
    wanted = {**DOUBLET, "amplitude": 0.5 * DOUBLET["amplitude"]}
    assert np.array_equal(flown.values, fly(jr700, Doublet(**wanted), seed=3, jobs=1)[0].values)


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (lambda t: np.zeros(t.size), r"shape \(1001, 4\), one row a time.*got shape \(1001,\)"),
        (lambda t: np.zeros((t.size - 1, 4)), r"got shape \(1000, 4\)"),
        (lambda t: np.zeros((4, t.size)), r"got shape \(4, 1001\)"),
        (lambda t: None, r"numbers .*got shape \(\) of object"),
        (lambda t: np.full((t.size, 4), "x"), "numbers .* of <U1"),
        (lambda t: np.zeros((t.size, 4), dtype=complex), "numbers .* of complex128"),
        (lambda t: np.where(t[:, None] < 1.0, 0.0, np.nan) * np.ones(4), "COL is nan at 1 s"),
        (lambda t: 0.6 * (t[:, None] >= 1.5) * [0, 0, 0, 1], "PED is 0.6 at 1.5 s"),
        (lambda t: np.full((t.size, 4), -np.inf), "COL is -inf at 0 s"),
    ],
)
def test_sticks_that_cannot_be_flown_are_one_clear_error(jr700, given, what, message):
    """Before anything is flown: what came, what is expected, and where."""
    with pytest.raises(InputError, match=rf"Given\.sticks .*{message}"):
        fly(jr700, given(what), jobs=1)


def test_a_users_error_stays_the_users(jr700, given):
    """An exception inside `sticks` comes out as it is, with its traceback."""
    with pytest.raises(ZeroDivisionError):
        fly(jr700, given(lambda time: 1 // 0), jobs=1)


def classes_that_cannot_fly():
    class NoSticks(Excitation):
        pass

    class NoDuration(Excitation):
        def __init__(self):
            object.__setattr__(self, "axis", "lat")

        def sticks(self, time):
            return np.zeros((time.size, 4))

    class NoMethod:
        axis, duration = "lat", 3.0

    @dataclass(frozen=True, kw_only=True)
    class WithArray(PythonDoublet):
        table: object = field(default_factory=lambda: np.zeros(3))

    return [
        (lambda: NoSticks(axis="lat", duration=3.0), "NoSticks doesn't say how it moves"),
        (NoDuration, "NoDuration has no duration"),
        (NoMethod, "needs an excitation such as Sweep"),
        (WithArray, "settings of WithArray must be finite numbers, texts, or tuples"),
        (lambda: PythonDoublet(duration=float("nan")), "finite numbers of seconds"),
        (lambda: PythonDoublet(duration="4"), "finite numbers of seconds"),
        (lambda: PythonDoublet(duration=0.1), "duration must be at least 1 s"),
        (lambda: PythonDoublet(axis="roll"), "'roll'; available: col, lon, lat, ped"),
        (
            lambda: PythonDoublet(width=float("inf")),
            "width must be a finite number, got inf",
        ),
    ]


@pytest.mark.parametrize(("make", "message"), classes_that_cannot_fly())
def test_a_class_that_cannot_fly_is_one_clear_error(jr700, make, message):
    """For a plan, and for a flight that is watched."""
    with pytest.raises(InputError, match=message):
        FlightPlan(excitation=make())
    with pytest.raises(InputError, match=message):
        prepare_live(jr700, make())


def test_a_name_that_is_taken_is_refused():
    """A record of a `Sweep` must mean helisim's; one's own may be defined anew, as notebooks do."""
    with pytest.raises(InputError, match=r"'Sweep' in helisim\.sim\.manoeuvres already"):
        type("Sweep", (Excitation,), {"__module__": "__main__"})
    assert EXCITATIONS["Sweep"].__module__ == "helisim.sim.manoeuvres"
    first = type("Mine", (Excitation,), {"__module__": "__main__"})
    second = type("Mine", (Excitation,), {"__module__": "__main__"})
    assert first is not second
    assert EXCITATIONS["Mine"] is second


def test_a_record_says_what_was_flown(jr700, tmp_path):
    """Kind and settings, a digest of the sticks; and the plan can be flown again from it."""
    excitation = PythonDoublet(width=0.5)
    (flown,) = fly(jr700, excitation, seed=3, jobs=1)
    write_record(flown, tmp_path / "flown.parquet")
    record = read_record(tmp_path / "flown.parquet")
    said = record.provenance
    assert said["excitation"] == {"kind": "PythonDoublet", **DOUBLET, "width": 0.5}
    assert len(said["sticks_digest"]) == 32
    plan = FlightPlan.of_record(record)
    assert plan == FlightPlan(excitation=excitation).on(jr700)
    assert plan.digest == said["plan_digest"]
    assert np.array_equal(fly(jr700, plan, seed=3, jobs=1)[0].values, record.values)
    write_plan(plan, tmp_path / "plan.toml")
    assert read_plan(tmp_path / "plan.toml") == plan
    (other,) = fly(jr700, PythonDoublet(width=0.6), seed=3, jobs=1)
    assert other.provenance["sticks_digest"] != said["sticks_digest"]
    (compiled,) = fly(jr700, Doublet(**DOUBLET), seed=3, jobs=1)
    assert "sticks_digest" not in compiled.provenance


def test_a_folder_notices_that_the_class_changed(jr700, given, tmp_path):
    """Name and settings are the same, the code isn't: the digest of the sticks tells."""
    fly_to(tmp_path, jr700, given(lambda time: np.zeros((time.size, 4))), count=1, jobs=1)
    again = given(lambda time: np.zeros((time.size, 4)))
    assert fly_to(tmp_path, jr700, again, count=1, jobs=1).found == 1
    changed = given(lambda time: np.full((time.size, 4), 1e-4))
    with pytest.raises(InputError, match="another configuration: sticks_digest"):
        fly_to(tmp_path, jr700, changed, count=1, jobs=1)


def test_the_viewer_flies_it_too(jr700):
    """Step by step as the batch does, and beyond its end the sticks are the pilot's own."""
    live = [prepare_live(jr700, kind(**DOUBLET), seed=1) for kind in KINDS]
    with installed():
        for flight in live:
            while flight.data.time < 4.5:
                flight.step()
    assert np.array_equal(live[0].data.qpos, live[1].data.qpos)
    assert live[0].added is None
    assert not np.any(live[1].data.userdata[:4])


def test_a_model_without_userdata_is_left_alone(jr700):
    """A scene that has no such numbers: nothing is read, the hover is held."""
    path = str(model_folder(jr700.name) / "jr700.xml")
    bare = mujoco.MjModel.from_xml_path(path)
    assert bare.nuserdata == 0
    ends = []
    for kind in (0.0, HISTORY):
        prepared = prepare(jr700, PythonDoublet(), seed=1, number=0).actuator_user
        bare.actuator_user[:, : len(PARAM)] = prepared[:, : len(PARAM)]
        bare.actuator_user[addresses(bare).rotor, PARAM.excitation] = kind
        data = mujoco.MjData(bare)
        place(bare, data, jr700.trim)
        with installed():
            for _ in range(1000):
                mujoco.mj_step(bare, data)
        ends.append(data.qpos.copy())
    assert np.array_equal(*ends)


def test_3211_has_its_four_steps():
    """3, 2, 1 and 1 units, each the other way, from the end of the trimmed stretch."""
    excitation = ThreeTwoOneOne(axis="ped", amplitude=0.1, unit=0.5, trim_time=1.0)
    middles = 1.25 + 0.5 * np.arange(-1, 8)
    sticks = excitation.sticks(middles)
    assert sticks[:, 3] == pytest.approx(0.1 * np.array([0, 1, 1, 1, -1, -1, 1, -1, 0]), abs=0.0)
    assert not sticks[:, :3].any()
    assert excitation.sticks(np.array([1.0, 2.5, 4.5]))[:, 3].tolist() == [0.1, -0.1, 0.0]


def test_3211_is_open_until_a_vehicle_completes_it(jr700):
    """Its amplitude is the vehicle's own for the axis; an open one isn't flown."""
    excitation = ThreeTwoOneOne(axis="ped")
    assert excitation.on(jr700.parameters).amplitude == jr700.parameters["sweep.ped_amplitude"]
    with pytest.raises(InputError, match=r"on\(vehicle.parameters\)"):
        excitation.sticks(np.zeros(3))


def test_the_command_line_takes_it_and_plans_keep_it(tmp_path, capsys):
    """By its name and settings; printed as a plan, flown from it, identified, recorded."""
    asked = ["fly", "--axis", "lat", "--excitation", "threetwooneone,unit=0.4", "--print-plan"]
    assert main(asked) == 0
    text = capsys.readouterr().out
    (tmp_path / "plan.toml").write_text(text)
    plan = read_plan(tmp_path / "plan.toml")
    own = load().parameters["sweep.lat_amplitude"]
    assert plan.excitation == ThreeTwoOneOne(axis="lat", unit=0.4, amplitude=own)
    out = ["--out", str(tmp_path / "lat.parquet"), "--rerun", str(tmp_path / "lat.rrd")]
    assert main(["fly", "--plan", str(tmp_path / "plan.toml"), *out]) == 0
    record = read_record(tmp_path / "lat.parquet")
    assert json.loads(json.dumps(record.provenance["excitation"]))["kind"] == "ThreeTwoOneOne"
    assert "sticks_digest" in record.provenance
    assert main(["frf", str(tmp_path / "lat.parquet"), "--input", "LAT", "--output", "p"]) == 0
