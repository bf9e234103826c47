"""Writes the state-space helicopter of ArduPilot's simulator as its JSON file.

Source: ArduPilot's pull request 29462 at commit 569e2a2, libraries/SITL/SIM_StateSpace.cpp.
SI and radians, but delays in ms and the lean in degrees. Commands of roll, pitch and yaw are -1 to
1, the mixer's; the collective is 0 to 1, and hovers at (coll_hover - coll_min) / (coll_max -
coll_min).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import InputError, check_known
from helisim.base.files import write_json
from helisim.base.note import Option
from helisim.base.settings import FrozenMap, Value, convert
from helisim.base.units import RAD_S_PER_RPM, STANDARD_GRAVITY
from helisim.ident.conditions import FACTS
from helisim.ident.evaluate import linear
from helisim.ident.result import Fit
from helisim.ident.structure import Structure
from helisim.records.record import IN1

Place = tuple[str, str]  # State whose rate of change it is, and state or command that causes it

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "a", "b")
_ROWS = {"X": "u", "Y": "v", "Z": "w", "L": "p", "M": "q", "N": "r"}
_NAMED = (
    "Xu Yv Yp Zw Lu Lv Lp Lq Mu Mv Mp Mq Nv Nw Nr Xa1s Yb1s Lb1s Ma1s "
    "Xlon Ylat Zcol Llat Llon Mlat Mlon Nped Ncol"
)
DERIVATIVES: Mapping[str, Place] = FrozenMap(
    {name: (_ROWS[name[0]], name[1:].removesuffix("1s")) for name in _NAMED.split()}
)  # Name in the file -> its place
FLAPPING: Mapping[str, Place] = FrozenMap(
    {
        **{"Lfa1s": ("b", "a"), "Mfb1s": ("a", "b")},
        **{"Lflt": ("b", "lat"), "Lflg": ("b", "lon")},
        **{"Mflt": ("a", "lat"), "Mflg": ("a", "lon")},
    }
)  # The same for the tip path plane's steady tilt, longitudinal a and lateral b
DELAYS: Mapping[str, str] = FrozenMap(
    {
        **dict.fromkeys(("lat", "lon"), "time_delay_rp"),
        **{"ped": "time_delay_ped", "col": "time_delay_col"},
    }
)
SETTINGS = ("hover_lean", "nominal_rpm", "coll_min", "coll_max", "coll_hover")
UNREAD = ("Lq", "Mp")  # in the equations, but not read by that commit's loader
LONGEST_MS = 100  # longest delay
NAMES = (*DERIVATIVES, *FLAPPING, "tf", *dict.fromkeys(DELAYS.values()), *SETTINGS)
_OPTIONS = {
    "rotor_speed": Option("rpm", "RPM"),
    "hover": Option("hover", "SHARE"),
    "lean": Option("lean", "DEG"),
}  # Facts of `FACTS` that the file needs, and what says them
_OWN = {"col": "w", "lon": "q", "lat": "p", "ped": "r"}
_BY_ITSELF: dict[Place, float] = {
    **{("phi", "p"): 1.0, ("theta", "q"): 1.0},
    **{("u", "theta"): -STANDARD_GRAVITY, ("v", "phi"): STANDARD_GRAVITY},
    **{("a", "q"): -1.0, ("b", "p"): -1.0},
}  # What attitudes and tilts do, whatever the file says
_SAME = 2e-3  # relative difference of gravity between places, and rounding
_APART = 0.02  # relative difference of flights' rotor speeds, or what else, above which it is said
_ROTOR_LAG, _MS = 0.1, 1e-3  # s, where nothing flaps: the simulator divides by it; a millisecond


@dataclass(frozen=True, eq=False)
class ArduPilotModel(Value):
    """A helicopter of ArduPilot's state-space simulation, linear about the hover.

    `values` are by name in the file, 0 where left out; `remarks` list what the file can't hold.
    """

    values: Mapping[str, float]
    remarks: tuple[str, ...] = field(default=(), compare=False)
    made_by: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        check_known("number of ArduPilot's model", self.values, NAMES)
        numbers = {name: convert(float, value, name) for name, value in self.values.items()}
        object.__setattr__(self, "values", FrozenMap(numbers))
        flaps = any(numbers.get(name) for name in ("Lb1s", "Ma1s", "Xa1s", "Yb1s", *FLAPPING))
        if flaps and not numbers.get("tf", 0.0) > 0.0:
            raise InputError(f"tf must be above 0, got {numbers.get('tf', 0.0):g}")

    @classmethod
    def of(
        cls,
        fits: Sequence[Fit],
        *,
        rotor_speed: float | None = None,
        hover_lean: float | None = None,
        hover: float | None = None,
        full: Mapping[str, float] | None = None,
        late: Mapping[str, float] | None = None,
    ) -> "ArduPilotModel":
        """Return identified models as one of ArduPilot's; earlier fits take precedence.

        What isn't given is what the fits say of their flights: `fit.data.conditions`.

        Args:
            fits: from servo commands; their servos become delays.
            rotor_speed: rad/s.
            hover_lean: steady bank of the hover, rad, to the right.
            hover: collective of the hover, a share of its range.
            full: command -> its value at ArduPilot's 1, in the unit of the fits' channel.
            late: channel -> delay of its recording, s, which is subtracted.

        Raises InputError if a model holds what the file has no place for, or if neither the fits
        nor the arguments say a command's full travel, rotor speed, hover collective or lean.
        """
        given = {"rotor_speed": rotor_speed, "hover": hover, "lean": hover_lean}
        facts, remarks = _facts(fits, given, full or {})
        if not facts["rotor_speed"] > 0.0 or not 0.0 <= facts["hover"] <= 1.0:
            raise InputError(
                f"rotor_speed must be above 0 rad/s and hover a share from 0 to 1, got "
                f"{facts['rotor_speed']:g} and {facts['hover']:g}"
            )
        numbers, lost = numbers_of(
            [
                (fit.structure, fit.values, {**fit.data.conditions.full, **(full or {})})
                for fit in fits
            ],
            late=late or {},
        )
        numbers |= {
            "hover_lean": math.degrees(facts["lean"]),
            "nominal_rpm": facts["rotor_speed"] / RAD_S_PER_RPM,
            "coll_min": 0.0,
            "coll_max": 1.0,
            "coll_hover": facts["hover"],
        }
        unread = [name for name in UNREAD if numbers.get(name)]
        if unread:
            lost.append(f"the loader of commit 569e2a2 doesn't read {', '.join(unread)}")
        return cls(
            numbers,
            (*remarks, *lost),
            f"helisim: {', '.join(fit.structure.name for fit in fits)}",
        )

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file for `sim_vehicle.py -v Copter -f FRAME-heli:FILE`. Raises StorageError."""
        made = {"made_by": self.made_by} if self.made_by else {}
        write_json({**made, **self.values}, path, indent=2)


