"""Is there all in a model that the force laws count on? Asked once a model, inside MuJoCo's step.

A vehicle is known by the user numbers of its actuators. One that lacks some of what it needs would
fall, or fly without its gyro, and nothing would say so: it is noted, and `installed` raises. So is
one that has the shape of a vehicle, without numbers. User actuators of others are not helisim's to
refuse, but nobody computes their activations in the block either, and that is worth a warning.

Nothing can be raised inside a callback, as MuJoCo called it: the first remark of each kind is kept.
"""

import ctypes
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from helisim.physics.kernel import address_of, call, kernel, longs_at
from helisim.physics.laws import is_registered
from helisim.physics.layout import (
    ACTUATORS,
    CONTROL,
    FIRST_LAW_STATE,
    LAYOUT,
    MAGIC,
    PARAM,
    ROTOR,
    ROTOR_STATES,
    SENSORS,
    SHIPPED_LAW,
    STATE,
)
from helisim.physics.memory import double, integer, long, offsets

EXAMINE, UNKNOWN_LAW = 0, 1
"""Reports of compiled code: a model that is flown for the first time, a law that isn't there."""

_USER = int(mujoco.mjtDyn.mjDYN_USER)
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_SERVO_STATES = 2
_BEFORE_STICK = list(SENSORS).index("stick")
_GYRO_RATE = list(SENSORS).index("gyro_rate")
_KINDS = ("GYRO", "ACCELEROMETER", "VELOCIMETER", "FRAMEQUAT", "FRAMEPOS", "GYRO")
_KINDS += ("USER",) * (len(SENSORS) - 7) + ("CLOCK",)
_TYPES = [int(getattr(mujoco.mjtSensor, f"mjSENS_{kind}")) for kind in _KINDS]
ACTUATION_OFF = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
PASSIVE_OFF = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
"""With both MuJoCo leaves all passive forces out, and helisim's are among them."""
_SENSING_OFF = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_GROUPS = 31
"""Groups of actuators that MuJoCo can switch off."""
_WHOLE = 1e-6
"""Relative rounding of a number of steps."""
_GOLDEN = 0x9E3779B1
"""Odd, 2^32 over the golden mean (Knuth's multiplicative hash)."""

_met = globals().get("_met") or (ctypes.c_int64 * 256)()
"""Models that are remembered as met or examined, by a number of their own.

A module that is loaded again finds those of the code that is running.
"""
_met_address = address_of("helisim_met", ctypes.addressof(_met))


class Remark(NamedTuple):
    """A fault of a model in a sentence, and whether its vehicle can't be flown so."""

    refused: bool
    text: str


_remarks: dict[bool, Remark] = globals().get("_remarks") or {}


@ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
def _reported(address: int, code: int, actuator: int) -> None:
    found = examine(address) if code == EXAMINE else []
    if code == UNKNOWN_LAW:
        model = _Raw(address)
        found.append(model.remark(_unknown_law(f"actuator {model.it('actuator', actuator)}")))
    for remark in found:
        _remarks.setdefault(remark.refused, remark)


_alive = [*globals().get("_alive", ()), _reported]
_report_address = address_of("helisim_report", ctypes.cast(_reported, ctypes.c_void_p).value or 0)


def taken() -> list[Remark]:
    """Return the remarks about models that were flown, and forget them."""
    found = [_remarks.pop(refused) for refused in (True, False) if refused in _remarks]
    return found


def forget_models() -> None:
    """Let every model be new again."""
    ctypes.memset(_met, 0, ctypes.sizeof(_met))


@kernel()
def report(m, code, actuator):
    """Call Python about a model: its address, what there is to say, and of which actuator."""
    call(_report_address(), (m, np.int64(code), np.int64(actuator)))


