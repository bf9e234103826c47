"""Excitations that are a class with `sticks`: shipped ones, and a user's own from a script."""

from dataclasses import dataclass, field

import mujoco
import numpy as np
import pytest

from helisim.base.errors import InputError
from helisim.records.storage import read_record, write_record
from helisim.show.viewer import prepare_live
from helisim.sim import Doublet, Excitation, FlightPlan, fly
from helisim.sim.excitation import EXCITATIONS, step_times
from helisim.sim.manoeuvres import ThreeTwoOneOne
from helisim.vehicle import load
from tabled import tabled

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
        monkeypatch.setattr(Given, "what", staticmethod(what))
        return Given()

    return make


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


@tabled("what", "message")
def test_sticks_that_cannot_be_flown_are_one_clear_error(jr700, given, what, message):
    with pytest.raises(InputError, match=rf"Given\.sticks .*{message}"):
        fly(jr700, given(what), jobs=1)


def classes_that_cannot_fly():
    class NoSticks(Excitation):
        pass

    class NoMethod:
        axis, duration = "lat", 3.0

    @dataclass(frozen=True, kw_only=True)
    class WithArray(PythonDoublet):
        table: object = field(default_factory=lambda: np.zeros(3))

    return [
        (lambda: NoSticks(axis="lat", duration=3.0), "NoSticks doesn't say how it moves"),
        (NoMethod, "needs an excitation such as Sweep"),
        (WithArray, "settings of WithArray must be finite numbers, texts, or tuples"),
        (lambda: PythonDoublet(duration=float("nan")), "duration must be a finite number, got nan"),
        (lambda: PythonDoublet(duration="4"), "duration must be a number, got '4'"),
        (lambda: PythonDoublet(duration=0.1), "duration must be at least 1 s"),
        (lambda: PythonDoublet(axis="roll"), "'roll'; available: col, lon, lat, ped"),
        (lambda: PythonDoublet(width=float("inf")), "width must be a finite number, got inf"),
    ]


@pytest.mark.parametrize(("make", "message"), classes_that_cannot_fly())
def test_a_class_that_cannot_fly_is_one_clear_error(jr700, make, message):
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
    excitation = PythonDoublet(width=0.5)
    (flown,) = fly(jr700, excitation, seed=3, jobs=1)
    write_record(flown, tmp_path / "flown.parquet")
    record = read_record(tmp_path / "flown.parquet")
    said = record.provenance
    assert said["excitation"] == {"kind": "PythonDoublet", **DOUBLET, "width": 0.5}
    assert len(said["sticks_digest"]) == 32
    plan = FlightPlan.of_record(record)
    assert plan == FlightPlan(excitation=excitation).on(jr700)
    (other,) = fly(jr700, PythonDoublet(width=0.6), seed=3, jobs=1)
    assert other.provenance["sticks_digest"] != said["sticks_digest"]
    (compiled,) = fly(jr700, Doublet(**DOUBLET), seed=3, jobs=1)
    assert "sticks_digest" not in compiled.provenance


def test_3211_has_its_four_steps():
    excitation = ThreeTwoOneOne(axis="ped", amplitude=0.1, unit=0.5, trim_time=1.0)
    middles = 1.25 + 0.5 * np.arange(-1, 8)
    sticks = excitation.sticks(middles)
    assert sticks[:, 3] == pytest.approx(0.1 * np.array([0, 1, 1, 1, -1, -1, 1, -1, 0]), abs=0.0)
    assert not sticks[:, :3].any()
    assert excitation.sticks(np.array([1.0, 2.5, 4.5]))[:, 3].tolist() == [0.1, -0.1, 0.0]
