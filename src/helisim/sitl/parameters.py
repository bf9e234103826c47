"""An autopilot's parameters for a vehicle: a .parm file, settings and gains, and their reasons."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import atomic_write, read_text
from helisim.base.linear import Linear
from helisim.base.settings import FrozenMap
from helisim.base.units import STANDARD_GRAVITY
from helisim.handling.arducopter import COMMANDS
from helisim.handling.loop import axis_of
from helisim.records.record import IN1
from helisim.sitl.gains import FILTER_HZ, GYRO_HZ, INPUT_TIME, LOOP_RATE, Tuning, tune
from helisim.sitl.mixing import (
    CYCLIC,
    FULL_CYCLIC,
    H3_140,
    MIXED_1_TO_1,
    ROTOR_FUNCTION,
    Controls,
    Mixer,
    Output,
    Outputs,
)
from helisim.vehicle import Vehicle, load

_LONGEST_NAME = 16
_WIDTH = 90
"""Of a line: ArduPilot reads 98 characters, and takes what follows for the next line."""


@dataclass(frozen=True)
class Setting:
    """One parameter.

    Attributes:
        name: ArduPilot's.
        value: in its unit there.
        why: what it follows from; "" where it goes with the one before.

    Raises:
        InputError: it is no name of a parameter, or no finite number.
    """

    name: str
    value: float
    why: str = ""

    def __post_init__(self) -> None:
        own = self.name.replace("_", "")
        known = own.isascii() and own.isalnum() and own == own.upper() and own[0].isalpha()
        if not (own and known and len(self.name) <= _LONGEST_NAME):
            raise InputError(
                f"{self.name!r:.40} is no parameter of ArduPilot: expected up to {_LONGEST_NAME} "
                "capitals, digits and underscores"
            )
        if not math.isfinite(self.value):
            raise InputError(f"{self.name} must be a finite number, got {self.value!r}")


@dataclass(frozen=True, repr=False)
class AutopilotParameters:
    """What an autopilot is set to, in groups, and what is left to be found otherwise.

    Attributes:
        title: what flies with them, and what they were made from.
        groups: heading -> its settings, in order.
        remarks: what could not be derived, and what was left out on purpose.

    Raises:
        InputError: a parameter is set twice.
    """

    title: str
    groups: Mapping[str, tuple[Setting, ...]]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        groups = {heading: tuple(some) for heading, some in self.groups.items()}
        object.__setattr__(self, "groups", FrozenMap(groups))
        object.__setattr__(self, "remarks", tuple(self.remarks))
        names = [one.name for one in self.settings]
        twice = [name for k, name in enumerate(names) if name in names[:k]]
        if twice:
            raise InputError(f"{twice[0]} is set twice")

    def __repr__(self) -> str:
        return f"AutopilotParameters({self.title.partition(';')[0]!r:.60}, {len(self.settings)})"

    @property
    def settings(self) -> tuple[Setting, ...]:
        """All of them, in the order of the file."""
        return tuple(one for some in self.groups.values() for one in some)

    @property
    def values(self) -> dict[str, float]:
        """Value by name, as the file has it: of six digits."""
        return {one.name: float(_number(one.value)) for one in self.settings}

    @property
    def text(self) -> str:
        """The file, which ArduPilot and ground stations read: name and value, or # a comment."""
        lines = [*_comment(self.title), "#"]
        lines += [line for remark in self.remarks for line in _comment(remark)]
        for heading, some in self.groups.items():
            lines += ["#", f"# ---- {heading}"]
            for one in some:
                lines += _comment(one.why) if one.why else []
                lines.append(f"{one.name} {_number(one.value)}")
        return "\n".join([*lines, ""])

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file. Raises StorageError."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.text, encoding="utf-8")


