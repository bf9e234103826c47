"""A vehicle's parameters: named values with units and sources; and what a pilot sets of them."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from helisim.base.errors import InputError, ModelError, StorageError, UnknownNameError
from helisim.base.files import read_toml
from helisim.vehicle.choices import CHOICES, number_of, word_of
from helisim.vehicle.glossary import glossary, sections, term
from helisim.vehicle.written_unit import unit_fault


@dataclass(frozen=True)
class PhysicalParameter:
    """One physical parameter: dotted name, value, unit (SI) and source."""

    name: str
    value: float
    unit: str
    source: str


class Parameters(Mapping[str, float]):
    """Values by dotted name, such as `main_rotor.lift_slope`. Read-only.

    Raises:
        UnknownNameError: on a name that does not exist; the message lists those that do.
    """

    def __init__(self, entries: Mapping[str, PhysicalParameter]) -> None:
        self._entries = dict(entries)

    def __getitem__(self, name: str) -> float:
        return self.entry(name).value

    def __repr__(self) -> str:
        sections = dict.fromkeys(name.split(".")[0] for name in self)
        return f"Parameters({len(self)} of {', '.join(sections)})"

    def __hash__(self) -> int:
        return hash(frozenset(self.items()))

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        return name in self._entries

    def entry(self, name: str) -> PhysicalParameter:
        """Return value, unit and source of one parameter."""
        try:
            return self._entries[name]
        except KeyError:
            raise UnknownNameError("parameter", name, sorted(self._entries)) from None

    def word(self, name: str) -> str | float:
        """Return what is chosen of a parameter's `CHOICES`, such as "ideal"; else its number."""
        return word_of(name, self[name])

    def replace(
        self, changes: Mapping[str, float | str], source: str = "set by the user"
    ) -> "Parameters":
        """Return a copy with some values changed, and with them what was left out to be as they.

        Raises:
            UnknownNameError: no such parameter.
            InputError: a value is not a finite number, or not among the words that it can be.
        """
        entries = dict(self._entries)
        for name, value in changes.items():
            old = self.entry(name)
            entries[name] = PhysicalParameter(name, number_of(name, value), old.unit, source)
        for name, other in _AS.items():
            follows = name in entries and entries[name].source == f"{_NOT_GIVEN}as {other}"
            if follows and other in changes:
                entries[name] = dataclasses.replace(entries[name], value=entries[other].value)
        return Parameters(entries)


def read_parameters(*paths: Path) -> Parameters:
    """Read parameter files (TOML); a later file adds to the earlier ones.

    Raises:
        ModelError: a file is missing or malformed, or a name is defined twice.
    """
    entries: dict[str, PhysicalParameter] = {}
    for path in paths:
        for name, entry in _read(path).items():
            if name in entries:
                raise ModelError(f"{path}: parameter {name!r} is already defined")
            entries[name] = entry
    return Parameters(entries)


_SWASH_SERVOS = ("front", "left", "right")

_UNTUNED = {
    "gyro.ped_latency": (0.0, "s"),
    "gyro.kp_lat": (0.0, "s/rad"),
    "gyro.kp_lon": (0.0, "s/rad"),
    "gyro.ki_lat": (1.0, "1/rad"),
    "gyro.ki_lon": (1.0, "1/rad"),
    "gyro.kd_lat": (0.0, "s^2/rad"),
    "gyro.kd_lon": (0.0, "s^2/rad"),
    "gyro.phase": (0.0, "rad"),
    "gyro.k_p": (0.0, "1"),
    "gyro.k_i": (1.0, "1/s"),
    "gyro.k_delta": (1.0, "1"),
    "gyro.k_a": (0.1, "s/rad"),
    "gyro.p_per_lat": (1.0, "rad/s"),
    "gyro.p_per_lon": (0.0, "rad/s"),
    "gyro.q_per_lat": (0.0, "rad/s"),
    "gyro.q_per_lon": (1.0, "rad/s"),
}