@kernel()
def examine_new(m, d, offsets, switched_off):
    """Have a model examined, once in a block, where so much is switched off by its options.

    MuJoCo asks for no controls without actuation, and for sensors alone without passive forces too.
    It takes a step from time 0 when it compiles a model. That is no flight yet, so a model is due
    when it starts for the second time, or goes on.
    """
    if integer(m, offsets.disableflags) & switched_off != switched_off:
        return
    number = m ^ (long(m, offsets.actuator_user) >> 4) ^ (long(m, offsets.sensor_adr) << 9)
    number ^= long(m, offsets.nuser_actuator) << 40
    number = (number ^ (number >> 12)) & 0x7FFFFFFFFFFFFFFF | 1  # another model hardly has it
    spread = (((number >> 1 ^ (number >> 32)) & 0x7FFFFFFF) * _GOLDEN >> 24) & 0xFF
    place = longs_at(_met_address() + 8 * spread)
    if place[0] == number:
        return
    time = double(d, offsets.time)
    if time <= double(m, offsets.timestep):
        met = number - 1
        if place[0] != met:
            place[0] = met
            return
        if time > 0.0:
            return
    place[0] = number
    report(m, EXAMINE, -1)


class _Raw:
    """An mjModel at an address, its fields by name."""

    def __init__(self, address: int) -> None:
        self.address = address
        self.offsets = offsets()
        self.user_room = self.number("nuser_actuator")
        self.users = self.array("actuator_user", ctypes.c_double)

    def number(self, field: str, kind: Any = ctypes.c_int64) -> Any:
        return kind.from_address(self.address + getattr(self.offsets, field)).value

    def array(self, field: str, kind: Any = ctypes.c_int) -> Any:
        return ctypes.cast(self.number(field), ctypes.POINTER(kind))

    def user(self, actuator: int, index: int) -> float:
        """Return one of the user numbers of an actuator."""
        return self.users[self.user_room * actuator + index]

    def name(self, start: int) -> str:
        return ctypes.string_at(self.number("names") + start).decode("utf-8", "replace")

    def it(self, kind: str, element: int) -> str:
        """Return the name of an actuator, sensor or body, for a sentence."""
        name = self.name(self.array(f"name_{kind}adr")[element])
        return repr(name) if name else "without a name"

    def remark(self, text: str, *, refused: bool = True) -> Remark:
        return Remark(refused, f"model {self.name(0)!r}: {text}")


def examine(address: int) -> list[Remark]:
    """Return what is wrong with the mjModel at an address."""
    model, found = _Raw(address), []
    for actuator in range(model.number("nactuator")):
        if _is_ours(model, actuator):
            found += [model.remark(text) for text in [*_of_vehicle(model, actuator)][:1]]
        elif model.array("actuator_dyntype")[actuator] == _USER:
            it = model.it("actuator", actuator)
            if _has_the_shape(model, actuator):
                text = f"actuator {it} has no user numbers, which the force laws need; {_BUILD}"
                found.append(model.remark(text))
            elif not any(_has_the_shape(model, actuator + k) for k in range(1, ROTOR + 1)):
                text = (  # of a shape the rotor is named
                    f'actuator {it} has dyntype="user" and is of no helicopter of helisim; while '
                    "helisim's callbacks are installed nobody computes its activations, which stay "
                    "as they are. Give it another dyntype, or step this model outside of "
                    "installed()"
                )
                found.append(model.remark(text, refused=False))
    return found


def _is_ours(model: _Raw, actuator: int) -> bool:
    return model.user_room > PARAM.ordinal and model.user(actuator, PARAM.magic) == MAGIC


def _has_the_shape(model: _Raw, rotor: int) -> bool:
    """Return whether an actuator and those before it have as many activations as a vehicle's."""
    if not ROTOR <= rotor < model.number("nactuator"):
        return False
    count, kind = model.array("actuator_actnum"), model.array("actuator_dyntype")
    servos = range(rotor - 4, rotor)
    shape = all(count[servo] == _SERVO_STATES and kind[servo] == _USER for servo in servos)
    return shape and count[rotor] >= ROTOR_STATES and kind[rotor] == _USER