def read_parameters(path: str | PathLike[str]) -> dict[str, float]:
    """Return the values of a .parm file by name, as ArduPilot and ground stations write it.

    Args:
        path: of lines NAME VALUE or NAME,VALUE; from # on they are comments.

    Raises:
        StorageError: it can't be read.
        InputError: a line is neither; the message says which.
    """
    found: dict[str, float] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        parts = line.partition("#")[0].replace(",", " ").replace("=", " ").split()
        if not parts:
            continue
        try:
            name, value = parts[:2]
            found[name] = Setting(name, float(value)).value
        except (ValueError, InputError):
            raise InputError(
                f"{path}:{number}: {line.strip()!r:.60} is no parameter: expected NAME VALUE, "
                "such as ATC_RAT_RLL_P 0.02"
            ) from None
    if not found:
        raise InputError(f"{path}: no parameter is in it; expected lines NAME VALUE")
    return found


def _comment(text: str) -> Iterable[str]:
    return wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="#   ")


def _number(value: float) -> str:
    return f"{value:.6g}"


_RANGE = 0.5
"""Of the sticks, to each side, in the unit of col and cyclic."""
_HALF = 500.0
"""us, by which a servo's output goes to each side where nothing else is known."""
_SPOOL_UP = 12.0
"""s, of a rotor without numbers of a motor; see `helisim.sitl.aircraft`."""
_LANDED = -2.0
"""deg, of the blades: at least that low the collective goes."""
_ASIDE = 40.0
"""us, by which the tail's trim is aside of its hover's pulse: 0.08 of full yaw."""
_SAME = 1e-6
Group = tuple[Setting, ...]


def swashplate(vehicle: Vehicle, outputs: Outputs) -> tuple[Group, list[str]]:
    """Return the swashplate's settings, and what they can't say of it.

    Raises:
        InputError: a servo needs a pulse that ArduPilot does not send.
    """
    plate = vehicle.swashplate
    columns = np.array(plate.mix(*np.eye(3)))  # rows: servos; columns: col, lon, lat
    signs = np.sign(columns[:, 0])
    rows = signs[:, None] * columns[:, 1:]
    each = (outputs.front, outputs.left, outputs.right)
    order, sense = _h3_140(rows) or ([0, 1, 2], 1.0)
    mixed = _h3_140(rows) is not None
    arms = np.ones(3) if mixed else np.hypot(rows[:, 0], rows[:, 1])
    travel = np.array([one.travel for one in each]) / outputs.reach
    turned = (sense * signs * travel) < 0.0
    remarks = []
    if np.ptp(arms) > _SAME or np.ptp(np.abs(travel)) > _SAME:
        remarks.append(
            "the swashplate's servos have different arms or travels, which ArduPilot's mixer has "
            "no numbers for: means are taken, and roll, pitch and collective move each other"
        )
    unit = float(np.mean(np.abs(travel)))
    found = _plate(rows, mixed)
    found.append(Setting("H_SW_COL_DIR", float(sense < 0.0)))
    for motor, k in enumerate(order):
        why = f"servo {motor + 1} of the swashplate, us"
        found += _servo(each[k], 33 + motor, bool(turned[k]), why)
    low, high = collective(vehicle)
    least = 1500.0 + low * unit
    if least < 1000.0 or 1500.0 + high * unit > 2000.0:
        raise InputError(
            f"the collective from {low:.2f} to {high:.2f} takes {unit * (high - low):.0f} us: "
            "ArduPilot sends 1000 to 2000 us to a swashplate; make [outputs] travel smaller, or "
            "servo.travel larger"
        )
    angles = [_pitch(vehicle, end) for end in (low, high)]
    share = (vehicle.trim.col - low) / (high - low)
    cyclic = min(_RANGE * float(np.mean(arms)) * unit, CYCLIC)
    found += [
        Setting(
            "H_COL_MIN",
            round(least),
            f"collective from {low:+.2f} to {high:+.2f}, a unit is {unit:.1f} us at the servos",
        ),
        Setting("H_COL_MAX", round(1500.0 + high * unit)),
        Setting("H_COL_ANG_MIN", round(angles[0], 2), "the blades' pitch there, deg"),
        Setting("H_COL_ANG_MAX", round(angles[1], 2)),
        Setting(
            "H_COL_ZERO_THRST", 0.0, "deg: pitch is counted at 3/4 radius, where none is no thrust"
        ),
        Setting("H_COL_LAND_MIN", 0.5 * _LANDED, "deg: holds it on the ground"),
        Setting("H_COL_HOVER", round(share, 3), "the hover's share of that range"),
        Setting("H_HOVER_LEARN", 0.0, "not learned: two flights then fly the same"),
        Setting(
            "H_CYC_MAX",
            round(cyclic / CYCLIC * FULL_CYCLIC),
            f"cyclic of {_RANGE:g}, as the sticks': {cyclic:.0f} us, where 4500 is {CYCLIC:.0f}",
        ),
    ]
    return tuple(found), remarks


