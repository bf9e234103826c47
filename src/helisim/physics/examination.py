"""Is there all in a model that the force laws count on? Asked once a model, inside MuJoCo's step.

A vehicle is known by the user numbers of its actuators. One that lacks some of what it needs would
fall, or fly without its gyro, and nothing would say so: it is noted, and `installed` raises. So is
one that has the shape of a vehicle, without numbers. User actuators of others are not ours to
refuse, but nobody computes their activations in the block either, and that is worth a warning.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from helisim.physics.kernel import kernel
from helisim.physics.layout import (
    ACTUATORS,
    CONTROL,
    FIRST_LAW_STATE,
    LAYOUT,
    MAGIC,
    ROTOR,
    ROTOR_STATES,
    SENSORS,
    STATE,
)
from helisim.physics.memory import (
    double,
    doubles,
    integer,
    ints,
    long,
    stick_sensor,
    user_numbers,
)
from helisim.physics.notes import FOREIGN, REFUSED, Note, is_due, note
from helisim.physics.params import PARAM

_USER = int(mujoco.mjtDyn.mjDYN_USER)
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_NUMBERS = len(PARAM)
_SERVO_STATES = 2
_KEPT = FIRST_LAW_STATE - STATE.flap_a
"""Activations of the rotor before those of the control laws."""
_AHEAD = list(SENSORS).index("stick")
_DIMS = tuple(SENSORS.values())
_TYPES = tuple(
    int(getattr(mujoco.mjtSensor, f"mjSENS_{kind}"))
    for kind in ("GYRO", "ACCELEROMETER", "VELOCIMETER", "FRAMEQUAT", "FRAMEPOS", "GYRO")
    + ("USER",) * (len(SENSORS) - 7)
    + ("CLOCK",)
)
_GYRO_RATE = list(SENSORS).index("gyro_rate")
_ACTUATION_OFF = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
_PASSIVE_OFF = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
"""With both MuJoCo leaves all passive forces out, and ours are among them."""
_SENSING_OFF = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_GROUPS = 31
"""How many groups of actuators MuJoCo can switch off."""
_WHOLE = 1e-6
"""Relative rounding of a number of steps."""

(
    WELL,
    NO_NUMBERS,
    TOO_FEW,
    OTHER_LAYOUT,
    NOT_NINE,
    OTHER_ORDER,
    NO_JOINT,
    ACTIVATIONS,
    NO_SENSORS,
    WRONG_SENSOR,
    PERIOD,
    HISTORY,
    NOT_OURS,
    STRANGE_LAW,
    OVERRULED,
    NO_NEIGHBOUR,
    NO_ACTUATION,
    NO_PASSIVE,
    NO_SENSING,
    NO_GROUP,
) = range(20)


class Finding(NamedTuple):
    """What is wrong with a model.

    Attributes:
        code: one of the above.
        names: offset of the field of mjModel that says where such elements' names start.
        element: its number, negative for none.
        found: a number that is there.
        wanted: the number that should be.
    """

    code: int
    names: int
    element: int
    found: float
    wanted: float


@kernel()
def examine(m, d, offsets):
    """Note what a model lacks, once in a block."""
    if is_due(_number(m, offsets), double(d, offsets.time), double(m, offsets.timestep)):
        _examine(m, offsets)


@kernel()
def examine_idle(m, d, offsets):
    """Do so where actuation is switched off: MuJoCo asks for forces, and for no controls."""
    if integer(m, offsets.disableflags) & _ACTUATION_OFF:
        examine(m, d, offsets)


@kernel()
def examine_idler(m, d, offsets):
    """Do so where passive forces are switched off too, and MuJoCo asks for sensors alone."""
    off = _ACTUATION_OFF | _PASSIVE_OFF
    if integer(m, offsets.disableflags) & off == off:
        examine(m, d, offsets)


@kernel(forceinline=False)
def _examine(m, offsets):
    for actuator in range(long(m, offsets.nactuator)):
        finding = _of_actuator(m, offsets, actuator)
        if finding.code != WELL:
            kind = FOREIGN if finding.code == NOT_OURS else REFUSED
            code, names, element, found, wanted = finding
            note(kind, code, m, offsets, names, element, found, wanted)


@kernel()
def _number(m, offsets):
    """Return a number that another model at the same address hardly has, odd."""
    number = m ^ (long(m, offsets.actuator_user) >> 4) ^ (long(m, offsets.sensor_adr) << 9)
    number ^= long(m, offsets.nuser_actuator) << 40
    return (number ^ (number >> 12)) & 0x7FFFFFFFFFFFFFFF | 1


@kernel()
def _of_actuator(m, offsets, actuator):
    """Return what is wrong with an actuator, or with the vehicle whose rotor it is."""
    names = offsets.name_actuatoradr
    if not _is_ours(m, offsets, actuator):
        if ints(m, offsets.actuator_dyntype)[actuator] != _USER:
            return Finding(WELL, names, actuator, 0.0, 0.0)
        code = NO_NUMBERS if _has_the_shape(m, offsets, actuator) else NOT_OURS
        if code == NOT_OURS and _in_a_shape(m, offsets, actuator):
            code = WELL  # its rotor will be named
        return Finding(code, names, actuator, 0.0, 0.0)
    ordinal = int(user_numbers(m, offsets, actuator)[PARAM.ordinal])
    for k in range(ROTOR + 1):
        one = actuator - ordinal + k
        if one < 0 or one >= long(m, offsets.nactuator):
            return Finding(NOT_NINE, names, actuator, float(ordinal), float(k))
        if not _is_ours(m, offsets, one) or user_numbers(m, offsets, one)[PARAM.ordinal] != k:
            return Finding(OTHER_ORDER, names, one, 0.0, float(k))
    if ordinal != ROTOR:
        return Finding(WELL, names, actuator, 0.0, 0.0)
    return _of_vehicle(m, offsets, actuator)


@kernel()
def _is_ours(m, offsets, actuator):
    """Return whether an actuator's user numbers say that it is a vehicle's."""
    room = long(m, offsets.nuser_actuator)
    return room > PARAM.ordinal and user_numbers(m, offsets, actuator)[PARAM.magic] == MAGIC


@kernel()
def _has_the_shape(m, offsets, rotor):
    """Return whether an actuator and those before it have as many activations as a vehicle's."""
    if rotor < ROTOR or rotor >= long(m, offsets.nactuator):
        return False
    count, kind = ints(m, offsets.actuator_actnum), ints(m, offsets.actuator_dyntype)
    for servo in range(rotor - 4, rotor):
        if count[servo] != _SERVO_STATES or kind[servo] != _USER:
            return False
    return count[rotor] >= ROTOR_STATES and kind[rotor] == _USER