def _facts(
    fits: Sequence[Fit], given: Mapping[str, float | None], full: Mapping[str, float]
) -> tuple[dict[str, float], list[str]]:
    """Return rotor speed, hover and lean, given or else the fits', and remarks on their origin.

    Raises InputError that names all that neither says, full travel too.
    """
    check_known("command", full, IN1)
    facts = {name: value for name, value in given.items() if value is not None}
    said, unknown, remedy = [], [], []
    for fit in fits:
        own, names = fit.data.conditions, [one for one in fit.structure.inputs if one not in full]
        lacks = [one for one in names if one in IN1 and one not in own.full]
        if lacks:
            unknown.append(f"full travel of {', '.join(lacks)} of {fit.structure.name}")
            remedy.append(Option("full", ",".join(f"{one}=X" for one in lacks)))
        scales = ", ".join(f"{one} {own.full[one]:g}" for one in names if one in own.full)
        if scales:
            said.append(f"ArduPilot's 1 is {scales} of {fit.structure.name} ({own.why('full')})")
    for name in (name for name in _OPTIONS if name not in facts):
        own = [one for fit in fits if getattr(one := fit.data.conditions, name) is not None]
        if not own:
            why = dict.fromkeys(fit.data.conditions.why(name) for fit in fits)
            unknown.append(f"{FACTS[name]} ({'; '.join(why)})")
            remedy.append(_OPTIONS[name])
            continue
        facts[name] = value = getattr(own[0], name)
        said.append(own[0].words(name))
        others = [one for one in own if abs(getattr(one, name) - value) > _APART * abs(value)]
        if others:
            said.append(f"another model was flown at another {others[0].words(name)}")
    if unknown:
        raise InputError(
            f"the file needs what neither the models nor the arguments say: {'; '.join(unknown)}",
            remedy=remedy,
        )
    return facts, said


def numbers_of(
    parts: Sequence[tuple[Structure, Mapping[str, float], Mapping[str, float]]],
    *,
    late: Mapping[str, float],
) -> tuple[dict[str, float], list[str]]:
    """Return the file's numbers, and remarks, of structures with values and full commands.

    The last are command -> its value at ArduPilot's 1, of every input. Raises InputError, as
    `ArduPilotModel.of`.
    """
    entries: dict[Place, float] = {}
    delays: dict[str, float] = {}
    remarks: list[str] = []
    for structure, values, full in parts:
        own, waits, said = _core(structure, values, late)
        remarks += said
        scaled = {(row, by): x * full.get(by, 1.0) for (row, by), x in own.items() if x}
        entries, delays = scaled | entries, waits | delays
    if not delays:
        raise InputError("no model begins at a servo command (col, lon, lat, ped)")
    numbers = {name: entries[place] for name, place in DERIVATIVES.items() if place in entries}
    numbers |= _flapping(entries)
    for key in dict.fromkeys(DELAYS[name] for name in delays):
        lags = {name: delay / _MS for name, delay in delays.items() if DELAYS[name] == key}
        whole = min(LONGEST_MS, max(0, round(sum(delays[name] for name in lags) / len(lags) / _MS)))
        numbers[key] = float(whole)
        if any(abs(lag - whole) > 0.5 for lag in lags.values()):
            said = ", ".join(f"{lag:.1f} ms of {name}" for name, lag in lags.items())
            remarks.append(f"{key} = {whole} stands for {said}")
    return numbers, remarks


