"""Settings: one table of what is taken and what is refused, by each way that they are given."""

import copy
import doctest
import json
import math
import pickle
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from helisim.base import settings
from helisim.base.errors import (
    IdentificationError,
    InputError,
    LogError,
    UnknownNameError,
    shown,
    similar,
)
from helisim.base.linear import LinearSystem
from helisim.base.note import Note, Option, options
from helisim.base.settings import FrozenMap, Inline, Value, check, from_plain, setting
from helisim.cli.options import worded
from tabled import tabled

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


@tabled("data", "message")
def test_what_can_not_be_is_refused_with_its_place(data, message):
    with pytest.raises(InputError) as caught:
        from_plain(Plan, data, "plan")
    assert message in str(caught.value)
    assert len(str(caught.value)) <= 500


@tabled("make", "message")
def test_python_is_checked_as_files_are(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_numpy_becomes_pythons_own():
    plan = Plan(number=np.float64(2.0), count=np.int64(2), pair=np.array([1.0, 3.0]))
    assert type(plan.number) is float
    assert type(plan.count) is int
    assert plan.pair == (1.0, 3.0)


def test_what_another_version_wrote_is_passed_over():
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


@tabled("text")
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


# What all stands on: short messages that say what mends them, and linear systems.


@tabled("given", "found")
def test_a_remedy_is_given_in_short(given, found):
    assert options(given) == found
    assert Note.of("gaps", "there are gaps", given).remedy == found


def test_the_command_line_words_a_remedy():
    assert worded(options("max_gap=0.5,windows")) == " (--max-gap 0.5, --windows)"
    assert worded(()) == ""


def test_an_error_carries_its_remedy_between_processes():
    for error in (
        IdentificationError("too short", remedy="windows"),
        UnknownNameError("axis", "x", ("lat",), remedy="windows"),
    ):
        other = pickle.loads(pickle.dumps(error))
        assert other.remedy == (Option("windows"),)
        assert "windows" not in str(other)
        assert str(other) == str(error)


def test_messages_are_short_without_control_characters_and_keep_their_ends():
    error = InputError(f"\x1b[2Jcolumn {'x' * 900} is none; rename it")
    assert len(str(error)) <= 500
    assert "\x1b" not in str(error)
    assert str(error).endswith("rename it")
    assert str(InputError("one\ntwo")) == "one two"
    assert str(LogError("one\ntwo\x07")).splitlines() == ["one", "two"]
    unknown = UnknownNameError("axis", "y" * 900, [f"{k}" * 200 for k in range(5)])
    assert len(str(unknown)) <= 500
    assert unknown.unlisted == unknown.available
    assert shown("a\x1b[2Jb\nc") == "a[2Jb c"
    assert len(shown("x" * 1000, 40)) == 40
    assert shown("x" * 40, 40) == "x" * 40
    assert shown(["a\x00"]) == "['a\\x00']"


AXES = ("col", "lon", "lat", "ped")
MANY = tuple(f"rotor.part_{k:02d}" for k in range(40))


def test_of_a_long_list_only_those_alike_are():
    error = UnknownNameError("parameter", "rotor.part_7", MANY)
    assert "there are 40" in str(error)
    assert "did you mean rotor.part_07 or " in str(error)
    assert error.available == MANY
    assert error.unlisted == MANY


@tabled("name", "meant")
def test_case_parts_and_slips_are_seen(name, meant):
    assert similar(name, ("lat", "main.stiffness", "main.radius", "tail.speed")) == meant


@pytest.mark.parametrize("again", [copy.copy, lambda one: pickle.loads(pickle.dumps(one))])
def test_the_error_passes_between_processes(again):
    error = UnknownNameError("axis", "lta", AXES)
    said = "unknown axis 'lta'; available: col, lon, lat, ped"
    assert (str(error), error.unlisted) == (f"{said}; did you mean lat?", ())
    assert str(UnknownNameError("axis", "yaw", AXES)) == said.replace("lta", "yaw")
    assert str(again(error)) == str(error)
    assert again(error).available == AXES


LAG = LinearSystem([[-2.0]], [[1.0, 3.0]], [[1.0]], [[0.0, 0.0]], None, ("u", "v"), ("y",))


def test_one_frequency_is_a_response_of_one():
    """1 / (s + 2) and 3 / (s + 2) at s = 2j."""
    assert LAG.response(2.0)[0, :, 0] == pytest.approx(np.array([1.0, 3.0]) / (2.0 + 2.0j))


def test_delays_of_inputs_that_were_left_out_are_no_states():
    late = replace(LAG.discretise(0.1), delays={"u": 0.3, "v": 0.2})
    found = late.select(["v"]).with_delays_as_states()
    assert found.states == ("x[0]", "v_1_ago", "v_2_ago")
    omega = np.array([0.5, 5.0])
    assert found.response(omega) == pytest.approx(late.select(["v"]).response(omega))


def test_an_alias_of_a_type_is_what_it_stands_for():
    """`type Real = ...`, as NumPy 2.5 has it and Python 3.11 can't, says it by `__value__`."""
    alias = SimpleNamespace(__value__=SimpleNamespace(__value__=NDArray[np.float64]))
    assert settings.convert(alias, [1, 2], "it").dtype == np.float64
