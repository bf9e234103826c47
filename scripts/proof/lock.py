"""Lock what helisim does: compare its behaviour with that of a version before, to the last bit.

python scripts/proof/lock.py check [GROUP ...] [--fast]  print each difference, status 1 if any
python scripts/proof/lock.py accept GROUP [NAME ...]     rewrite the entries of a reviewed change

Names are as 'kind *'; without any all of the group are rewritten. --fast leaves out what takes
long, --show prints differences whole. Only public names and the command line are used. What is
locked is in `lock.json` beside this file.
"""

import dataclasses
import difflib
import hashlib
import inspect
import io
import json
import math
import os
import re
import shlex
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, redirect_stderr, redirect_stdout
from fnmatch import fnmatchcase
from functools import cache, partial
from pathlib import Path
from typing import Any, ClassVar

import common
import numba
import numpy as np

import helisim as hs
from helisim import gym
from helisim.base.files import read_toml
from helisim.cli import main as command

FILE = Path(__file__).with_suffix(".json")
SETTINGS = read_toml(FILE.with_suffix(".toml"))
_UNSTABLE = ("versions", "made_by", "traceback", "source")
Case = Callable[[], Any]
FAST = [False]
"""Whether to leave out what takes long."""


def digest(*parts: Any) -> str:
    total = hashlib.sha256()
    for part in parts:
        array = isinstance(part, np.ndarray) and part.dtype != object
        text = part if array else json.dumps(plain(part), sort_keys=True)
        total.update(np.ascontiguousarray(part).tobytes() if array else text.encode())
    return total.hexdigest()[:16]


def plain(value: Any) -> Any:
    match value:
        case hs.FlightRecord():
            end = {"ended": value.ended} if value.ended else {}
            units = [(one.name, one.unit) for one in value.channels]
            data = digest(value.time, value.values, units)
            return {"data": data, "samples": len(value), "plan": digest(plan_of(value))} | end
        case np.ndarray() if value.dtype != object and value.size > 12:
            return digest(value)
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case complex():
            return [value.real, value.imag]
        case float() if not math.isfinite(value):
            return str(value)
        case Mapping():
            return {str(name): plain(one) for name, one in value.items()}
        case list() | tuple():
            return [plain(one) for one in value]
        case str() | bool() | int() | float() | None:
            return value
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
        return {name: plain(getattr(value, name)) for name in names}
    return re.sub(r" at 0x[0-9a-f]+", "", repr(value))


def plan_of(record: hs.FlightRecord) -> dict[str, Any]:
    facts = {name: one for name, one in record.provenance.items() if name not in _UNSTABLE}
    return json.loads(re.sub(r"\bhelisim(\.\w+)+:", "", json.dumps(facts)))


_PARTS = {"motor": ("drive.governor", "motor"), "inflow": ("main_rotor.inflow", "pitt-peters")}


@cache
def vehicle(name: str, *parts: str, **options: Any) -> Any:
    return hs.load(name, parameters=dict(_PARTS[one] for one in parts) or None, **options)


@dataclasses.dataclass(frozen=True, kw_only=True)
class LockedBump(hs.Excitation):
    """A manoeuvre of one's own."""

    duration: float = 4.0
    amplitude: float | None = None
    width: float = 0.5
    left_open: ClassVar = ("amplitude",)

    def wave(self, time: Any) -> Any:
        return self.amplitude * np.exp(-(((time - 1.5) / self.width) ** 2))


@dataclasses.dataclass(frozen=True, kw_only=True)
class LockedSquare(hs.Mission):
    """A mission of one's own."""

    duration: float = 5.0
    side: float = 1.0

    def fly(self, pilot: Any) -> Iterator[None]:
        pilot.say("go")
        yield from pilot.go(self.side, 0.0, speed=3.0)
        yield from pilot.turn(0.5)


def yaw(seen: Any, state: Any, settings: Any) -> float:
    error = 2.68 * seen.PED - 0.2941 * seen.r
    state[0] += settings[2] * error
    return settings[0] * error + settings[1] * state[0]


def damper(seen: Any, state: Any) -> Any:
    lat = 0.3 * seen.LAT - 0.05 * seen.p - 0.3 * seen.phi
    lon = 0.3 * seen.LON - 0.05 * seen.q - 0.3 * seen.theta
    state[0] += 0.01 * (seen.PED - 0.1 * seen.r)
    left, right = 0.866 * lat - 0.5 * lon, -0.866 * lat - 0.5 * lon
    return seen.COL + lon, seen.COL + left, seen.COL + right, seen.PED - 0.2 * seen.r + state[0]


