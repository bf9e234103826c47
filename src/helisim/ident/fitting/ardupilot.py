"""The state-space helicopter that ArduPilot's simulator flies, as its JSON file.

Names, equations and units are those of ArduPilot's pull request 29462, "Add Statespace model
support to SITL": libraries/SITL/SIM_StateSpace.cpp and .h at commit 569e2a2, frame "-heli", and
its files Tools/autotest/models/blade360.json and bell206.json. SI and radians, but delays in ms
and the lean in degrees. Commands are its own: roll, pitch and yaw from -1 to 1, the collective
from 0 to 1, which hovers at (coll_hover - coll_min) / (coll_max - coll_min).
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.files import parse_object, read_text, write_json
from helisim.base.units import STANDARD_GRAVITY
from helisim.base.value import FrozenMap, Value
from helisim.records.channels import IN1

if TYPE_CHECKING:
    import control

    from helisim.ident.fitting.result import Fit

STATES = ("u", "v", "w", "p", "q", "r", "phi", "theta", "a", "b")
DERIVATIVES: Mapping[str, tuple[str, str]] = FrozenMap(
    {
        **{f"X{x}": ("u", x) for x in ("u",)},
        **{f"Y{x}": ("v", x) for x in ("v", "p")},
        **{f"Z{x}": ("w", x) for x in ("w",)},
        **{f"L{x}": ("p", x) for x in ("u", "v", "p", "q")},
        **{f"M{x}": ("q", x) for x in ("u", "v", "p", "q")},
        **{f"N{x}": ("r", x) for x in ("v", "w", "r")},
        "Xa1s": ("u", "a"),
        "Yb1s": ("v", "b"),
        "Lb1s": ("p", "b"),
        "Ma1s": ("q", "a"),
        "Xlon": ("u", "lon"),
        "Ylat": ("v", "lat"),
        "Zcol": ("w", "col"),
        "Llat": ("p", "lat"),
        "Llon": ("p", "lon"),
        "Mlat": ("q", "lat"),
        "Mlon": ("q", "lon"),
        "Nped": ("r", "ped"),
        "Ncol": ("r", "col"),
    }
)
"""Name in the file -> whose rate of change, by which state or command."""
FLAPPING: Mapping[str, tuple[str, str]] = FrozenMap(
    {
        "Lfa1s": ("b", "a"),
        "Mfb1s": ("a", "b"),
        "Lflt": ("b", "lat"),
        "Lflg": ("b", "lon"),
        "Mflt": ("a", "lat"),
        "Mflg": ("a", "lon"),
    }
)
"""Likewise of the tip path plane: its steady tilt, longitudinal a and lateral b."""
DELAYS: Mapping[str, str] = FrozenMap(
    {
        "lat": "time_delay_rp",
        "lon": "time_delay_rp",
        "ped": "time_delay_ped",
        "col": "time_delay_col",
    }
)
SETTINGS = ("hover_lean", "nominal_rpm", "coll_min", "coll_max", "coll_hover")
UNREAD = ("Lq", "Mp", "Xa1s", "Yb1s")
"""In its equations, and two of them in its files, but not among what the commit's loader reads."""
UNUSED = ("Lr", "Yr")
"""Read, and in no equation of a helicopter."""
LONGEST_MS = 100
"""To which its delays are cut."""
NAMES = (*DERIVATIVES, *FLAPPING, "tf", *dict.fromkeys(DELAYS.values()), *SETTINGS)
_MULTIROTOR = ("Lag", "Lead", "thr_hover")
_COMMENT = re.compile(r'^((?:[^"#]|"(?:[^"\\]|\\.)*")*)#.*$', re.MULTILINE)


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
        for name, value in self.values.items():
            if name not in (*NAMES, *UNUSED):
                raise UnknownNameError("number of ArduPilot's model", name, NAMES)
            real = isinstance(value, int | float) and not isinstance(value, bool)
            if not (real and math.isfinite(value)):
                raise InputError(f"{name} must be a finite number, got {value!r:.60}")
        object.__setattr__(self, "values", FrozenMap(self.values))
        if self._flaps and not self.values.get("tf", 0.0) > 0.0:
            raise InputError(f"tf must be above 0, got {self.values.get('tf', 0.0):g}")

    @classmethod
    def of(
        cls,
        fits: "tuple[Fit, ...] | list[Fit]",
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
        from helisim.ident.fitting.ardupilot_fit import numbers_of

        settings = {
            "hover_lean": math.degrees(hover_lean),
            "nominal_rpm": rotor_speed * 30.0 / math.pi,
            "coll_min": 0.0,
            "coll_max": 1.0,
            "coll_hover": hover,
        }
        if not rotor_speed > 0.0 or not 0.0 <= hover <= 1.0:
            raise InputError(
                f"rotor_speed must be above 0 rad/s and hover a share from 0 to 1, got "
                f"{rotor_speed:g} and {hover:g}"
            )
        parts = [(fit.structure, fit.values) for fit in fits]
        numbers, remarks = numbers_of(parts, full=full or {}, late=late or {})
        numbers |= settings | dict(others or {})
        unread = [name for name in UNREAD[:2] if numbers.get(name)]
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
        known: dict[str, Any] = {key: data[key] for key in (*NAMES, *UNUSED) if key in data}
        if not any(name in known for name in (*DERIVATIVES, *FLAPPING)):
            raise InputError(
                f"{path}: no number of a state-space helicopter is in it, such as Lb1s or Nped"
            )
        try:
            return cls(known, made_by=str(data.get("made_by", "")))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

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
    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A, (n_state, n_state), and B, (n_state, 4), about the hover; of `STATES`."""
        n = len(STATES) if self._flaps else len(STATES) - 2
        whole = np.zeros((len(STATES), len(STATES) + len(IN1)))
        columns = {name: k for k, name in enumerate((*STATES, *IN1))}
        g = STANDARD_GRAVITY
        fixed = {("phi", "p"): 1.0, ("theta", "q"): 1.0, ("u", "theta"): -g, ("v", "phi"): g}
        entries = {place: self.values.get(name, 0.0) for name, place in DERIVATIVES.items()} | fixed
        if self._flaps:
            lag = self.values["tf"]
            entries |= {place: self.values.get(name, 0.0) / lag for name, place in FLAPPING.items()}
            entries |= {("a", "a"): -1.0 / lag, ("b", "b"): -1.0 / lag}
            entries |= {("a", "q"): -1.0, ("b", "p"): -1.0}
        for (row, column), value in entries.items():
            whole[columns[row], columns[column]] = value
        return whole[:n, :n], whole[:n, len(STATES) :]

    @property
    def system(self) -> "control.StateSpace":
        """It without its delays, from its commands to velocities, rates and angles."""
        import control  # which brings pyplot

        a, b = self.matrices
        c = np.eye(len(self.outputs), len(a))
        names = {"states": list(STATES[: len(a)]), "inputs": list(IN1)}
        return control.StateSpace(
            a, b, c, 0.0, outputs=list(self.outputs), remove_useless_states=False, **names
        )

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response with its delays, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
        a, b = self.matrices
        point = 1j * np.asarray(frequency, dtype=np.float64)
        states = np.linalg.solve(point[:, None, None] * np.eye(len(a)) - a, b[None])
        late = np.exp(-point[:, None] * np.array([self.delays[name] for name in IN1]))
        found = np.moveaxis(states[:, : len(self.outputs)] * late[:, None], 0, -1)
        return np.asarray(found, dtype=np.complex128)