@kernel()
def _in_a_shape(m, offsets, actuator):
    """Return whether an actuator is before the rotor of what has the shape of a vehicle."""
    for rotor in range(actuator + 1, actuator + ROTOR + 1):
        if _has_the_shape(m, offsets, rotor):
            return True
    return False


@kernel()
def _of_vehicle(m, offsets, rotor):
    """Return what is wrong with the vehicle of a rotor; its nine actuators are there."""
    names, par = offsets.name_actuatoradr, user_numbers(m, offsets, rotor)
    room = long(m, offsets.nuser_actuator)
    if room < _NUMBERS:
        return Finding(TOO_FEW, names, rotor, float(room), float(_NUMBERS))
    if par[PARAM.layout] != LAYOUT:
        return Finding(OTHER_LAYOUT, names, rotor, par[PARAM.layout], LAYOUT)
    switched_off = _of_switches(m, offsets, rotor)
    if switched_off.code != WELL:
        return switched_off
    joint = ints(m, offsets.actuator_trnid)[2 * rotor]
    moves = ints(m, offsets.actuator_trntype)[rotor] == _JOINT
    if not moves or ints(m, offsets.jnt_type)[joint] != _FREE:
        return Finding(NO_JOINT, names, rotor, 0.0, 0.0)
    count = ints(m, offsets.actuator_actnum)
    for servo in range(rotor - ROTOR + CONTROL.servo_front, rotor):
        if count[servo] != _SERVO_STATES:
            return Finding(ACTIVATIONS, names, servo, float(count[servo]), float(_SERVO_STATES))
    needed = _KEPT + 2.0 * (par[PARAM.swash_states] + par[PARAM.tail_states])
    if count[rotor] < needed:
        return Finding(ACTIVATIONS, names, rotor, float(count[rotor]), needed)
    return _of_sensors(m, offsets, rotor, np.int64(ints(m, offsets.jnt_bodyid)[joint]))