def _plate(rows: NDArray[np.float64], mixed: bool) -> list[Setting]:
    """Return where the servos stand; rows are of lon and lat, (3, 2)."""
    if mixed:
        return [Setting("H_SW_TYPE", H3_140, "H3-140, mixed 1:1: left, right, elevator's servo")]
    azimuths = -np.degrees(np.arctan2(rows[:, 1], rows[:, 0]))
    why = "azimuths of the servos' ball links, deg from the nose to the right"
    return [
        Setting("H_SW_TYPE", 0.0, "three servos anywhere (H3 generic)"),
        *(
            Setting(f"H_SW_H3_SV{k}_POS", round(float(azimuth), 6) + 0.0, why if k == 1 else "")
            for k, azimuth in enumerate(azimuths, 1)
        ),
        Setting(
            "H_SW_H3_PHANG",
            0.0,
            "none: roll is the vehicle's lat and pitch its lon; what moves across is its rotor's",
        ),
    ]


def _h3_140(rows: NDArray[np.float64]) -> tuple[list[int], float] | None:
    """Return which servos an H3-140's motors 1 to 3 move, and -1 where its elevator is in front.

    All of it is then reversed, collective too, as ArduPilot's H_SW_TYPE says of an HR3-140. None
    for another plate. Rows are of lon and lat, (3, 2).
    """
    for sense in (1.0, -1.0):
        near = [np.all(np.abs(rows - sense * np.array(one)) < 1e-3, axis=1) for one in MIXED_1_TO_1]
        if all(map(np.any, near)):
            return [int(np.argmax(one)) for one in near], sense
    return None


def collective(vehicle: Vehicle) -> tuple[float, float]:
    """Return the least and most of the vehicle's col that the autopilot has.

    The sticks' range, and lower where that doesn't take the blades' lift, as a landing needs it.
    """
    per_unit = math.degrees(vehicle.parameters["main_rotor.pitch_range"])
    unloaded = vehicle.trim.col + (_LANDED - _pitch(vehicle, vehicle.trim.col)) / per_unit
    return min(vehicle.trim.col - _RANGE, unloaded), vehicle.trim.col + _RANGE


def _pitch(vehicle: Vehicle, col: float) -> float:
    """Return the blades' pitch, deg."""
    own = vehicle.parameters
    return math.degrees(own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * col)


def tail(outputs: Outputs, *, gyro: bool = False) -> Group:
    """Return the settings of the tail, with a gyro of its own or without."""
    turned = outputs.tail.travel < 0.0
    if gyro:
        return (
            Setting("H_TAIL_TYPE", 1.0, "its own gyro moves the servo: yaw is the gyro's pedals"),
            *_servo(outputs.tail, 36, turned, "pedals: their middle and their ends, us"),
        )
    return (
        Setting("H_TAIL_TYPE", 0.0, "a servo, gyro in the autopilot"),
        *_servo(
            outputs.tail,
            36,
            turned,
            f"tail: trim and ends {_ASIDE:g} us short of the hover's, as pulses are cut to whole "
            "us towards the trim: at it small commands would be lost",
            _ASIDE,
        ),
        Setting(
            "H_COL2YAW", 0.0, "yaw is not moved with the collective: each axis moves its own only"
        ),
    )