def untuned(parameters: Parameters) -> Parameters:
    """Return the parameters with plain values for what is missing of the gyro's settings.

    A vehicle can be calibrated and its gyro tuned with them; to fly it needs tuned ones.
    """
    plain = {
        name: PhysicalParameter(name, value, unit, "not tuned yet")
        for name, (value, unit) in _UNTUNED.items()
    }
    return Parameters({**plain, **{name: parameters.entry(name) for name in parameters}})


_CHANNELS = {"front": 1.0, "left": 2.0, "right": 3.0, "tail": 4.0, "rotor": 8.0}
"""Of an autopilot, for the servos and the motor."""
_NOT_GIVEN = "not given: "
_LEFT_OUT = {
    "airframe.ixz": (0.0, "kg m^2", "symmetric fore and aft"),
    "main_rotor.direction": (1.0, "1", "clockwise seen from above"),
    "main_rotor.hub_cross": (0.0, "N m/rad", "the springs' moment is in phase with the tilt"),
    "main_rotor.twist": (0.0, "rad", "blades without twist"),
    "main_rotor.inflow": (0.0, "1", "the air follows the blades' load at once"),
    "drive.governor": (0.0, "1", "the rotor keeps the speed that is asked for"),
    **{
        f"drive.{name}": (0.0, unit, "the governor is ideal")
        for name, unit in {
            "engine": "1",
            "inertia": "kg m^2",
            "friction": "N m",
            "gear": "1",
            "voltage": "V",
            "speed_constant": "rad/s/V",
            "resistance": "ohm",
            "no_load_current": "A",
            "current_limit": "A",
            "power": "W",
            "power_speed": "rad/s",
            "lag": "s",
            "k_p": "1",
            "k_i": "1/s",
            "collective_gain": "1",
            "spool_up": "s",
            "bail_out": "s",
        }.items()
    },
    "swashplate.front_angle": (0.0, "rad", "at the nose"),
    "swashplate.left_angle": (2.0 * math.pi / 3.0, "rad", "120 degrees from the front one"),
    "swashplate.right_angle": (-2.0 * math.pi / 3.0, "rad", "120 degrees from the front one"),
    **{f"swashplate.{name}_arm": (1.0, "1", "all arms are equal") for name in _SWASH_SERVOS},
    **{f"swashplate.{name}_sign": (1.0, "1", "none is reversed") for name in _SWASH_SERVOS},
    **{
        f"outputs.{name}_channel": (number, "1", "as ArduPilot numbers them")
        for name, number in _CHANNELS.items()
    },
    **{
        f"outputs.{name}_{what}": (value, "s", "usual for servos")
        for what, value in {"trim": 1.5e-3, "travel": 0.5e-3}.items()
        for name in (*_SWASH_SERVOS, "tail")
    },
    "outputs.rotor_trim": (1e-3, "s", "usual for speed controllers"),
    "outputs.rotor_travel": (0.7e-3, "s", "the nominal speed at 70 %, as ArduPilot has it"),
    "airframe.drag_centre_x": (0.0, "m", "at the centre of gravity"),
    "airframe.drag_centre_z": (0.0, "m", "at the centre of gravity"),
    "airframe.pitch_volume": (0.0, "m^3", "no moment of the fuselage"),
    "airframe.pitch_zero": (0.0, "rad", "none level with the flow"),
    "airframe.tail_wash": (1.0, "1", "as that of vortex rings"),
    "airframe.yaw_volume": (0.0, "m^3", "no moment of the fuselage"),
    "airframe.download": (0.0, "1", "no wash on the fuselage"),
    "main_rotor.shaft_tilt": (0.0, "rad", "upright"),
    "tail_rotor.blockage": (0.0, "1", "nothing in its way"),
    "tail_rotor.direction": (1.0, "1", "the lower blade moves forwards"),
    "fin.area": (0.0, "m^2", "no fin"),
    "fin.aspect_ratio": (2.6, "1", "a fin that the tail case halves"),
    "fin.incidence": (0.0, "rad", "straight ahead"),
    "fin.stall": (1.17, "1", "a flat plate"),
    "tailplane.area": (0.0, "m^2", "no tailplane"),
    "tailplane.aspect_ratio": (4.0, "1", "a slender one"),
    "tailplane.incidence": (0.0, "rad", "level"),
    "tailplane.stall": (1.17, "1", "a flat plate"),
}
_AS = {
    "tail_rotor.induced_factor": "main_rotor.induced_factor",
    "tail_rotor.profile_drag": "main_rotor.profile_drag",
    "fin.x": "tail_rotor.arm_x",
    "fin.z": "tail_rotor.arm_z",
    "tailplane.x": "tail_rotor.arm_x",
    "tailplane.z": "tail_rotor.arm_z",
}
"""What a vehicle may leave out -> parameter whose value it then has."""
_FORMER = {"airframe.fin_area": "fin.area"}
"""Former name of a parameter, still read -> its name."""