_BUILD = "write the numbers with `helisim vehicle build FOLDER`, of the vehicle's folder"
_NINE = f"a vehicle's actuators stand one after the other: {', '.join(ACTUATORS)}"
_RUN = f"a vehicle's sensors stand one after the other: {', '.join(SENSORS)}"


def _of_vehicle(model: _Raw, actuator: int) -> Iterator[str]:
    """Yield what is wrong with the vehicle of an actuator; of its rotor, all but the order."""
    ordinal = int(model.user(actuator, PARAM.ordinal))
    for k, label in enumerate(ACTUATORS):
        one = actuator - ordinal + k
        if not 0 <= one < model.number("nactuator"):
            own = ACTUATORS[ordinal] if 0 <= ordinal <= ROTOR else f"number {ordinal:g}"
            yield (
                f"actuator {model.it('actuator', actuator)} has the user numbers of {own}, and "
                f"there is no {label} in its place; {_NINE}. Put them in this order, then {_BUILD}"
            )
        elif not _is_ours(model, one) or model.user(one, PARAM.ordinal) != k:
            yield (
                f"actuator {model.it('actuator', one)} has not the user numbers of a vehicle's "
                f"{label}, which belongs in its place; {_NINE}. Put them in this order, then "
                f"{_BUILD}"
            )
    if ordinal != ROTOR:
        return
    rotor, it = actuator, f"actuator {model.it('actuator', actuator)}"
    if model.user_room < len(PARAM):
        yield (
            f"{it} has room for {model.user_room} user numbers, and a vehicle has {len(PARAM)}; "
            f'take <size nuser_actuator="{model.user_room}"/> out of the model, or out of the '
            f"scene that it is attached to; if it is in neither, {_BUILD}"
        )
    if (layout := model.user(rotor, PARAM.layout)) != LAYOUT:
        yield (
            f"{it} has user numbers of another helisim (layout {layout:.0f}, here {LAYOUT:.0f}); "
            f"{_BUILD}"
        )
    yield from _of_switches(model, rotor, it)
    joint = model.array("actuator_trnid")[2 * rotor]
    moves = model.array("actuator_trntype")[rotor] == _JOINT
    if not moves or model.array("jnt_type")[joint] != _FREE:
        yield (
            f"{it} must have the free joint of the vehicle: joint=NAME of the <freejoint/> in the "
            "body of the whole vehicle"
        )
    laws = [model.user(rotor, PARAM.swash_states), model.user(rotor, PARAM.tail_states)]
    states = [_SERVO_STATES] * 4 + [int(FIRST_LAW_STATE - STATE.flap_a + 2.0 * sum(laws))]
    for one, needed in enumerate(states, rotor - ROTOR + CONTROL.servo_front):
        found = model.array("actuator_actnum")[one]
        if found != needed if one < rotor else found < needed:
            yield (
                f"actuator {model.it('actuator', one)} has {found} activations where {needed} are "
                f'needed; give it dyntype="user" and actdim="{needed}"'
            )
    yield from _of_sensors(model, rotor, model.array("jnt_bodyid")[joint])
    token, handles = model.user(rotor, PARAM.law_token), []
    for law, count in zip((PARAM.swash_law, PARAM.tail_law), laws):
        handle = model.user(rotor, law)
        if handle > SHIPPED_LAW and handle not in handles:  # one may move all servos
            handles.append(handle)
            if not is_registered(handle, token, count):
                yield _unknown_law(it)


def _unknown_law(it: str) -> str:
    return (
        f"{it} names a controller that this process does not know: it was set in another one, or "
        "its flight is over. Set it here, with helisim.set_controller"
    )