def rotor(vehicle: Vehicle, outputs: Outputs) -> Group:
    """Return the settings of the rotor's speed controller."""
    one = outputs.rotor
    setpoint = min(100, max(10, round(100.0 * abs(one.travel) / (2.0 * _HALF))))
    far = one.trim + one.travel * 100.0 / setpoint
    own = f"SERVO{one.channel:g}_"
    said = vehicle.parameters["drive.spool_up"]
    spool = said or _SPOOL_UP
    return (
        Setting(f"{own}FUNCTION", ROTOR_FUNCTION, "speed of the rotor"),
        Setting(f"{own}MIN", round(min(one.trim, far))),
        Setting(f"{own}MAX", round(max(one.trim, far))),
        Setting(f"{own}TRIM", round(one.trim)),
        Setting(f"{own}REVERSED", float(one.travel < 0.0)),
        Setting("H_RSC_MODE", 2.0, "a setpoint: the motor's controller governs"),
        Setting("H_RSC_SETPOINT", setpoint, f"%, the nominal speed: {one.trim + one.travel:g} us"),
        Setting("H_RSC_IDLE", 0.0),
        Setting("H_RSC_RAMP_TIME", 1.0, "s: the motor's controller spools up by itself"),
        Setting(
            "H_RSC_RUNUP_TIME",
            math.ceil(spool) + 1.0,
            f"s, until it may take off: drive.spool_up is {spool:g} s"
            if said
            else f"s, until it may take off: a rotor without a motor's numbers takes {spool:g} s",
        ),
        Setting("H_RSC_CRITICAL", 50.0, "%"),
    )


def unused(outputs: Outputs) -> Group:
    """Return those of a helicopter's usual outputs that move nothing of this one."""
    used = {outputs.front, outputs.left, outputs.right, outputs.tail, outputs.rotor}
    free = sorted({1, 2, 3, 4, 8} - {one.channel for one in used})
    return tuple(Setting(f"SERVO{channel}_FUNCTION", 0.0) for channel in free)


def hover(vehicle: Vehicle) -> Group:
    """Return the settings of the hover."""
    lean = math.degrees(vehicle.trim.phi)
    low, high = collective(vehicle)
    share = 100.0 * (vehicle.trim.col - low) / (high - low)
    return (
        Setting(
            "ATC_HOVR_ROL_TRM",
            round(100.0 * lean),
            f"cdeg: it leans by {lean:.2f} deg against the tail rotor's thrust",
        ),
        Setting("IM_STB_COL_1", 0.0, "%: collective over the stick, the hover in its middle"),
        Setting("IM_STB_COL_2", round(share - 10.0)),
        Setting("IM_STB_COL_3", round(share + 10.0)),
        Setting("IM_STB_COL_4", 100.0),
    )


def simulated() -> dict[str, Group]:
    """Return what the simulator's sensors, radio and ground station need."""
    return {
        "simulated sensors, which must look calibrated to arm": (
            *_triple("INS_ACC{}OFFS_{}", ("", "2"), 0.001),
            *_triple("INS_ACC{}SCAL_{}", ("", "2"), 1.001),
            *_triple("SIM_MAG{}_OFS_{}", ("1", "2", "3"), 0.0),
            *_triple("COMPASS_OFS{}_{}", ("", "2", "3"), 0.1),
            Setting("BATT_MONITOR", 0.0, "none is simulated"),
        ),
        "radio": tuple(
            Setting(f"RC{channel}_{name}", value)
            for channel in range(1, 9)
            for name, value in (("MIN", 1000.0), ("MAX", 2000.0), ("TRIM", 1500.0))
        ),
        "modes, failsafes, log": (
            Setting("FRAME_CLASS", 6.0, "helicopter"),
            *(Setting(f"FLTMODE{k}", mode, why) for k, (mode, why) in enumerate(_MODES, 1)),
            Setting("FS_THR_ENABLE", 0.0, "a script is the radio"),
            Setting("FS_GCS_ENABLE", 0.0),
            Setting("DISARM_DELAY", 0.0, "s, none: it stands armed as long as a script wants"),
            Setting("LOG_BITMASK", 262143.0, "all that SystemID needs, at the loop's rate"),
            Setting("LOG_DISARMED", 0.0),
            Setting("LOG_FILE_BUFSIZE", 30000.0, "kB: nothing is lost at many times real time"),
        ),
    }


_MODES = (
    (0.0, "STABILIZE, ALT_HOLD, LOITER, GUIDED, SYSTEMID, LAND"),
    (2.0, ""),
    (5.0, ""),
    (4.0, ""),
    (25.0, ""),
    (9.0, ""),
)