def controllers() -> dict[str, Case]:
    return {
        "python": lambda: hs.Controller(tail=yaw, states=1, settings=[0.5, 10.0, 0.002]),
        "compiled": lambda: hs.Controller(numba.njit(damper), name="damper"),
        "function": lambda: damper,
        "attitude": lambda: hs.law_of(SETTINGS["law"]["attitude"]),
        "rate": lambda: hs.RateCommand.of(vehicle("jr700")),
        "state_space": lambda: hs.law_of(SETTINGS["law"]["state_space"]),
        "none": lambda: None,
    }


def flown(name: str, plan: Any, *, seed: int = 3, parts: Any = (), **more: Any) -> Any:
    one = vehicle(name, *parts) if isinstance(name, str) else name
    return hs.fly(one, plan, seed=seed, jobs=1, keep_ended=True, **more)[0]


def by_hand(assist: str) -> Any:
    flight = hs.HandFlight(vehicle("jr700"), assist=assist, weather=hs.Weather(turbulence="light"))
    flight.start_recording()
    flight.fly(1.5, lon=-0.3)
    flight.fly(1.0, ped=0.2, lat=0.1, col=0.1)
    return flight.stop_recording(), flight.motion, flight.clearance


def environment(kind: str, count: int = 0, **settings: Any) -> Any:
    if settings.pop("rk4", False):
        settings["vehicle"] = hs.load("jr700", integrator="RK4")
    task = gym.Hover() if kind == "hover" else gym.Track()
    rng = np.random.default_rng(5)
    several = partial(gym.HelicopterVectorEnv, count, max_episode_steps=40)
    env = (several if count else gym.HelicopterEnv)(task=task, **settings)
    shape = (count, 4) if count else (4,)
    out = [env.reset(seed=4)[0]]
    for _ in range(60):
        seen, reward, over, cut, _ = env.step(rng.uniform(-0.3, 0.3, shape))
        out += [seen, np.asarray(reward), np.asarray(over), np.asarray(cut)]
        if not count and over:
            break
    env.close()
    return len(out), digest(*out)