@kernel()
def _of_switches(m, offsets, rotor):
    """Return what of a vehicle is switched off by the model's options."""
    names, flags = offsets.name_actuatoradr, integer(m, offsets.disableflags)
    if flags & _ACTUATION_OFF:
        return Finding(NO_ACTUATION, names, rotor, 0.0, 0.0)
    if flags & _PASSIVE_OFF == _PASSIVE_OFF:
        return Finding(NO_PASSIVE, names, rotor, 0.0, 0.0)
    if flags & _SENSING_OFF:
        return Finding(NO_SENSING, names, rotor, 0.0, 0.0)
    groups, off = ints(m, offsets.actuator_group), integer(m, offsets.disableactuator)
    for actuator in range(rotor - ROTOR + CONTROL.servo_front, rotor + 1):
        group = groups[actuator]
        if 0 <= group < _GROUPS and (off >> group) & 1:
            return Finding(NO_GROUP, names, actuator, float(group), 0.0)
    return Finding(WELL, names, rotor, 0.0, 0.0)


@kernel()
def _of_sensors(m, offsets, rotor, body):
    """Return what is wrong with the sensors of a vehicle with this rotor and body."""
    stick, names = stick_sensor(m, offsets, body), offsets.name_sensoradr
    if stick < 0:
        return Finding(NO_SENSORS, offsets.name_bodyadr, body, 0.0, 0.0)
    for step in range(len(_DIMS)):
        k = _AHEAD - step if step <= _AHEAD else step  # outwards: the first that isn't is missing
        sensor = stick - _AHEAD + k
        if sensor < 0 or sensor >= long(m, offsets.nsensor):
            return Finding(NO_NEIGHBOUR, names, max(0, sensor - 1), 0.0, float(k))
        same = ints(m, offsets.sensor_type)[sensor] == _TYPES[k]
        if not same or ints(m, offsets.sensor_dim)[sensor] != _DIMS[k]:
            return Finding(WRONG_SENSOR, names, sensor, 0.0, float(k))
    return _of_times(m, offsets, rotor, stick - _AHEAD + _GYRO_RATE)


@kernel()
def _of_times(m, offsets, rotor, gyro_rate):
    """Return what is wrong with the times of a gyro that is sampled, as it is in flight."""
    names = offsets.name_sensoradr
    step, interval = double(m, offsets.timestep), doubles(m, offsets.sensor_interval)[2 * gyro_rate]
    period = user_numbers(m, offsets, rotor)[PARAM.gyro_period]
    if interval == 0.0:
        return Finding(WELL, names, gyro_rate, 0.0, 0.0)
    if step > period * (1.0 + _WHOLE):
        return Finding(PERIOD, names, gyro_rate, period, step)
    pedal = rotor - ROTOR + CONTROL.ped
    delay, kept = doubles(m, offsets.actuator_delay)[pedal], 0
    if ints(m, offsets.actuator_historyadr)[pedal] >= 0:
        kept = ints(m, offsets.actuator_history)[2 * pedal]
    needed = math.ceil((delay + period) / step - _WHOLE) + 1
    if delay > 0.0 and kept < needed:
        return Finding(HISTORY, offsets.name_actuatoradr, pedal, float(kept), float(needed))
    return Finding(WELL, names, gyro_rate, 0.0, 0.0)


_BUILD = "write the numbers with `helisim vehicle build FOLDER`, of the vehicle's folder"
_NINE = f"a vehicle's actuators stand one after the other: {', '.join(ACTUATORS)}"
_RUN = f"a vehicle's sensors stand one after the other: {', '.join(SENSORS)}"


def sentence(left: Note) -> str:
    """Return what a note says: the model's element, what is missing, and what to do."""
    it = repr(left.element) if left.element else "without a name"
    return f"model {left.model!r}: {_said(left.code, it, left.found, left.wanted)}"


