"""An autopilot's parameters for a vehicle: a .parm file, settings and gains, and their reasons."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import write_text
from helisim.base.linear import Linear, responses
from helisim.base.settings import Checked
from helisim.base.units import STANDARD_GRAVITY
from helisim.handling.arducopter import COMMANDS, WORDS
from helisim.handling.figures import margins, rejection
from helisim.handling.loop import axis_of
from helisim.records.record import IN1
from helisim.sitl.aircraft import SPOOL_UP, powered
from helisim.sitl.gains import (
    AHEAD,
    FILTER_HZ,
    GYRO_HZ,
    INPUT_TIME,
    LOOP_RATE,
    Tuning,
    tune,
)
from helisim.sitl.mixing import (
    CYCLIC,
    FULL_CYCLIC,
    ROTOR_FUNCTION,
    Mixer,
    Output,
    Outputs,
    command_scale,
)
from helisim.vehicle import Vehicle, load

_WIDTH = 90  # Characters of a line; ArduPilot reads 98


@dataclass(frozen=True)
class Setting:
    """One parameter, in ArduPilot's name and unit. Raises InputError for no finite number."""

    name: str
    value: float
    why: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise InputError(f"{self.name} must be a finite number, got {self.value!r}")


@dataclass(frozen=True)
class AutopilotParameters(Checked):
    """Settings of an autopilot by heading, remarks on what they lack, and a line's form."""

    title: str
    groups: Mapping[str, tuple[Setting, ...]] = field(repr=False)
    remarks: tuple[str, ...] = field(default=(), repr=False)
    form: str = field(default="{} {}", repr=False)

    @property
    def settings(self) -> tuple[Setting, ...]:
        """All of them, in the file's order."""
        return tuple(one for some in self.groups.values() for one in some)

    @property
    def values(self) -> dict[str, float]:
        """Value by name, rounded to the file's six digits."""
        return {one.name: float(_number(one.value)) for one in self.settings}

    @property
    def text(self) -> str:
        """The file's text: name and value, or # a comment."""
        lines = [*_comment(self.title), "#"]
        lines += [line for remark in self.remarks for line in _comment(remark)]
        for heading, some in self.groups.items():
            lines += ["#", f"# ---- {heading}"]
            for one in some:
                lines += _comment(one.why) if one.why else []
                lines.append(self.form.format(one.name, _number(one.value)))
        return "\n".join([*lines, ""])

    def write(self, path: str | PathLike[str]) -> None:
        """Write the file. Raises StorageError."""
        write_text(path, self.text)


def _comment(text: str) -> Iterable[str]:
    return wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="#   ")


def _number(value: float) -> str:
    return f"{value:.6g}"


_RANGE = 0.5  # Of the sticks, to each side, in the unit of col and cyclic
_HALF = 500.0  # us, a servo's travel to each side by default
_LANDED = -2.0  # deg, blade pitch to which the collective goes down at least
# us, of the tail's trim from its hover pulse: 0.08 of full yaw; relative, of equal settings
_ASIDE, _SAME = 40.0, 1e-6
Group = tuple[Setting, ...]


