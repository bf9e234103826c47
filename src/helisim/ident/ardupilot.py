"""The state-space helicopter that ArduPilot's simulator flies, as its JSON file.

Names, equations and units are those of ArduPilot's pull request 29462, "Add Statespace model
support to SITL": libraries/SITL/SIM_StateSpace.cpp and .h at commit 569e2a2, frame "-heli", and
its files Tools/autotest/models/blade360.json and bell206.json. SI and radians, but delays in ms
and the lean in degrees. Commands are its own: roll, pitch and yaw from -1 to 1, the collective
from 0 to 1, which hovers at (coll_hover - coll_min) / (coll_max - coll_min).
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import parse_object, read_text, write_json
from helisim.base.linear import LinearSystem
from helisim.base.settings import FrozenMap, Value, convert, placed
from helisim.base.units import STANDARD_GRAVITY
from helisim.ident.evaluate import matrices, state_space
from helisim.ident.result import Fit
from helisim.ident.structure import Structure
from helisim.records.record import IN1

if TYPE_CHECKING:
    import control

Place = tuple[str, str]
"""Whose rate of change, by which state or command."""
Real = NDArray[np.float64]

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "a", "b")
_ROWS = {"X": "u", "Y": "v", "Z": "w", "L": "p", "M": "q", "N": "r"}
_STABILITY = "Xu Yv Yp Zw Lu Lv Lp Lq Mu Mv Mp Mq Nv Nw Nr"
_CONTROL = "Xlon Ylat Zcol Llat Llon Mlat Mlon Nped Ncol"
DERIVATIVES: Mapping[str, Place] = FrozenMap(
    {
        **{name: (_ROWS[name[0]], name[1:]) for name in _STABILITY.split()},
        **{"Xa1s": ("u", "a"), "Yb1s": ("v", "b"), "Lb1s": ("p", "b"), "Ma1s": ("q", "a")},
        **{name: (_ROWS[name[0]], name[1:]) for name in _CONTROL.split()},
    }
)
"""Name in the file -> its place."""
FLAPPING: Mapping[str, Place] = FrozenMap(
    {
        **{"Lfa1s": ("b", "a"), "Mfb1s": ("a", "b")},
        **{"Lflt": ("b", "lat"), "Lflg": ("b", "lon")},
        **{"Mflt": ("a", "lat"), "Mflg": ("a", "lon")},
    }
)
"""Likewise of the tip path plane: its steady tilt, longitudinal a and lateral b."""
_DELAYS = {"lat": "rp", "lon": "rp", "ped": "ped", "col": "col"}
DELAYS: Mapping[str, str] = FrozenMap({name: f"time_delay_{key}" for name, key in _DELAYS.items()})
SETTINGS = ("hover_lean", "nominal_rpm", "coll_min", "coll_max", "coll_hover")
UNREAD = ("Lq", "Mp")
"""In its equations, but not among what the commit's loader reads."""
UNUSED = ("Lr", "Yr")
"""Read, and in no equation of a helicopter."""
LONGEST_MS = 100
"""To which its delays are cut."""
NAMES = (*DERIVATIVES, *FLAPPING, "tf", *dict.fromkeys(DELAYS.values()), *SETTINGS)
_MULTIROTOR = ("Lag", "Lead", "thr_hover")
_COMMENT = re.compile(r'^((?:[^"#]|"(?:[^"\\]|\\.)*")*)#.*$', re.MULTILINE)
_FULL = {"col": 1.0, "lon": 0.5, "lat": 0.5, "ped": 0.5}
"""What ArduPilot's 1 is of commands from -0.5 to 0.5; its collective goes from 0 to 1."""
_OWN = {"col": "w", "lon": "q", "lat": "p", "ped": "r"}
_ATTITUDE: dict[Place, float] = {
    **{("phi", "p"): 1.0, ("theta", "q"): 1.0},
    **{("u", "theta"): -STANDARD_GRAVITY, ("v", "phi"): STANDARD_GRAVITY},
}
_TILTED: dict[Place, float] = {("a", "q"): -1.0, ("b", "p"): -1.0}
"""What the simulator has by itself; the latter where a rotor flaps."""
_SAME = 2e-3
"""Relative: by which gravity may differ between places, and rounding."""
_ROTOR_LAG = 0.1
"""s, where nothing flaps: the simulator divides by it."""
_MS = 1e-3