def _triple(name: str, instances: Sequence[str], value: float) -> Group:
    return tuple(Setting(name.format(one, axis), value) for one in instances for axis in "XYZ")


def _servo(output: Output, function: int, turned: bool, why: str, aside: float = 0.0) -> Group:
    own, half, trim = f"SERVO{output.channel:g}_", abs(output.travel), output.trim - aside
    return (
        Setting(f"{own}FUNCTION", function, why),
        Setting(f"{own}TRIM", round(trim)),
        Setting(f"{own}MIN", round(trim - half)),
        Setting(f"{own}MAX", round(trim + half)),
        Setting(f"{own}REVERSED", float(turned)),
    )


_WORDS = {"lat": "RLL", "lon": "PIT", "ped": "YAW"}
_QUICK = 10.0
"""rad/s, at which a collective lifts before the vehicle moves."""


def parameters_for(
    vehicle: Vehicle | str,
    model: Linear | None = None,
    *,
    of_autopilot: bool = False,
    late: float = 0.0,
    lift: float | None = None,
    gyro: bool = False,
    made_from: str = "",
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, and what each follows from.

    Args:
        vehicle: or its name or folder: its servos, rotor and hover are what is set.
        model: from col, lon, lat, ped in the vehicle's unit to rates, attitudes and w, such as an
            identified one; the exact linearisation if None. What it doesn't know isn't tuned.
        of_autopilot: whether the model's commands are the autopilot's own, 1 all of it, held for
            its ticks: of its log.
        late: s, by which the autopilot's commands act later than the model's and its own ticks
            say: negative where half a tick of another computer is in the model.
        lift: acceleration that a unit of the model's col gives, m/s^2, where w doesn't tell.
        gyro: whether the vehicle's own gyro stays in the tail: the autopilot then asks it for a
            rate of yaw, and gains of yaw are the gyro's.
        made_from: what the model is, for the file.

    Raises:
        InputError: no axis can be tuned, or a servo needs a pulse that ArduPilot doesn't send.
    """
    vehicle = load(vehicle) if isinstance(vehicle, str) else vehicle
    outputs = Outputs.of(vehicle.parameters)
    plate, remarks = swashplate(vehicle, outputs)
    groups: dict[str, Group] = {
        "swashplate and collective": plate,
        "tail": tail(outputs, gyro=gyro),
        "rotor": rotor(vehicle, outputs),
        "hover": hover(vehicle),
    }
    groups["outputs that move nothing"] = unused(outputs)
    told = {one.name: one.value for group in groups.values() for one in group}
    controls = Controls(Mixer.of(told), outputs, vehicle.swashplate)
    scale = np.eye(4) if of_autopilot else controls.scale(told["H_COL_HOVER"])
    known = model or replace(vehicle.linearize(), delays={})
    lean = (vehicle.trim.phi, vehicle.trim.theta)
    axes = [axis for axis in COMMANDS if not (gyro and axis == "ped")]
    tuning = tune(known, scale, lean=lean, late=late, held=not of_autopilot, axes=axes)
    groups["loops, and the filters in them"] = _loops()
    if gyro:
        groups["yaw"] = _asked(vehicle)
    for axis in axes:
        if axis in tuning.gains:
            groups[f"{axis_of(axis).word}"] = _axis(tuning, axis)
        else:
            remarks.append(
                f"no gains of {axis_of(axis).word}: the model doesn't know it; ArduPilot's own stay"
            )
    lifts = scale[0, 0] * lift if lift else _lift(known, scale)
    if lifts:
        groups["height"] = _height(lifts)
    else:
        remarks.append("no gains of height: the model has no w over col; ArduPilot's own stay")
    source = made_from or "its exact linearisation in the hover"
    return AutopilotParameters(
        f"{vehicle.name} flown by ArduCopter-heli; gains from {source}; by helisim parm",
        {heading: some for heading, some in {**groups, **simulated()}.items() if some},
        (*remarks, *_LEFT),
    )


_LEFT = (
    "Not derived: position and navigation (PSC_POSXY, PSC_VELXY, WPNAV) stay as ArduPilot has "
    "them. No vibration is simulated: a real helicopter needs notches (INS_HNTCH) at its rotor's "
    "speed, and INS_GYRO_FILTER 20.",
)


def _loops() -> Group:
    return (
        Setting("SCHED_LOOP_RATE", LOOP_RATE, "Hz"),
        Setting("INS_GYRO_FILTER", GYRO_HZ, "Hz: twice the usual, as nothing vibrates"),
        Setting("ATC_RATE_FF_ENAB", 1.0, "attitudes that are asked for are shaped"),
        Setting("ATC_INPUT_TC", INPUT_TIME, "s, in which the sticks are followed"),
    )


def _axis(tuning: Tuning, axis: str) -> Group:
    gains, own = tuning.gains[axis], f"ATC_RAT_{_WORDS[axis]}_"
    margins, rejection = tuning.margins(axis), tuning.rejection(axis)
    unit = "rad/s of " + str(axis_of(axis).rate)
    limit = 1.0 if axis == "ped" else 0.5
    return (
        Setting(
            f"ATC_ANG_{_WORDS[axis]}_P",
            gains.angle,
            f"1/s. Predicted, cut at the command: gain margin {margins.least_gain:.1f} dB, phase "
            f"margin {math.degrees(margins.least_phase):.0f} deg, crossover "
            f"{margins.crossover:.1f} rad/s; disturbances of {axis_of(axis).angle} rejected up to "
            f"{rejection.bandwidth:.1f} rad/s, with a peak of {rejection.peak:.1f} dB",
        ),
        Setting(
            f"{own}FF",
            _rounded(gains.ff),
            f"the command that holds 1 {unit}: {tuning.holds[axis]:.4f} of full",
        ),
        Setting(
            f"{own}P",
            _rounded(gains.p),
            "with D and ATC_ANG: the least left of disturbances below 3 rad/s that keeps 8 dB, 50 "
            "deg and a peak of 4.5 dB",
        ),
        Setting(f"{own}D", _rounded(gains.d)),
        Setting(f"{own}I", _rounded(gains.i), "half a radian a second of FF + P"),
        Setting(f"{own}IMAX", limit, "of full command"),
        Setting(f"{own}ILMI", 0.0 if axis == "ped" else 0.1, "no leak below it"),
        Setting(f"{own}D_FF", 0.0),
        Setting(f"{own}FLTT", FILTER_HZ, "Hz"),
        Setting(f"{own}FLTE", 0.0),
        Setting(f"{own}FLTD", FILTER_HZ),
    )


def _asked(vehicle: Vehicle) -> Group:
    """Return the gains of yaw where a gyro of its own turns the vehicle as it is asked."""
    full = 0.5 * vehicle.parameters["gyro.k_delta"] / vehicle.parameters["gyro.k_a"]
    why = f"full yaw asks the gyro for {full:.3f} rad/s (gyro.k_delta / k_a, half a unit of pedals)"
    none = [Setting(f"ATC_RAT_YAW_{name}", 0.0) for name in ("P", "I", "D", "D_FF", "FLTE")]
    return (
        Setting("ATC_RAT_YAW_FF", _rounded(1.0 / full), why),
        *none,
        Setting("ATC_RAT_YAW_FLTT", FILTER_HZ, "Hz"),
    )


def _height(lift: float) -> Group:
    gain = STANDARD_GRAVITY / lift
    return (
        Setting(
            "PSC_ACCZ_P",
            _rounded(gain),
            f"all of the collective lifts {lift:.1f} m/s^2: 1 g of it, as ArduPilot's guide has it "
            "of the hover's throttle",
        ),
        Setting("PSC_ACCZ_I", _rounded(2.0 * gain), "twice that, likewise"),
    )


def _lift(model: Linear, scale: NDArray[np.float64]) -> float:
    """Return the acceleration that all of the collective gives, m/s^2, 0 if nothing tells it."""
    if "w" not in model.outputs or "col" not in model.inputs:
        return 0.0
    response = model.response(np.array([_QUICK]))
    own = response[model.outputs.index("w"), model.inputs.index("col"), 0]
    k = IN1.index("col")
    return float(abs(1j * _QUICK * own) * scale[k, k])


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