def _said(code: int, it: str, found: float, wanted: float) -> str:
    if code == NOT_OURS:
        return (
            f'actuator {it} has dyntype="user" and is of no helicopter of helisim; while '
            "helisim's callbacks are installed nobody computes its activations, which stay as "
            "they are. Give it another dyntype, or step this model outside of installed()"
        )
    if code == OVERRULED:
        return (
            f"somebody set ctrl of actuator {it} to {found:.6g} while the gyro flies, which sets "
            "it at each of its ticks: what was set is lost. Fly with the sticks COL, LON, LAT and "
            "PED, or take the gyro off the servos with helisim.set_controller(model, None)"
        )
    if code == NO_NUMBERS:
        return f"actuator {it} has no user numbers, which the force laws need; {_BUILD}"
    if code == TOO_FEW:
        return (
            f"actuator {it} has room for {found:.0f} user numbers, and a vehicle has {wanted:.0f}; "
            f'take <size nuser_actuator="{found:.0f}"/> out of the model, or out of the scene '
            f"that it is attached to; if it is in neither, {_BUILD}"
        )
    if code == OTHER_LAYOUT:
        return (
            f"actuator {it} has user numbers of another helisim (layout {found:.0f}, here "
            f"{wanted:.0f}); {_BUILD}"
        )
    if code == NOT_NINE:
        return (
            f"actuator {it} has the user numbers of {_label(found)}, and there is no "
            f"{_label(wanted)} in its place; {_NINE}. Put them in this order, then {_BUILD}"
        )
    if code == OTHER_ORDER:
        return (
            f"actuator {it} has not the user numbers of a vehicle's {_label(wanted)}, which "
            f"belongs in its place; {_NINE}. Put them in this order, then {_BUILD}"
        )
    if code == NO_JOINT:
        return (
            f"actuator {it} must have the free joint of the vehicle: joint=NAME of the "
            "<freejoint/> in the body of the whole vehicle"
        )
    if code == ACTIVATIONS:
        return (
            f"actuator {it} has {found:.0f} activations where {wanted:.0f} are needed; "
            f'give it dyntype="user" and actdim="{wanted:.0f}"'
        )
    if code == NO_SENSORS:
        return f"body {it} has no sensors of a vehicle; {_RUN}. Copy them from models/jr700"
    if code == WRONG_SENSOR:
        name = list(SENSORS)[int(wanted)]
        return f"sensor {it} is not {name!r}, which should be in its place; {_RUN}"
    if code == NO_NEIGHBOUR:
        name, side = list(SENSORS)[int(wanted)], "before" if wanted < _AHEAD else "behind"
        return f"{side} sensor {it} there is no {name!r}; {_RUN}"
    if code == NO_ACTUATION:
        return (
            f"actuator {it} and the servos stand still, as actuation is switched off; take "
            '<flag actuation="disable"/> out of the scene, or step it outside of installed()'
        )
    if code == NO_PASSIVE:
        return (
            f"the rotors of the vehicle with actuator {it} give no force, as passive forces are "
            'switched off; take spring="disable" or damper="disable" out of the scene\'s <flag/>'
        )
    if code == NO_SENSING:
        return (
            f"the gyro and the recorder of the vehicle with actuator {it} see nothing, as sensors "
            'are switched off; take <flag sensor="disable"/> out of the scene'
        )
    if code == NO_GROUP:
        return (
            f"actuator {it} is in group {found:.0f}, which is switched off; take {found:.0f} out "
            "of the scene's <option actuatorgroupdisable/>, or give the actuator another group"
        )
    if code == PERIOD:
        return (
            f"sensor {it} is what the gyro reads each {found:g} s, and the time step is longer, "
            f'{wanted:g} s; give the scene <option timestep="{found:g}"/> or a part of that'
        )
    if code == STRANGE_LAW:
        return (
            f"actuator {it} names a controller that this process does not know: it was set in "
            "another one, or its flight is over. Set it here, with helisim.set_controller"
        )
    return (  # HISTORY
        f"actuator {it} keeps {found:.0f} samples, and its delay needs {wanted:.0f} of the time "
        "step that is set; raise its nsample, or take the time step of the vehicle's MJCF"
    )


def _label(ordinal: float) -> str:
    return ACTUATORS[int(ordinal)] if 0.0 <= ordinal < len(ACTUATORS) else f"number {ordinal:g}"