def completed(parameters: Parameters) -> Parameters:
    """Return the parameters with what a vehicle may leave out, and none under a former name.

    Raises:
        ModelError: a parameter stands there under its name and its former one.
    """
    given = {name: parameters.entry(name) for name in parameters}
    for former, name in _FORMER.items():
        if former in given and name in given:
            raise ModelError(f"{former} is the former name of {name}: leave one of them out")
        if former in given:
            given[name] = dataclasses.replace(given.pop(former), name=name)
    for name, (value, unit, meaning) in _LEFT_OUT.items():
        given.setdefault(name, PhysicalParameter(name, value, unit, f"{_NOT_GIVEN}{meaning}"))
    for name, other in _AS.items():
        if name not in given and other in given:
            given[name] = dataclasses.replace(
                given[other], name=name, source=f"{_NOT_GIVEN}as {other}"
            )
    return Parameters(given)


def _read(path: Path) -> dict[str, PhysicalParameter]:
    try:
        content = read_toml(path)
    except StorageError as error:
        raise ModelError(f"can't read parameters: {error}") from None
    entries = {}
    content.pop("roles", None)  # names, which `helisim.vehicle.roles` reads
    for section, members in content.items():
        if not isinstance(members, dict):
            raise ModelError(f"{path}: {section} must stand in a section, such as [air]")
        for key, item in members.items():
            name = f"{section}.{key}"
            try:
                entries[name] = PhysicalParameter(
                    name, plain_number(name, item["value"]), str(item["unit"]), str(item["source"])
                )
            except InputError as error:
                raise ModelError(f"{path}: {error}") from None
            except (TypeError, KeyError, ValueError):
                raise ModelError(
                    f"{path}: {name} needs value (a number), unit and source, got {item!r}"
                ) from None
            if not math.isfinite(entries[name].value):
                raise ModelError(f"{path}: {name} must be finite, got {item['value']!r}")
            fault = name_fault(name) or unit_fault_of(entries[name])
            if fault:
                raise ModelError(f"{path}: {fault}")
    return entries


