"""Settings: one table of what is taken and what is refused, by each way that they are given."""

import doctest
import json
import math
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from helisim.base import settings
from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import FrozenMap, Inline, Value, check, from_plain, setting

PARTS: dict[str, type] = {}


@dataclass(frozen=True, kw_only=True)
class Gust:
    """A value object inside another."""

    down: float = setting(0.0, unit="m/s")
    rise: float = setting(1.0, unit="s", above=0.0)

    def __post_init__(self):
        check(self)


@dataclass(frozen=True, kw_only=True)
class Part:
    """The base of several kinds."""

    kinds: ClassVar[Mapping[str, type]] = PARTS
    at: float = setting(0.0, low=0.0, unit="s")

    def __post_init__(self):
        check(self)


@dataclass(frozen=True, kw_only=True)
class Step(Part):
    """One kind."""

    size: float | None = 0.1


@dataclass(frozen=True, kw_only=True)
class Both(Part):
    """A kind that holds others."""

    parts: tuple[Part, ...] = ()


PARTS |= {"Step": Step, "Both": Both}


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One field of each type."""

    number: float = setting(1.0, low=0.0, below=10.0)
    bound: float = setting(math.inf, finite=False)
    count: int = setting(3, low=1, high=5)
    flag: bool = True
    level: str | float | None = setting(None, choices=("light", "severe"), high=50.0)
    word: Literal["a", "b"] = "a"
    pair: tuple[float, float] | None = (1.0, 2.0)
    names: tuple[str, ...] = ()
    noise: Mapping[str, float] = setting(factory=lambda: FrozenMap({}), low=0.0)
    gust: Gust | None = None
    part: Part | None = None
    parts: tuple[Part, ...] = ()
    other: Gust | Step = setting(factory=Gust)
    call: Callable[[float], float] | None = None
    later: float = setting(0.0, unsaid=True)

    def __post_init__(self):
        check(self)


FULL = Plan(
    number=2,
    bound=-math.inf,
    level="light",
    names=("p", "q"),
    noise={"p": 0.1},
    gust=Gust(down=2.0),
    part=Both(parts=(Step(at=1.0), Both(parts=(Step(size=None),)))),
    parts=(Step(),),
    other=Step(size=0.3),
)


def test_the_example_of_the_module_runs():
    assert doctest.testmod(settings).failed == 0


@pytest.mark.parametrize("plan", [Plan(), FULL])
@pytest.mark.parametrize("way", ["json", "toml"])
def test_it_comes_back_from_files(plan, way):
    """Equal, of the same types, with kinds where a field may hold several."""
    if way == "json":
        data = json.loads(json.dumps(settings.to_plain(plan), allow_nan=False))
    else:
        data = tomllib.loads(settings.toml_text(settings.to_plain(plan, toml=True)))
    again = from_plain(Plan, data, "plan")
    assert again == plan
    assert isinstance(again.noise, FrozenMap)
    assert "later" not in data


REFUSED = [
    ({"number": -1}, "plan.number must be a number 0 or more and below 10, got -1"),
    ({"number": math.inf}, "finite"),
    ({"number": 10**400}, "finite"),
    ({"number": "2"}, "got '2'"),
    ({"count": 3.0}, "plan.count must be an integer 1 or more and at most 5, got 3.0"),
    ({"count": 10**30}, "integer"),
    ({"flag": 1}, "true or false"),
    ({"level": "ligth"}, "did you mean light?"),
    ({"level": 51.0}, "at most 50"),
    ({"word": "c"}, "available: a, b"),
    ({"pair": [1.0, math.nan]}, "plan.pair[1]"),
    ({"names": [1]}, "plan.names[0] must be text, got 1"),
    ({"noise": {"p": -1.0}}, "plan.noise.p must be a number 0 or more"),
    ({"gust": {"rise": 0}}, "plan.gust.rise must be a number above 0 s, got 0"),
    ({"gust": {"riser": 1}}, "unknown setting of plan.gust 'riser'"),
    ({"part": {"at": 1}}, "plan.part must be a table with a kind, one of Step, Both"),
    ({"part": {"kind": "Stp"}}, "did you mean Step?"),
    ({"parts": [{"kind": "Both", "parts": [{"kind": "Step", "at": -1}]}]},
     "plan.parts[0].parts[0].at must be a number 0 or more s, got -1"),
    ({"other": {"kind": "Plan"}}, "available: Gust, Step"),
    ({"call": 3}, "plan.call"),
    ({"gsut": {}}, "did you mean gust?"),
    ([], "plan must be a table (Plan), got []"),
    ({"x" * 300: 1}, "unknown setting of plan"),
]  # fmt: skip


@pytest.mark.parametrize(("data", "message"), REFUSED, ids=lambda one: str(one)[:40])
def test_what_can_not_be_is_refused_with_its_place(data, message):
    with pytest.raises(InputError) as caught:
        from_plain(Plan, data, "plan")
    assert message in str(caught.value)
    assert len(str(caught.value)) <= 500


@pytest.mark.parametrize(
    "given", [{"number": -1}, {"pair": [1.0, np.inf]}, {"part": 3}, {"count": 2.5}]
)
def test_python_is_checked_as_files_are(given):
    with pytest.raises(InputError, match=f"Plan.{next(iter(given))}"):
        Plan(**given)


def test_numpy_becomes_pythons_own():
    plan = Plan(number=np.float64(2.0), count=np.int64(2), pair=np.array([1.0, 3.0]))
    assert type(plan.number) is float
    assert type(plan.count) is int
    assert plan.pair == (1.0, 3.0)


def test_what_another_version_wrote_is_passed_over():
    """Where the reader is lenient; it takes no other numbers, and an infinite one as ever."""
    assert from_plain(Plan, {"new": 1, "bound": "-inf"}, "plan", lenient=True).bound == -math.inf
    with pytest.raises(InputError, match=r"plan\.number must be a finite number.*, got inf"):
        from_plain(Plan, {"new": 1, "number": math.inf}, "plan", lenient=True)


def test_what_an_object_refuses_has_the_place():
    @dataclass(frozen=True)
    class Needs:
        axis: str

        def __post_init__(self):
            raise UnknownNameError("axis", self.axis, ("lat",))

    with pytest.raises(UnknownNameError, match=r"^plan: unknown axis"):
        from_plain(Needs, {"axis": "x"}, "plan")
    with pytest.raises(InputError, match="plan needs axis"):
        from_plain(Needs, {}, "plan")


@dataclass(frozen=True, eq=False)
class Curve(Value):
    """Arrays."""

    time: NDArray[np.float64]
    gain: NDArray[np.complex128] | None = None

    def __post_init__(self):
        check(self)


def test_arrays_come_back_read_only():
    curve = Curve([0.0, 1.0], np.array([1.0 + 2.0j, complex(-0.0, -0.0)]))
    again = from_plain(Curve, json.loads(json.dumps(settings.to_plain(curve))), "curve")
    assert again == curve
    assert np.signbit([again.gain[1].real, again.gain[1].imag]).all()
    assert not again.time.flags.writeable


@pytest.mark.parametrize("time", [[math.nan], ["1"], [True], [[1.0], [1.0, 2.0]], {"real": 1}, "x"])
def test_an_array_holds_finite_numbers(time):
    with pytest.raises(InputError, match=r"curve\.time"):
        from_plain(Curve, {"time": time}, "curve")


def test_a_notation_is_read():
    """Kinds in any case; what is left out is the default; dotted names reach into settings."""
    assert settings.parse_notation("step", PARTS) == Step()
    assert settings.parse_notation("Step,at=3,size=off", PARTS) == Step(at=3.0, size=None)
    assert settings.parse_notation("both,at=2.5", PARTS) == Both(at=2.5)
    text = "plan,gust.down=2,pair=3:42,names=p+q,noise.p=0.1,flag=no,level=severe,count=2"
    plan = settings.parse_notation(text, {"Plan": Plan})
    assert plan == Plan(
        gust=Gust(down=2.0), pair=(3.0, 42.0), names=("p", "q"), noise={"p": 0.1}, flag=False,
        level="severe", count=2,
    )  # fmt: skip
    assert settings.parse_notation("plan,level=20", {"Plan": Plan}).level == 20.0
    assert settings.parse_notation("step", PARTS, given={"at": 2.0}) == Step(at=2.0)


@pytest.mark.parametrize(
    "text",
    ["stp", "step,at", "step,at=", "step,at=x", "step,at=nan", "step,at=1,at=2", "step,size.x=1",
     "plan,gust.riser=1", "plan,gust=1,gust.down=2", "", ",", "step,=1"],
)  # fmt: skip
def test_a_wrong_notation_is_refused(text):
    with pytest.raises(InputError):
        settings.parse_notation(text, {**PARTS, "Plan": Plan})


def test_toml_has_tables_in_lines_lists_and_comments():
    data: dict[str, Any] = {
        "name": "x",
        "F": {"p": Inline(q="L_b", r=1.0)},
        "lat": {"filters": [Inline(kind="lag")], "list": [[1.0], [2.0]]},
    }
    text = settings.toml_text(data)
    assert text == (
        'name = "x"\n\n[F]\np = { q = "L_b", r = 1.0 }\n\n[lat]\n'
        'filters = [\n    { kind = "lag" },\n]\nlist = [\n    [1.0],\n    [2.0],\n]\n'
    )
    assert tomllib.loads(text) == data


def test_a_users_class_needs_no_settings():
    @dataclass(frozen=True)
    class Own:
        size: float
        twice: Any = None

    assert from_plain(Own, {"size": 2.0}, "own") == Own(2.0)
    assert settings.to_plain(Own(2.0), kind=True) == {"kind": "Own", "size": 2.0, "twice": None}