def swashplate(vehicle: Vehicle, outputs: Outputs) -> tuple[Group, list[str]]:
    """Return the swashplate's settings, and remarks; InputError if ArduPilot can't send a pulse."""
    columns = np.array(vehicle.swashplate.mix(*np.eye(3)))  # rows: servos; columns: col, lon, lat
    signs = np.sign(columns[:, 0])
    rows = signs[:, None] * columns[:, 1:]
    each = (outputs.front, outputs.left, outputs.right)
    arms = np.hypot(rows[:, 0], rows[:, 1])
    travel = np.array([one.travel for one in each]) / outputs.reach
    remarks = []
    if np.ptp(arms) > _SAME or np.ptp(np.abs(travel)) > _SAME:
        remarks.append(
            "the swashplate's servos have different arms or travels, which ArduPilot's mixer has "
            "no numbers for: means are taken, and roll, pitch and collective move each other"
        )
    unit = float(np.mean(np.abs(travel)))
    azimuths = -np.degrees(np.arctan2(rows[:, 1], rows[:, 0]))
    low, high = collective(vehicle)
    least = 1500.0 + low * unit
    if least < 1000.0 or 1500.0 + high * unit > 2000.0:
        raise InputError(
            f"the collective from {low:.2f} to {high:.2f} takes {unit * (high - low):.0f} us: "
            "ArduPilot sends 1000 to 2000 us to a swashplate; make [outputs] travel smaller, or "
            "servo.travel larger"
        )
    share = (vehicle.trim.col - low) / (high - low)
    cyclic = min(_RANGE * float(np.mean(arms)) * unit, CYCLIC)
    where = {1: "azimuth of its ball link, deg from the nose to the right"}
    found = (
        Setting("H_SW_TYPE", 0.0, "three servos anywhere (H3 generic)"),
        *(
            Setting(f"H_SW_H3_SV{k}_POS", round(azimuth, 6) + 0.0, where.get(k, ""))
            for k, azimuth in enumerate(azimuths.tolist(), 1)
        ),
        Setting(
            "H_SW_H3_PHANG",
            0.0,
            "none: roll is the vehicle's lat and pitch its lon; what moves across is its rotor's",
        ),
        Setting("H_SW_COL_DIR", 0.0),
        *(
            setting
            for k, (one, turned) in enumerate(zip(each, (signs * travel < 0.0).tolist()))
            for setting in _servo(one, 33 + k, turned, f"servo {k + 1} of the swashplate, us")
        ),
        Setting(
            "H_COL_MIN",
            round(least),
            f"collective from {low:+.2f} to {high:+.2f}, a unit is {unit:.1f} us at the servos",
        ),
        Setting("H_COL_MAX", round(1500.0 + high * unit)),
        Setting("H_COL_ANG_MIN", round(_pitch(vehicle, low), 2), "the blades' pitch there, deg"),
        Setting("H_COL_ANG_MAX", round(_pitch(vehicle, high), 2)),
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
    )
    return found, remarks


def collective(vehicle: Vehicle) -> tuple[float, float]:
    """Return the least and most of the vehicle's col that the autopilot has."""
    per_unit = math.degrees(vehicle.parameters["main_rotor.pitch_range"])
    unloaded = vehicle.trim.col + (_LANDED - _pitch(vehicle, vehicle.trim.col)) / per_unit
    return min(vehicle.trim.col - _RANGE, unloaded), vehicle.trim.col + _RANGE


def _pitch(vehicle: Vehicle, col: float) -> float:
    own = vehicle.parameters
    return math.degrees(own["main_rotor.pitch_trim"] + own["main_rotor.pitch_range"] * col)