@dataclass(frozen=True, eq=False)
class ArduPilotModel(Value):
    """A helicopter as ArduPilot's state-space simulation has it; linear about the hover.

    Attributes:
        values: number by its name in the file; what isn't there is 0.
        remarks: what the file can't say of the models that it was made of.
        made_by: for the file.

    Raises:
        UnknownNameError: no such number stands in its files.
        InputError: something isn't finite.
    """

    values: Mapping[str, float]
    remarks: tuple[str, ...] = field(default=(), compare=False)
    made_by: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name in self.values:
            if name not in (*NAMES, *UNUSED):
                raise UnknownNameError("number of ArduPilot's model", name, NAMES)
        numbers = {name: convert(float, value, name) for name, value in self.values.items()}
        object.__setattr__(self, "values", FrozenMap(numbers))
        if self._flaps and not numbers.get("tf", 0.0) > 0.0:
            raise InputError(f"tf must be above 0, got {numbers.get('tf', 0.0):g}")

    @classmethod
    def of(
        cls,
        fits: Sequence[Fit],
        *,
        rotor_speed: float,
        hover_lean: float = 0.0,
        hover: float = 0.5,
        full: Mapping[str, float] | None = None,
        late: Mapping[str, float] | None = None,
        others: Mapping[str, float] | None = None,
    ) -> "ArduPilotModel":
        """Return identified models as one of ArduPilot's; where two say one thing, the first does.

        Servos become delays, and flap-back becomes derivatives by the velocities.

        Args:
            fits: identified from servo commands, such as of "rollpitch", "yaw_base" and "heave".
            rotor_speed: rad/s.
            hover_lean: steady bank of the hover, rad.
            hover: collective of the hover, a share of its range.
            full: command -> what ArduPilot's 1 is in the records' unit; by default 0.5, and of
                the whole range of col 1.
            late: channel -> by how much it is recorded late, s, which a delay then leaves out.
            others: further numbers by their names in the file, in its units.

        Raises:
            InputError: a model holds what the file has no place for.
        """
        if not rotor_speed > 0.0 or not 0.0 <= hover <= 1.0:
            raise InputError(
                f"rotor_speed must be above 0 rad/s and hover a share from 0 to 1, got "
                f"{rotor_speed:g} and {hover:g}"
            )
        parts = [(fit.structure, fit.values) for fit in fits]
        numbers, remarks = numbers_of(parts, full=full or {}, late=late or {})
        numbers |= {
            "hover_lean": math.degrees(hover_lean),
            "nominal_rpm": rotor_speed * 30.0 / math.pi,
            "coll_min": 0.0,
            "coll_max": 1.0,
            "coll_hover": hover,
            **(others or {}),
        }
        unread = [name for name in UNREAD if numbers.get(name)]
        if unread:
            remarks.append(f"the loader of commit 569e2a2 doesn't read {', '.join(unread)}")
        names = ", ".join(fit.structure.name for fit in fits)
        return cls(numbers, tuple(remarks), f"helisim: {names}")

    @classmethod
    def read(cls, path: str | PathLike[str]) -> "ArduPilotModel":
        """Read a file, with comments from # on. What ArduPilot doesn't know is passed over.

        Raises:
            StorageError: the file can't be read, or is no JSON.
            InputError: it holds no such helicopter.
        """
        data = parse_object(_COMMENT.sub(r"\1", read_text(path)), str(path))
        rotors = [name for name in _MULTIROTOR if name in data]
        if rotors:
            raise InputError(f"{path}: {', '.join(rotors)} is of a multirotor, not a helicopter")
        known = {key: data[key] for key in (*NAMES, *UNUSED) if key in data}
        if not any(name in known for name in (*DERIVATIVES, *FLAPPING)):
            raise InputError(
                f"{path}: no number of a state-space helicopter is in it, such as Lb1s or Nped"
            )
        with placed(path):
            return cls(known, made_by=str(data.get("made_by", "")))

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file that `sim_vehicle.py -v Copter -f FRAME-heli:FILE` loads.

        Raises:
            StorageError: it can't be written.
        """
        made = {"made_by": self.made_by} if self.made_by else {}
        write_json({**made, **self.values}, path, indent=2)

    @property
    def _flaps(self) -> bool:
        return any(self.values.get(name) for name in ("Lb1s", "Ma1s", "Xa1s", "Yb1s", *FLAPPING))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The commands: col, lon, lat, ped, in ArduPilot's units."""
        return IN1

    @property
    def outputs(self) -> tuple[str, ...]:
        """Velocities, rates and angles."""
        return STATES[:8]

    @property
    def delays(self) -> dict[str, float]:
        """The delay of each command as the simulator has it, s: whole milliseconds, cut."""
        whole = {name: int(self.values.get(DELAYS[name], 0.0)) for name in IN1}
        return {name: 1e-3 * min(LONGEST_MS, max(0, one)) for name, one in whole.items()}

    @property
    def matrices(self) -> tuple[Real, Real]:
        """A, (n_state, n_state), and B, (n_state, 4), about the hover; of `STATES`."""
        n = len(STATES) if self._flaps else len(STATES) - 2
        whole = np.zeros((len(STATES), len(STATES) + len(IN1)))
        entries = {place: self.values.get(name, 0.0) for name, place in DERIVATIVES.items()}
        entries |= _ATTITUDE
        if self._flaps:
            lag = self.values["tf"]
            entries |= {place: self.values.get(name, 0.0) / lag for name, place in FLAPPING.items()}
            entries |= {("a", "a"): -1.0 / lag, ("b", "b"): -1.0 / lag, **_TILTED}
        columns = {name: k for k, name in enumerate((*STATES, *IN1))}
        for (row, column), value in entries.items():
            whole[columns[row], columns[column]] = value
        return whole[:n, :n], whole[:n, len(STATES) :]

    @cached_property
    def _linear(self) -> LinearSystem:
        a, b = self.matrices
        c, d = np.eye(len(self.outputs), len(a)), np.zeros((len(self.outputs), len(IN1)))
        states = STATES[: len(a)]
        return LinearSystem(a, b, c, d, None, IN1, self.outputs, states, delays=self.delays)

    @property
    def system(self) -> "control.StateSpace":
        """It without its delays, from its commands to velocities, rates and angles."""
        return self._linear.to_control()

    def response(self, frequency: Real) -> NDArray[np.complex128]:
        """Return the response with its delays, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
        return self._linear.response(frequency)


def numbers_of(
    parts: Sequence[tuple[Structure, Mapping[str, float]]],
    *,
    full: Mapping[str, float],
    late: Mapping[str, float],
) -> tuple[dict[str, float], list[str]]:
    """Return the file's numbers of some models, and what it can't say of them.

    Args:
        parts: structures with values; where two say one thing, the first does.
        full: command -> what ArduPilot's 1 is, where not as usual.
        late: channel -> by how much it is recorded late, s.

    Raises:
        InputError: a model holds what the file has no place for.
    """
    for name in full:
        if name not in IN1:
            raise UnknownNameError("command", name, IN1)
    entries: dict[Place, float] = {}
    delays: dict[str, float] = {}
    remarks: list[str] = []
    for structure, values in parts:
        own, waits, said = _core(structure, values, late)
        remarks += said
        entries, delays = own | entries, waits | delays
    if not delays:
        raise InputError("no model begins at a servo command (col, lon, lat, ped)")
    per_one = _FULL | dict(full)
    scaled = {(row, by): x * per_one.get(by, 1.0) for (row, by), x in entries.items() if x}
    numbers = {name: scaled[place] for name, place in DERIVATIVES.items() if place in scaled}
    numbers |= _flapping(scaled)
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
    """Return a model without servos and flap-back: its entries, its commands' delays, what is said.

    Raises:
        InputError: it holds what the simulator has no place for.
    """
    for name in structure.inputs:
        if name not in IN1:
            raise InputError(
                f"{structure.name} begins at {name!r}, and ArduPilot's model at servo commands: "
                f"{', '.join(IN1)}"
            )
    system = state_space(structure, values)
    a, b = (np.asarray(one, dtype=np.float64) for one in (system.A, system.B))
    names = list(structure.states)
    own = [names.index(name) for name in STATES if name in names]
    servos = [k for k in range(len(names)) if k not in own]
    behind = np.flatnonzero(np.any(a[np.ix_(servos, own)], axis=1))
    if behind.size:
        told = ", ".join(names[servos[k]] for k in behind)
        raise InputError(f"{structure.name} has {told}, which ArduPilot's model has no state for")
    states = [names[k] for k in own]
    core_a, core_b, lags = a[np.ix_(own, own)], b[own], np.zeros(len(structure.inputs))
    if servos:
        through = a[np.ix_(own, servos)]
        steady = np.linalg.solve(a[np.ix_(servos, servos)], b[servos])
        slow = np.linalg.solve(a[np.ix_(servos, servos)], steady)
        core_b = core_b - through @ steady
        # G(s) = g (1 - s lag + ...), one lag for all that a command moves
        lags = np.sum(core_b * (through @ slow), axis=0) / np.sum(core_b**2, axis=0)
    core_a, folded = _without_flap_back(states, core_a)
    lost, said = [], []
    entries = {
        (row, by): float(value)
        for row, line in zip(states, np.hstack([core_a, core_b]))
        for by, value in zip((*states, *structure.inputs), line)
    }
    known = {*DERIVATIVES.values(), *FLAPPING.values(), ("a", "a"), ("b", "b")}
    by_itself = _ATTITUDE | _TILTED
    for (row, by), value in entries.items():
        its = by_itself.get((row, by))
        if value and its is not None and abs(value / its - 1.0) > _SAME:
            lost.append(f"{value:.4g} in d{row}/dt by {by}, not {its:.4g}")
        elif value and its is None and (row, by) not in known:
            text = f"{value:.2g} in d{row}/dt by {by}"
            if (row, by) in folded:
                said.append(f"{structure.name}: dropped {text}, which flap-back brings")
            else:
                lost.append(text)
    if lost:
        raise InputError(
            f"{structure.name} can't be a model of ArduPilot, which has no {'; '.join(lost)}"
        )
    if servos:
        said.append(f"servos of {structure.name} stand as delays")
    delays = {}
    total = matrices(structure, values).lags + lags
    for k, name in enumerate(structure.inputs):  # to its own rate where the model has it
        outputs = structure.outputs
        output = _OWN[name] if _OWN[name] in outputs else outputs[0]
        delay = float(total[outputs.index(output), k])
        delays[name] = delay - late.get(output, 0.0) + late.get(name, 0.0)
    return entries, delays, said


def _without_flap_back(states: Sequence[str], a: Real) -> tuple[Real, set[Place]]:
    """Return A with the flapping that velocities bring at once in their derivatives.

    The tip path plane follows a velocity within its lag, far faster than that changes.
    """
    flapping = [k for k, name in enumerate(states) if name in ("a", "b")]
    speeds = [k for k, name in enumerate(states) if name in ("u", "v", "w")]
    if not (flapping and speeds and np.any(a[np.ix_(flapping, speeds)])):
        return a, set()
    steady = -np.linalg.solve(a[np.ix_(flapping, flapping)], a[np.ix_(flapping, speeds)])
    moved = a.copy()
    others = [k for k in range(len(states)) if k not in flapping]
    moved[np.ix_(others, speeds)] += a[np.ix_(others, flapping)] @ steady
    moved[np.ix_(flapping, speeds)] = 0.0
    return moved, {(states[j], states[k]) for j in others for k in speeds}


def _flapping(entries: Mapping[Place, float]) -> dict[str, float]:
    """Return the numbers of the tip path plane. Raises InputError."""
    rates = [-entries[name, name] for name in ("a", "b") if (name, name) in entries]
    if not rates:
        return {"tf": _ROTOR_LAG}
    rate = rates[0]
    if not rate > 0.0 or any(abs(one / rate - 1.0) > _SAME for one in rates):
        raise InputError("ArduPilot's rotor has one lag, above 0, for both of its tilts")
    tilts = {name: entries[place] / rate for name, place in FLAPPING.items() if place in entries}
    # a tilted thrust, where the model doesn't say it
    forward, aside = entries.get(("u", "a")), entries.get(("v", "b"))
    return {
        "tf": 1.0 / rate,
        **tilts,
        "Xa1s": -STANDARD_GRAVITY if forward is None else forward,
        "Yb1s": STANDARD_GRAVITY if aside is None else aside,
    }