def frames(**options: Any) -> Any:
    aircraft, told = hs.sitl.Aircraft("jr700", recorded=True, **options), []
    for n in range(900):
        pulses = [1500 + min(n // 3, 90), 1500, 1480, 1520, 0, 0, 0, 1000 + min(2 * n, 700)]
        told.append(aircraft.step(pulses))
    record = aircraft.record()
    return record, digest(*(getattr(one, name) for one in told[::50] for name in _SENSED))


_SENSED = ("gyro", "force", "position", "velocity", "quaternion")


def records() -> dict[str, Case]:
    jr = partial(partial, flown, "jr700")
    usual = SETTINGS["plan"]["kind doublet"]
    plans = {
        name: hs.FlightPlan.from_dict(table if "mission" in table else {**usual, **table})
        for name, table in SETTINGS["plan"].items()
    }
    doublet = plans["kind doublet"].excitation
    cases: dict[str, Case] = {}
    for name in ("jr700", "lynx", "blade360"):
        for axis in ("col", "lon", "lat", "ped"):
            sweep = hs.Sweep(axis=axis, duration=5.0, trim_time=1.0)
            cases[f"{name} sweep {axis}"] = partial(flown, name, sweep)
    cases |= {name: jr(one) for name, one in plans.items()}
    cases["ground spin up"] = jr(plans["ground spin up"], parts=("motor",))
    attitude = controllers()["attitude"]()
    cases["at sensors attitude"] = jr(plans["at sensors attitude"], controller=attitude)
    cases |= {
        f"law {name}": lambda made=made: flown("jr700", doublet, controller=made())
        for name, made in controllers().items()
    }
    cases |= {
        "motor": jr(doublet, parts=("motor",)),
        "inflow": jr(doublet, parts=("inflow",)),
        "blade360 motor inflow": partial(flown, "blade360", doublet, parts=("motor", "inflow")),
        "euler": lambda: flown(vehicle("jr700", integrator="Euler"), doublet),
        "timestep": lambda: flown(vehicle("jr700", timestep=0.001), doublet),
        "lynx euler": lambda: flown(vehicle("lynx", integrator="Euler"), doublet),
        "two": lambda: list(hs.fly_each(vehicle("jr700"), doublet, [2, 0], seed=9, jobs=1)),
        "hand hover": partial(by_hand, "hover"),
        "hand level": partial(by_hand, "level"),
        "gym hover": partial(environment, "hover"),
        "gym track servos": partial(environment, "track", action="servos", rk4=True),
        "gym vector": lambda: environment(
            "track", 3, spread=gym.USUAL,
            weather=gym.WeatherRange(wind=4.0, turbulence=6.0, gust=3.0),
        ),
        "sitl direct": frames,
        "sitl turbulent": partial(frames, motor=False, weather=hs.Weather(turbulence="light")),
    }  # fmt: skip
    return cases


def sketch(values: Any) -> list[float]:
    flat = np.ravel(np.asarray(values))
    parts = (flat.real, flat.imag) if np.iscomplexobj(flat) else (flat,)
    wave = 1.0 + 0.5 * np.cos(np.arange(flat.size))
    return [float(part @ wave) for part in parts] + [float(np.abs(flat).sum()), flat.size]


def system(found: Any, without: str = "") -> dict[str, Any]:
    a, b, c, d = (np.asarray(getattr(found, name)) for name in "ABCD")
    points = [np.exp(1j * w * found.dt) if found.dt else 1j * w for w in (0.5, 5.0, 50.0)]
    here = [c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d for s in points]
    labels = {
        name: name != without and list(getattr(found, f"{name}_labels"))
        for name in ("state", "input", "output")
    }
    return labels | {"dt": found.dt, "response": [sketch(row) for one in here for row in one]}


def linear() -> dict[str, Case]:
    def base(name: str, *parts: str) -> Any:
        one = vehicle(name, *parts)
        first, second = one.linearize("IN1"), one.linearize("IN2")
        matrices = {m: np.asarray(getattr(first.system, m)).tolist() for m in "AB"}
        return {
            **{"IN1": system(first.system) | matrices, "IN2": system(second.system)},
            **{"delays": [dict(first.delays), dict(second.delays)], "trim": one.trim},
            **{"derivatives": one.derivatives, "power": [one.power, one.main_power]},
            **{"servo delays": [one.servo_delay(axis) for axis in ("lat", "ped")]},
            **{"imu": one.imu_offset, "digest": one.digest},
            "loops": {axis: system(one.loop(axis), "state") for axis in ("lon", "lat", "ped")},
        }

    def trims(name: str) -> Any:
        made = [vehicle(name).trimmed(speed=speed, height=20.0) for speed in (0.0, 5.0, 15.0)]
        return [[one.trim, one.power] for one in made]

    def rated(law: Any, standard: str) -> Any:
        loop = hs.exact_loop(vehicle("jr700").with_controller(law()))
        found = [spec.criterion.rate(loop) for spec in hs.standard(standard, scale=8.0)]
        return [[one.criterion.name, one.figures, one.level, one.distance] for one in found]

    def measured(at: str) -> Any:
        chirp = hs.Chirp(
            **{"axis": "ped" if at == "actuators" else "phi", "at": at, "duration": 40.0},
            **{"amplitude": 0.05 if at == "actuators" else 0.002, "band": (2.0, 60.0)},
        )
        return hs.margins(flown("jr700", chirp), draws=40).to_dict()

    cases: dict[str, Case] = {}
    for name in ("jr700", "lynx", "blade360"):
        cases |= {name: partial(base, name), f"{name} inflow": partial(base, name, "inflow")}
        cases[f"{name} trims"] = partial(trims, name)
    cases["jr700 motor"] = partial(base, "jr700", "motor")
    laws = {name: controllers()[name] for name in ("attitude", "rate", "state_space")}
    for name, law in laws.items():
        for standard in _STANDARDS:
            cases[f"rated {name} {standard}"] = partial(rated, law, standard)
        cases[f"law {name}"] = lambda law=law: sketch(law().linear(0.002).response(_AT))
    cases |= {f"margins {at}": partial(measured, at) for at in ("actuators", "sensors")}
    return cases


_STANDARDS = ("margins", "disturbance_rejection", "ads33e_target_acquisition")
_AT = np.array([0.5, 5.0, 50.0])


def fitted(fit: Any) -> dict[str, Any]:
    kept = ("value", "cramer_rao", "insensitivity")
    data = fit.to_dict()
    return {
        "parameters": {one["name"]: [one[name] for name in kept] for one in data["parameters"]},
        "correlation": sketch(data["correlation"]),
        "poles": [[p["real"], p["imag"], p["real_error"]] for p in data["modes"]["poles"]],
        "misfit": data["misfit"],
        **{name: data[name] for name in ("costs", "bands_rad_s", "dropped", "delays_s")},
        **{name: data[name] for name in ("converged", "acceptable", "flags", "method")},
        "suspicions": [one.text for one in hs.suspicions(fit)],
    }


@cache
def sweeps(kind: str, axis: str) -> Any:
    if kind == "example":
        return hs.open_example(f"sweep_{axis}")
    return flown("jr700", hs.Sweep(axis=axis, duration=40.0), seed=int(kind[-1]))


@cache
def estimate(kind: str, inputs: Any, outputs: Any, band: Any = (2.0, 25.0), **options: Any) -> Any:
    flights = [sweeps(kind, axis.lower()) for axis in inputs]
    named = {"inputs": inputs, "outputs": outputs, "band": band}
    return hs.frequency_response(flights, **named, **options)


@cache
def fit_of(kind: str, name: str) -> Any:
    structure = hs.structures.named(name)
    return hs.identify(estimate(kind, structure.inputs, structure.outputs), structure, searches=4)


def ident() -> dict[str, Case]:
    def response(*words: Any, **options: Any) -> Any:
        found = estimate(*words, **options)
        arrays = ("frequency", "response", "coherence", "multiple_coherence", "random_error")
        texts = {name: getattr(found, name) for name in ("estimator", "method", "windows", "flags")}
        return texts | {name: sketch(getattr(found, name)) for name in arrays}

    def transfer(structure: str, kind: str = "example", **options: Any) -> Any:
        found = estimate(kind, ("lat",), ("p",), conditioning=("lon", "ped"))
        pair = {"input": "lat", "output": "p"}
        zeros, poles = map(int, structure.split("/"))
        made = hs.structures.transfer_function(zeros=zeros, poles=poles, **pair)
        return fitted(hs.identify(found, made, searches=4, **options))

    def verified(kind: str, name: str, other: str, **options: Any) -> Any:
        fit = fit_of(kind, name)
        found = hs.verify(fit, hs.open_example(other), **options).to_dict()
        return found | {"approach": {**found["approach"], "message": ""}}

    def again() -> Any:
        with tempfile.TemporaryDirectory() as folder:
            fit_of("example", "rollpitch").save(Path(folder, "a.json"))
            return fitted(hs.load_fit(Path(folder, "a.json")))

    both, rates = ("lat", "lon"), ("p", "q")
    cases: dict[str, Case] = {
        "frf local": partial(response, "example", both, rates, conditioning=("col", "ped")),
        "frf composite": partial(response, "example", both, rates, estimator="windows"),
        "frf joint": partial(response, "example", ("ped",), ("r",), reference=("PED",)),
        "frf flown": partial(response, "flown1", both, (*rates, "ax")),
        "saved": again,
        "transfer coherence": lambda: transfer("0/2", weighting="coherence"),
        "transfer band": lambda: transfer("1/2", band=(3.0, 20.0), frequencies_per_response=12),
        "verify rollpitch": partial(verified, "example", "rollpitch", "doublet_lat"),
        "verify yaw": partial(verified, "example", "yaw_base", "doublet_ped"),
        "verify parts": partial(verified, "example", "hover", "doublet_lat", segment=3.0),
    }
    cases |= {f"fit {one}": lambda one=one: fitted(fit_of("example", one)) for one in _FITTED}
    cases |= {f"transfer {one}": partial(transfer, one) for one in ("0/1", "1/2", "1/3")}
    for name in () if FAST[0] else hs.structures.BUILT_IN:
        cases[f"flown {name}"] = lambda name=name: fitted(fit_of("flown1", name))
    return cases


_FITTED = ("heave", "yaw_base", "yaw_sway", "yaw_gyro", "yaw_overall", "rollpitch", "hover")
_FITTED += ("rollpitch_tied", "rollpitch_inflow", "rollpitch_speeds", "hover_inflow")


def reproduce() -> dict[str, Case]:
    def numbers(seed: int, flights: int) -> Any:
        run = hs.reproduce(flights=flights, seed=seed, jobs=1)
        results = run.results.to_dict()
        tables = {one.pop("name"): digest(one) for one in results.pop("tables")}
        fits = {one.name: digest(fitted(one.fit)) for one in run.models}
        flown = run.flights.items()
        kept = {axis: [digest(one.time, one.values) for one in each] for axis, each in flown}
        rest = {name: digest(one) for name, one in results.items() if name != "versions"}
        return {"tables": tables, "fits": fits, "flights": kept, **rest}

    return {f"seed {n}": partial(numbers, n, n) for n in ((1,) if FAST[0] else (1, 2))}


COMMANDS = FILE.with_name("lock_commands.toml")
_TEXTS = (".toml", ".json", ".html", ".parm", ".svg", ".xml", ".md")
_ROOT = str(hs.model_folder("jr700").parents[1])


def run(words: list[str], folder: Path) -> dict[str, Any]:
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), warnings.catch_warnings():
        warnings.simplefilter("default")
        try:
            status: Any = command(words)
        except SystemExit as end:
            status = end.code
        except Exception as error:
            status = f"raised {type(error).__name__}: {error}"
    after = (path for path in sorted(folder.rglob("*")) if path.is_file())
    new = [path for path in after if before.get(path) != path.stat().st_mtime_ns]
    kept = [path for path in new if "__pycache__" not in path.parts]
    written = {str(path.relative_to(folder)): content(path, folder) for path in kept}
    found = {"status": status, "out": out.getvalue(), "err": err.getvalue(), "files": written}
    for name in ("out", "err"):
        found[name] = steady(found[name], folder).splitlines()
    return {name: one for name, one in found.items() if one or name == "status"}


def content(path: Path, folder: Path) -> str:
    if path.suffix == ".parquet":
        try:
            record = hs.read_record(path)
        except Exception:
            return "there"
        return digest(record.time, record.values, plan_of(record))
    if path.suffix not in (*_TEXTS, ".csv", ".txt"):
        return "there"
    return digest(steady(path.read_text(encoding="utf-8"), folder))


def steady(text: str, folder: Path) -> str:
    text = text.replace(str(folder), "TMP").replace(_ROOT, "ROOT")
    text = text.replace(f"helisim {hs.__version__}", "helisim VERSION")
    text = re.sub(r'"versions": *\{[^}]*\}', '"versions": {}', text)
    text = re.sub(r"(?m)^\S+\.py:\d+: (\w*Warning)", r"\1", text)
    text = re.sub(r"(?m)^[^\n]*\d+ of \d+, \d+ s(, [^\n]*)?\n?", "", text)
    return re.sub(r"\bhelisim(\.\w+)+:", "", text)


def commands() -> dict[str, Case]:
    listed = read_toml(COMMANDS)
    lines = [
        line.removeprefix("! ")
        for line in listed["lines"].splitlines()
        if line.startswith("helisim") or (line.startswith("! ") and not FAST[0])
    ]

    @cache
    def all_of_them() -> list[dict[str, Any]]:
        with tempfile.TemporaryDirectory() as made:
            folder = Path(made).resolve()
            for name, text in listed["files"].items():
                (folder / name).write_text(text, encoding="utf-8")
            os.environ["COLUMNS"] = "80"
            with chdir(folder):
                return [run(shlex.split(line)[1:], folder) for line in lines]

    named: dict[str, Case] = {}
    for n, line in enumerate(lines):
        again = lines[:n].count(line)
        named[f"{line} ({again + 1})" if again else line] = lambda n=n: all_of_them()[n]
    return named


def signature(value: Any) -> str:
    try:
        found = inspect.signature(value)
    except (TypeError, ValueError):
        return ""
    bare = [one.replace(annotation=one.empty) for one in found.parameters.values()]
    text = str(found.replace(parameters=bare, return_annotation=found.empty))
    return re.sub(r" at 0x[0-9a-f]+|\b(?:[a-z_]\w*\.)+(?=\w)", "", text)


def public(module: Any) -> list[str]:
    """Return a module's own names, or those of helisim that it imports."""
    return [
        name
        for name, value in vars(module).items()
        if name[0] != "_" and str(getattr(value, "__module__", "")).startswith("helisim")
    ]


def names() -> dict[str, Case]:
    cases: dict[str, Case] = {"__all__": lambda: sorted(hs.__all__)}
    spaces = {"": hs, "gym.": gym, **{f"{n}.": getattr(hs, n) for n in _MODULES}}
    for space, module in spaces.items():
        listed = getattr(module, "__all__", None) or public(module)
        if space:
            cases[space + "__all__"] = lambda listed=listed: sorted(listed)
        for name in listed:
            if callable(value := getattr(module, name)):
                cases[space + name] = partial(signature, value)
    return cases


_MODULES = ("blocks", "criteria", "laws", "missions", "structures", "sitl")


_ALL = (records, linear, ident, reproduce, commands, names)
GROUPS: dict[str, Callable[[], dict[str, Case]]] = {one.__name__: one for one in _ALL}
NEAR = {"linear": 1e-12, "ident": 1e-9}
"""Relative tolerance of the groups whose numbers are written; an optimiser ends in `ident`."""


def differences(found: Any, kept: Any, near: float, where: str = "") -> Iterator[str]:
    if isinstance(found, dict) and isinstance(kept, dict):
        for name in sorted({*found, *kept}):
            inner = f"{where}.{name}" if where else name
            yield from differences(found.get(name), kept.get(name), near, inner)
    elif isinstance(found, list) and isinstance(kept, list) and len(found) == len(kept):
        for n, pair in enumerate(zip(found, kept)):
            yield from differences(*pair, near, f"{where}[{n}]")
    elif found != kept:
        numbers = all(type(one) in (int, float) for one in (found, kept))
        if not (numbers and math.isclose(found, kept, rel_tol=near, abs_tol=near * 1e-3)):
            yield f"{where}: {found!r}, locked {kept!r}"


def value(case: Case) -> Any:
    try:
        return json.loads(json.dumps(plain(case())))
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def read(group: str) -> tuple[Path, dict[str, Any]]:
    """Return the file of a group, and what all of its groups have locked."""
    path = FILE.with_name("lock_commands.json") if group == "commands" else FILE
    return path, json.loads(path.read_text(encoding="utf-8"))


def check(group: str, cases: dict[str, Case], *, show: bool) -> int:
    locked, wrong = read(group)[1].get(group, {}), 0
    for name in [*cases, *(() if FAST[0] else sorted(set(locked) - set(cases)))]:
        found, kept = (value(cases[name]) if name in cases else "no such case"), locked.get(name)
        texts = list(differences(found, kept, NEAR.get(group, 0.0)))
        for key in ("out", "err") if group == "commands" and texts and kept else ():
            pair = (one.get(key, []) for one in (kept, found) if isinstance(one, dict))
            texts = [text for text in texts if not text.startswith(key)]
            texts += list(difflib.unified_diff(*pair, "locked", key, n=1, lineterm=""))
        if len(texts) > 8 and not show:
            texts[8:] = [f"... {len(texts)} lines"]
        for text in texts:
            print(text if group == "commands" else f"{group}: {name}: {text}")
        if texts and group == "commands":
            print(f"^ commands: {name}\n")
        wrong += bool(texts)
    print(f"{group}: {len(cases)} cases, {wrong} differ", flush=True)
    return wrong


def main(what: str, *words: str, fast: bool = False, show: bool = False) -> int:
    FAST[0] = fast
    if what == "check":
        return int(sum(check(one, GROUPS[one](), show=show) for one in words or GROUPS) > 0)
    group, *named = words

    def asked(name: str) -> bool:
        return (name in cases or not fast) and any(fnmatchcase(name, one) for one in named or "*")

    cases, (path, kept) = GROUPS[group](), read(group)
    entries = {n: x for n, x in kept.get(group, {}).items() if n in cases or not asked(n)}
    new = {name: value(case) for name, case in cases.items() if asked(name)}
    entries |= new
    kept[group] = {name: entries[name] for name in [*cases, *entries] if name in entries}
    indent, parts = 1 if path != FILE else None, []
    for name, every in kept.items():
        rows = [f"  {json.dumps(n)}: {json.dumps(x, indent=indent)}" for n, x in every.items()]
        parts.append(f" {json.dumps(name)}: {{\n" + ",\n".join(rows) + "\n }")
    path.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")
    print(f"{group}: {len(new)} cases written", flush=True)
    return 0


if __name__ == "__main__":
    common.run(main)