def plain_number(name: str, value: object) -> float:
    """Return the value of a parameter as its file has it.

    Raises:
        TypeError: text, or true or false.
        InputError: it is a choice, and of other words.
    """
    if name in CHOICES:
        return number_of(name, value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return float(value)


def name_fault(name: str) -> str:
    """Return what is wrong with a parameter's name, "" if nothing is.

    A section that no vehicle has is its author's own, and left alone.
    """
    section, key = name.split(".")
    if section not in sections() or term(name):
        return ""
    keys = [known.split(".")[1] for known in glossary() if known.startswith(f"{section}.")]
    return str(UnknownNameError(f"parameter of [{section}]", key, keys))


def unit_fault_of(entry: PhysicalParameter) -> str:
    """Return what is wrong with a parameter's unit, "" if nothing is."""
    known = term(entry.name)
    fault = unit_fault(entry.unit, entry.value, known.unit) if known else ""
    return f"{entry.name} {fault}" if fault else ""


def to_toml(
    parameters: Parameters,
    header: str,
    *,
    comment: Callable[[str], Iterable[str]] = lambda _: (),
) -> str:
    """Return parameters as the text of a parameter file, sections in order of appearance.

    Args:
        parameters: to be written.
        header: lines of the comment at the head.
        comment: returns the lines of the comment above a parameter, by its name.
    """
    lines = [f"# {line}".rstrip() for line in header.splitlines()]
    for section in dict.fromkeys(name.split(".")[0] for name in parameters):
        lines += ["", f"[{section}]"]
        for name in parameters:
            prefix, key = name.split(".")
            if prefix != section:
                continue
            entry = parameters.entry(name)
            lines += [f"# {line}" for line in comment(name)]
            value = word_of(name, entry.value)
            written = json.dumps(value) if isinstance(value, str) else repr(value)
            lines.append(
                f"{key} = {{ value = {written}, unit = {json.dumps(entry.unit)}, "
                f"source = {json.dumps(entry.source)} }}"
            )
    return "\n".join(lines) + "\n"


_CHOICES = {
    "gyro.flight_mode": (1, 2, 3),
    "gyro.heading_lock": (0, 1),
    "gyro.anti_windup": (0, 1),
}
_RATES = tuple(
    f"{section}.{rate}"
    for section in ("gyro", "gyro_tuned")
    for rate in ("pitch_rate", "elevator_rate", "aileron_rate")
)


def check_settings(values: Mapping[str, float]) -> None:
    """Check what a pilot can set on the gyro, by dotted names; other names are not looked at.

    Raises:
        InputError: a setting that the gyro does not have.
    """
    for name, choices in _CHOICES.items():
        if name in values and values[name] not in choices:
            listed = ", ".join(map(str, choices))
            raise InputError(f"{name} must be one of {listed}, got {values[name]:g}")
    for name in _RATES:
        if name in values and not 0.0 < values[name] <= 1.0:
            raise InputError(
                f"{name} must be above 0 and at most 1, the whole travel, got {values[name]:g}"
            )


@dataclass(frozen=True, kw_only=True)
class GyroSettings:
    """What a pilot sets on a three-axis gyro such as the CGY750; the defaults are the paper's.

    The paper (Wu and Chen, section 2) names them and gives no meaning. The CGY750's manual has
    "Swash AFR (rate)" among the basic settings of the swashplate: travel of aileron, elevator and
    pitch, as share of the whole. Its flight modes are F3C, sports and 3D; that they count 1, 2, 3
    in this order, and what they do inside, is chosen here.

    Attributes:
        flight_mode: how firmly roll and pitch attitude are kept. The cyclic integral is
            multiplied by (flight_mode - 1) / 2: 3 (3D) locks the attitude, 2 (sports) does so
            with half the gain, 1 (F3C) only damps the rates, as a stabilizer bar does, and
            keeps the swashplate's trim.
        pitch_rate: travel of the collective, above 0 to 1. Collective at the swashplate is the
            stick times pitch_rate over the rate at which the gains hold, 0.4.
        elevator_rate: travel of the longitudinal stick, above 0 to 1. The roll and pitch rates
            that it commands are multiplied by elevator_rate / 0.6.
        aileron_rate: travel of the lateral stick, above 0 to 1; likewise.
        heading_lock: True keeps the heading (AVCS), False only damps the yaw rate.

    Raises:
        InputError: a setting that the gyro does not have.
    """

    flight_mode: int = 3
    pitch_rate: float = 0.4
    elevator_rate: float = 0.6
    aileron_rate: float = 0.6
    heading_lock: bool = True

    def __post_init__(self) -> None:
        check_settings(self.as_parameters())

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "GyroSettings":
        """Return the settings that a vehicle's parameters carry."""
        return cls(
            flight_mode=int(parameters["gyro.flight_mode"]),
            pitch_rate=parameters["gyro.pitch_rate"],
            elevator_rate=parameters["gyro.elevator_rate"],
            aileron_rate=parameters["gyro.aileron_rate"],
            heading_lock=bool(parameters["gyro.heading_lock"]),
        )

    def as_parameters(self) -> dict[str, float]:
        """Return them by parameter name, such as "gyro.aileron_rate"."""
        return {f"gyro.{name}": float(value) for name, value in asdict(self).items()}