def _of_switches(model: _Raw, rotor: int, it: str) -> Iterator[str]:
    """Yield what of a vehicle is switched off by the model's options."""
    flags = model.number("disableflags", ctypes.c_int)
    if flags & ACTUATION_OFF:
        yield (
            f"{it} and the servos stand still, as actuation is switched off; take "
            '<flag actuation="disable"/> out of the scene, or step it outside of installed()'
        )
    if flags & PASSIVE_OFF == PASSIVE_OFF:
        yield (
            f"the rotors of the vehicle with {it} give no force, as passive forces are switched "
            'off; take spring="disable" or damper="disable" out of the scene\'s <flag/>'
        )
    if flags & _SENSING_OFF:
        yield (
            f"the gyro and the recorder of the vehicle with {it} see nothing, as sensors are "
            'switched off; take <flag sensor="disable"/> out of the scene'
        )
    groups, off = model.array("actuator_group"), model.number("disableactuator", ctypes.c_int)
    for one in range(rotor - ROTOR + CONTROL.servo_front, rotor + 1):
        if 0 <= (group := groups[one]) < _GROUPS and off >> group & 1:
            yield (
                f"actuator {model.it('actuator', one)} is in group {group}, which is switched off; "
                f"take {group} out of the scene's <option actuatorgroupdisable/>, or give the "
                "actuator another group"
            )


def _of_sensors(model: _Raw, rotor: int, body: int) -> Iterator[str]:
    """Yield what is wrong with the sensors of a vehicle, and with the times of its gyro."""
    names, count = list(SENSORS), model.number("nsensor")
    kinds, numbers = model.array("sensor_type"), model.array("sensor_dim")
    objects, owners = model.array("sensor_objtype"), model.array("sensor_objid")
    user, four = _TYPES[_BEFORE_STICK], SENSORS["stick"]
    for stick in range(count):
        found = kinds[stick], objects[stick], numbers[stick], owners[stick]
        if found == (user, _BODY, four, body):
            break
    else:
        it = model.it("body", body)
        yield f"body {it} has no sensors of a vehicle; {_RUN}. Copy them from models/jr700"
        return
    # outwards: the first that isn't there is missing
    for k in [*range(_BEFORE_STICK, -1, -1), *range(_BEFORE_STICK + 1, len(names))]:
        sensor = stick - _BEFORE_STICK + k
        if not 0 <= sensor < count:
            near = model.it("sensor", max(0, sensor - 1))
            side = "before" if k < _BEFORE_STICK else "behind"
            yield f"{side} sensor {near} there is no {names[k]!r}; {_RUN}"
        elif (kinds[sensor], numbers[sensor]) != (_TYPES[k], SENSORS[names[k]]):
            it = model.it("sensor", sensor)
            yield f"sensor {it} is not {names[k]!r}, which should be in its place; {_RUN}"
    gyro_rate = stick - _BEFORE_STICK + _GYRO_RATE
    if model.array("sensor_interval", ctypes.c_double)[2 * gyro_rate] == 0.0:
        return  # not sampled
    step, period = model.number("timestep", ctypes.c_double), model.user(rotor, PARAM.gyro_period)
    if step > period * (1.0 + _WHOLE):
        yield (
            f"sensor {model.it('sensor', gyro_rate)} is what the gyro reads each {period:g} s, and "
            f'the time step is longer, {step:g} s; give the scene <option timestep="{period:g}"/> '
            "or a part of that"
        )
    pedal = rotor - ROTOR + CONTROL.ped
    delay = model.array("actuator_delay", ctypes.c_double)[pedal]
    has_history = model.array("actuator_historyadr")[pedal] >= 0
    kept = model.array("actuator_history")[2 * pedal] if has_history else 0
    needed = math.ceil((delay + period) / step - _WHOLE) + 1
    if delay > 0.0 and kept < needed:
        yield (
            f"actuator {model.it('actuator', pedal)} keeps {kept} samples, and its delay needs "
            f"{needed} of the time step that is set; raise its nsample, or take the time step of "
            "the vehicle's MJCF"
        )