def _core(
    structure: Structure, values: Mapping[str, float], late: Mapping[str, float]
) -> tuple[dict[Place, float], dict[str, float], list[str]]:
    """Return entries without servos, commands' delays, remarks. Raises InputError."""
    for name in structure.inputs:
        if name not in IN1:
            raise InputError(
                f"{structure.name} begins at {name!r}, and ArduPilot's model at servo commands: "
                f"{', '.join(IN1)}"
            )
    model, names = linear(structure, values), list(structure.states)
    a, b = model.a, model.b
    own = [names.index(name) for name in STATES if name in names]
    servos = [k for k in range(len(names)) if k not in own]
    behind = np.flatnonzero(np.any(a[np.ix_(servos, own)], axis=1))
    if behind.size:
        told = ", ".join(names[servos[k]] for k in behind)
        raise InputError(f"{structure.name} has {told}, which ArduPilot's model has no state for")
    if not own:
        raise InputError(
            f"{structure.name} has none of the states of ArduPilot's model: {', '.join(STATES)}"
        )
    states, lags = [names[k] for k in own], np.zeros(len(structure.inputs))
    core = model.residualised(states)
    if servos:
        inner = a[np.ix_(servos, servos)]
        slow = np.linalg.solve(inner, np.linalg.solve(inner, b[servos]))
        # G(s) = g (1 - s lag + ...), one lag for all that a command moves
        moved = core.b * (a[np.ix_(own, servos)] @ slow)
        lags = np.sum(moved, axis=0) / np.sum(core.b**2, axis=0)
    lost, said = [], [f"servos of {structure.name} stand as delays"] if servos else []
    whole, flapped = _without_flap_back(states, core.a)
    if flapped:
        said.append(f"flap-back of {structure.name} stands as {flapped}")
    entries = {
        (row, by): float(value)
        for row, line in zip(states, np.hstack([whole, core.b]))
        for by, value in zip((*states, *structure.inputs), line)
    }
    known = {*DERIVATIVES.values(), *FLAPPING.values(), ("a", "a"), ("b", "b")}
    for (row, by), value in entries.items():
        its = _BY_ITSELF.get((row, by))
        if value and its is not None and abs(value / its - 1.0) > _SAME:
            lost.append(f"{value:.4g} in d{row}/dt by {by}, not {its:.4g}")
        elif value and its is None and (row, by) not in known:
            lost.append(f"{value:.2g} in d{row}/dt by {by}")
    if lost:
        raise InputError(
            f"{structure.name} can't be a model of ArduPilot, which has no {'; '.join(lost)}"
        )
    delays = {}
    for name, lag in zip(structure.inputs, lags.tolist()):
        # to its own rate where the model has it
        output = _OWN[name] if _OWN[name] in structure.outputs else structure.outputs[0]
        delay = model.output_delays[output] + model.delays[name] + lag
        delays[name] = delay - late.get(output, 0.0) + late.get(name, 0.0)
    return entries, delays, said


def _without_flap_back(states: Sequence[str], a: Real) -> tuple[Real, str]:
    """Return a state matrix without flap-back, and in words what became of it; "" if it had none.

    In an airspeed the disc rests tilted: the moments and forces of that tilt are added to the
    derivatives by the velocities, and what the file has no place for is left out.
    """
    tilts, ways = ([k for k, name in enumerate(states) if name in of] for of in ("ab", "uv"))
    if not np.any(a[np.ix_(tilts, ways)]):
        return a, ""
    whole, rest = a.copy(), np.linalg.solve(a[np.ix_(tilts, tilts)], a[np.ix_(tilts, ways)])
    whole[:, ways] -= a[:, tilts] @ rest
    across = [(k, one) for k in ways for one in ways if k != one]
    lost = ", ".join(f"{whole[at]:.2g} in d{states[at[0]]}/dt by {states[at[1]]}" for at in across)
    for at in (*across, np.ix_(tilts, ways)):
        whole[at] = 0.0
    return whole, f"derivatives by the velocities, which have no place for {lost}"


def _flapping(entries: Mapping[Place, float]) -> dict[str, float]:
    """Return the numbers of the tip path plane. Raises InputError."""
    rates = [-entries[name, name] for name in ("a", "b") if (name, name) in entries]
    if not rates:
        return {"tf": _ROTOR_LAG}
    rate = rates[0]
    if not rate > 0.0 or any(abs(one / rate - 1.0) > _SAME for one in rates):
        raise InputError("ArduPilot's rotor has one lag, above 0, for both of its tilts")
    tilts = {name: entries[place] / rate for name, place in FLAPPING.items() if place in entries}
    # a tilted thrust, where the model has none
    forward, aside = entries.get(("u", "a")), entries.get(("v", "b"))
    return {
        "tf": 1.0 / rate,
        **tilts,
        "Xa1s": -STANDARD_GRAVITY if forward is None else forward,
        "Yb1s": STANDARD_GRAVITY if aside is None else aside,
    }