def tail(outputs: Outputs) -> Group:
    """Return the settings of the tail."""
    return (
        Setting("H_TAIL_TYPE", 0.0, "a servo, gyro in the autopilot"),
        *_servo(
            outputs.tail,
            36,
            outputs.tail.travel < 0.0,
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
    spool = said or SPOOL_UP
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


def sensors(vehicle: Vehicle) -> Group:
    """Return where the sensors sit: one place, whose motion the simulation sends."""
    where = {"INS_POS1_X": "m forward, right, down of the centre of gravity"}
    return tuple(
        Setting(name := f"{sensor}_{axis}", round(metres, 4) + 0.0, where.get(name, ""))
        for sensor in ("INS_POS1", "INS_POS2", "GPS1_POS")
        for axis, metres in zip("XYZ", vehicle.imu_offset)
    )


def simulated() -> dict[str, Group]:
    """Return settings for the simulator's sensors, radio and ground station."""
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


_QUICK = 10.0  # rad/s, at which a collective lifts before the vehicle moves


def parameters_for(
    vehicle: Vehicle | str,
    model: Linear | None = None,
    *,
    of_autopilot: bool = False,
    late: float = 0.0,
    lift: float | None = None,
    made_from: str = "",
) -> AutopilotParameters:
    """Return parameters with which ArduCopter-heli flies a vehicle, with their reasons.

    `model` is from col, lon, lat, ped in the vehicle's unit, or `of_autopilot` in its commands held
    for its ticks, to rates, attitudes and w; the exact linearisation if None. Axes it lacks aren't
    tuned. `late`, s, is by how much commands act later than by the model and the ticks. `lift`,
    m/s^2 by a unit of the model's col, is for a model without w; `made_from` names its source in
    the file. Raises InputError if no axis can be tuned, or ArduPilot can't send a servo's pulse.
    """
    vehicle = load(vehicle) if isinstance(vehicle, str) else vehicle
    outputs = Outputs.of(vehicle.parameters)
    plate, remarks = swashplate(vehicle, outputs)
    groups: dict[str, Group] = {
        "swashplate and collective": plate,
        "tail": tail(outputs),
        "rotor": rotor(vehicle, outputs),
        "hover": hover(vehicle),
        "where the sensors sit": sensors(vehicle),
    }
    used = {outputs.front, outputs.left, outputs.right, outputs.tail, outputs.rotor}
    free = sorted({1, 2, 3, 4, 8} - {one.channel for one in used})
    groups["outputs that move nothing"] = tuple(Setting(f"SERVO{k}_FUNCTION", 0.0) for k in free)
    told = {one.name: one.value for group in groups.values() for one in group}
    scale = command_scale(Mixer(told), outputs, vehicle.swashplate, told["H_COL_HOVER"])
    scale = np.eye(4) if of_autopilot else scale
    # with the motor, if it has one: without, the rotor's inertia would yaw with the body
    known = model or replace(powered(vehicle, vehicle.model.opt.timestep).linearize(), delays={})
    tuning = tune(
        known,
        scale,
        lean=(vehicle.trim.phi, vehicle.trim.theta),
        late=late,
        held=not of_autopilot,
    )
    groups["loops, and the filters in them"] = _LOOPS
    for axis in COMMANDS:
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
        f"{vehicle.name} flown by ArduCopter-heli; gains from {source}; by helisim ardupilot parm",
        {heading: some for heading, some in {**groups, **simulated()}.items() if some},
        (*remarks, *_LEFT),
    )


_LEFT = (
    "Not derived: position and navigation (PSC_POSXY, PSC_VELXY, WPNAV) stay as ArduPilot has "
    "them. No vibration is simulated: a real helicopter needs notches (INS_HNTCH) at its rotor's "
    "speed, and INS_GYRO_FILTER 20.",
)


_LOOPS = (
    Setting("SCHED_LOOP_RATE", LOOP_RATE, "Hz"),
    Setting("INS_GYRO_FILTER", GYRO_HZ, "Hz: twice the usual, as nothing vibrates"),
    Setting("ATC_RATE_FF_ENAB", 1.0, "attitudes that are asked for are shaped"),
    Setting("ATC_INPUT_TC", INPUT_TIME, "s, in which the sticks are followed"),
)


def _axis(tuning: Tuning, axis: str) -> Group:
    gains, own = tuning.gains[axis], f"ATC_RAT_{WORDS[axis]}_"
    cut, left = margins(tuning.loop.broken(axis)), rejection(tuning.loop.disturbance(axis))
    unit = "rad/s of " + str(axis_of(axis).rate)
    limit = 1.0 if axis == "ped" else 0.5
    return (
        Setting(
            f"ATC_ANG_{WORDS[axis]}_P",
            gains.angle,
            f"1/s. Predicted, cut at the command: gain margin {cut.least_gain:.1f} dB, phase "
            f"margin {math.degrees(cut.least_phase):.0f} deg, crossover "
            f"{cut.crossover:.1f} rad/s; disturbances of {axis_of(axis).angle} rejected up to "
            f"{left.bandwidth:.1f} rad/s, with a peak of {left.peak:.1f} dB",
        ),
        Setting(
            f"{own}FF",
            _rounded(gains.ff),
            f"the command that holds 1 {unit}: {tuning.holds[axis]:.4f} of full",
        ),
        Setting(
            f"{own}P",
            _rounded(gains.p),
            "with D and ATC_ANG: disturbances rejected furthest, for little noise, within "
            f"{AHEAD.gain:g} dB, {math.degrees(AHEAD.phase):.0f} deg and a peak of {AHEAD.peak:g} "
            "dB",
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
    """Return the acceleration by all of the collective, m/s^2, 0 if nothing tells it."""
    if "w" not in model.outputs or "col" not in model.inputs:
        return 0.0
    own, k = responses(model, np.array([_QUICK]), ["w"], ["col"])[0, 0, 0], IN1.index("col")
    return float(abs(1j * _QUICK * own) * scale[k, k])


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
