"""What an autopilot must be told of a vehicle: servos, collective, rotor, simulated sensors.

Everything here follows from the vehicle's own numbers; gains are `helisim.sitl.gains`'s.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.sitl.mixing import CYCLIC, FULL_CYCLIC, H3_140, MIXED_1_TO_1, ROTOR_FUNCTION
from helisim.sitl.outputs import Output, Outputs
from helisim.sitl.parameter_file import Setting
from helisim.vehicle import Vehicle

_RANGE = 0.5
"""Of the sticks, to each side, in the unit of col and cyclic."""
_HALF = 500.0
"""us, by which a servo's output goes to each side where nothing else is known."""
_SPOOL_UP = 12.0
"""s, of a rotor without numbers of a motor; see `helisim.sitl.drive`."""
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
