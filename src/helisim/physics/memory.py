"""mjModel and mjData as compiled code reads them: fields by address, helisim's vehicles, time.

What a model lacks that the force laws count on is said when it is first flown, or asked for.

Offsets come from `mujoco.introspect` and are checked against live objects. Integrators other than
Runge-Kutta get the step's mean derivatives by a staggered (leapfrog) scheme of second order, with
positions and the tip-path plane's tilt halfway between steps; servos by the exact exponential.
"""

import ctypes
import math
from collections import namedtuple
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from helisim.base.errors import CallbackError, InputError
from helisim.physics.kernel import address_of, call, doubles_at, ints_at, kernel, known, longs_at
from helisim.physics.laws import is_registered
from helisim.physics.layout import (
    ACTUATORS,
    CONTROL,
    HANDS_OFF_ROTOR,
    LAYOUT,
    MAGIC,
    PARAM,
    ROTOR,
    ROTOR_STATES,
    SENSOR,
    SENSORS,
    SHIPPED_LAW,
    STATE,
    WITHOUT_LAWS,
)

_MODEL = namedtuple(
    "_MODEL",
    "nactuator nuser_actuator nuserdata nsensor ngeom actuator_user actuator_actnum actuator_trnid "
    "actuator_actadr actuator_ctrladr actuator_history actuator_historyadr actuator_delay "
    "jnt_bodyid body_rootid body_dofadr body_dofnum dof_parentid geom_type geom_contype "
    "geom_conaffinity geom_bodyid geom_size sensor_type sensor_dim sensor_adr sensor_objtype "
    "sensor_objid",
)._fields
_OPTION = ("timestep", "wind", "integrator", "disableflags")
_DATA = namedtuple(
    "_DATA",
    "time act act_dot ctrl history xpos xmat cvel cdof subtree_com geom_xpos geom_xmat "
    "qfrc_passive qfrc_constraint sensordata userdata",
)._fields
_FIELDS = (*_MODEL, *_OPTION, *_DATA)
Offsets = namedtuple("Offsets", (*_FIELDS, "fingerprint"), defaults=[0])
"""Byte offsets of the fields that the callbacks read or write; `fingerprint` is no field."""
known(Offsets)
_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_RUNGE_KUTTA = int(mujoco.mjtIntegrator.mjINT_RK4)
_PARAMETERS = len(PARAM)
_STICKS = SENSORS["stick"]
_STICK, _GYRO_RATE = (list(SENSORS).index(name) for name in ("stick", "gyro_rate"))
_LAST = len(SENSORS) - 1
TICK_TOLERANCE = 1e-6  # share of a period that counts as early, for rounding
TIME_TOLERANCE = 1e-9  # s, by which equal times may differ


@cache
def offsets() -> Any:
    """Return the byte offset of every field; CallbackError if MuJoCo's structures differ."""
    model, data, option = (_ctype(_structure(name)) for name in ("mjModel", "mjData", "mjOption"))
    try:
        found = Offsets(
            *(getattr(model, name).offset for name in _MODEL),
            *(model.opt.offset + getattr(option, name).offset for name in _OPTION),
            *(getattr(data, name).offset for name in _DATA),
        )
    except AttributeError as error:
        raise CallbackError(
            f"MuJoCo {mujoco.__version__} has no field that helisim needs: {error}; "
            "install a version that this helisim supports"
        ) from None
    _verify(found)
    return found


_SCALARS: dict[str, Any] = {
    "unsigned int": ctypes.c_uint,
    "char": ctypes.c_char,
    "unsigned char": ctypes.c_ubyte,
    "float": ctypes.c_float,
    "double": ctypes.c_double,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
    "int64_t": ctypes.c_int64,
    "mjtNum": ctypes.c_double,
    "mjtByte": ctypes.c_ubyte,
    "mjtBool": ctypes.c_bool,
    "mjtSize": ctypes.c_int64,
}


def _structure(name: str) -> Any:
    return structs.STRUCTS.get(name) or structs.STRUCTS.get(f"{name}_")


def _ctype(node: Any) -> Any:
    """Return the C type of a node of MuJoCo's introspection, a structure or a field's type."""
    match node:
        case ast_nodes.PointerType():
            return ctypes.c_void_p
        case ast_nodes.ArrayType():
            return _ctype(node.inner_type) * math.prod(node.extents)
        case ast_nodes.ValueType() if _structure(node.name) is None:
            return _SCALARS.get(node.name, ctypes.c_int)  # int and enumerations
        case ast_nodes.ValueType():
            return _ctype(_structure(node.name))
    members = [
        (getattr(field, "name", None) or f"anonymous_{k}", _ctype(getattr(field, "type", field)))
        for k, field in enumerate(node.fields)
    ]
    return type("Structure", (ctypes.Structure,), {"_fields_": members})


_PROBE = """
<mujoco>
  <option timestep="0.00137" integrator="RK4" wind="1.25 2.5 3.75">
    <flag warmstart="disable" sensor="disable"/>
  </option>
  <size nuser_actuator="3" nuserdata="2"/>
  <worldbody>
    <body name="b">
      <freejoint name="j"/>
      <geom size="0.1"/>
    </body>
  </worldbody>
  <actuator>
    <general joint="j" dyntype="user" actdim="2" delay="0.01" nsample="9" user="1 2 3"/>
    <general joint="j" dyntype="user" actdim="1"/>
  </actuator>
  <sensor>
    <user dim="2" objtype="body" objname="b" needstage="acc" datatype="real"/>
  </sensor>
</mujoco>
"""


def _verify(found: Any) -> None:
    model = mujoco.MjModel.from_xml_string(_PROBE)
    data = mujoco.MjData(model)
    data.time = 0.625
    for name in _FIELDS:
        owner = data if name in _DATA else model.opt if name in _OPTION else model
        address = (data if name in _DATA else model)._address + getattr(found, name)
        expected = getattr(owner, name)
        if isinstance(expected, np.ndarray):
            expected = expected.__array_interface__["data"][0]
            held = address if name in _OPTION else ctypes.c_void_p.from_address(address).value
        else:
            whole = ctypes.c_int if name in _OPTION else ctypes.c_int64
            kind = ctypes.c_double if isinstance(expected, float) else whole
            held = kind.from_address(address).value
        if held != expected:
            raise CallbackError(
                f"MuJoCo {mujoco.__version__}: field {name!r} is not where the introspection "
                "says; install a version of MuJoCo that this helisim supports"
            )


@kernel()
def doubles(base, offset):
    """Return the double array that a pointer field holds."""
    return doubles_at(longs_at(base + offset)[0])


@kernel()
def doubles_from(base, offset, first):
    """Return the double array that a pointer field holds, from its element `first` on."""
    return doubles_at(longs_at(base + offset)[0] + 8 * first)


@kernel()
def ints(base, offset):
    """Return the int array that a pointer field holds."""
    return ints_at(longs_at(base + offset)[0])


@kernel()
def long(base, offset):
    """Return the value of a 64-bit integer field."""
    return longs_at(base + offset)[0]


@kernel()
def integer(base, offset):
    """Return the value of an int field."""
    return ints_at(base + offset)[0]


@kernel()
def double(base, offset):
    """Return the value of a double field."""
    return doubles_at(base + offset)[0]


VehicleView = namedtuple("VehicleView", "m d offsets rotor body sensors par act rate controls")
"""A vehicle inside mjModel and mjData; its pointers lead into MuJoCo's own arrays.

m, d: addresses; rotor, body: ids; sensors: start in `sensordata`, negative if none; par, act,
controls: by `PARAM`, `STATE`, `CONTROL`; rate: of the activations, 1/s.
"""


@kernel()
def is_rotor(m, offsets, actuator):
    """Return whether an actuator is the rotor of one of our vehicles, all the others before it."""
    if long(m, offsets.nuser_actuator) < _PARAMETERS:
        return False
    user = user_numbers(m, offsets, actuator)
    ours = user[PARAM.magic] == MAGIC and user[PARAM.layout] == LAYOUT
    if not ours or user[PARAM.ordinal] != ROTOR or actuator < ROTOR:
        return False
    first = user_numbers(m, offsets, actuator - ROTOR)
    return first[PARAM.magic] == MAGIC and first[PARAM.ordinal] == 0.0


@kernel()
def user_numbers(m, offsets, actuator):
    """Return the user numbers of an actuator; the rotor's are the vehicle's parameters."""
    return doubles_from(m, offsets.actuator_user, actuator * long(m, offsets.nuser_actuator))


@kernel()
def view_of(m, d, offsets, rotor):
    """Return a view of the vehicle to which a rotor actuator belongs."""
    body = ints(m, offsets.jnt_bodyid)[ints(m, offsets.actuator_trnid)[2 * rotor]]
    state = ints(m, offsets.actuator_actadr)[rotor] - STATE.flap_a
    control = ints(m, offsets.actuator_ctrladr)[rotor] - ROTOR
    return VehicleView(
        m,
        d,
        offsets,
        rotor,
        body,
        first_sensor(m, offsets, body),
        user_numbers(m, offsets, rotor),
        doubles_from(d, offsets.act, state),
        doubles_from(d, offsets.act_dot, state),
        doubles_from(d, offsets.ctrl, control),
    )


@kernel()
def states_end(view):
    """Return how many activations a vehicle has, from its first, its laws' states included."""
    return STATE.flap_a + ints(view.m, view.offsets.actuator_actnum)[view.rotor]


@kernel()
def first_sensor(m, offsets, body):
    """Return where a vehicle's `SENSORS` start in `sensordata`; negative if they lack one."""
    stick = -1
    for k in range(long(m, offsets.nsensor)):
        is_user = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        is_sticks = is_user and ints(m, offsets.sensor_dim)[k] == _STICKS
        is_of_body = is_sticks and ints(m, offsets.sensor_objtype)[k] == _BODY
        if is_of_body and ints(m, offsets.sensor_objid)[k] == body:
            stick = k
            break
    start, last = stick - _STICK, stick - _STICK + _LAST
    if start < 0 or last >= long(m, offsets.nsensor):
        return -1
    address = ints(m, offsets.sensor_adr)
    first = address[stick] - SENSOR.stick_col
    whole = address[start] == first and address[last] == first + SENSOR.clock
    return first if whole else -1


@kernel()
def sensor_numbers(view):
    """Return the numbers of a vehicle's sensors, by `SENSOR`."""
    return doubles_from(view.d, view.offsets.sensordata, view.sensors)


@kernel()
def speed_ratio(view):
    """Return the rotor's speed over its nominal one; an ideal governor keeps what is asked for."""
    return view.act[STATE.speed] if view.par[PARAM.drive_governor] else commanded_speed(view)


@kernel()
def commanded_speed(view):
    """Return the rotor speed that is asked for, over the nominal one; 1 where a pilot flies."""
    pilot = view.par[PARAM.pilot_on]
    flies = pilot != 0.0 and pilot != HANDS_OFF_ROTOR
    return 1.0 if flies else view.controls[CONTROL.rotor]


@kernel()
def held_for(view):
    """Return for how long (s) the integrator holds an evaluation; 0 if it wants derivatives."""
    if integer(view.m, view.offsets.integrator) == _RUNGE_KUTTA:
        return 0.0
    return double(view.m, view.offsets.timestep)


@kernel()
def position_ahead(view, position, ahead):
    """Return a servo's position a time `ahead` (s) from now; its rate stands behind it."""
    limit = view.par[PARAM.servo_rate_limit]
    return view.act[position] + ahead * min(limit, max(-limit, view.act[position + 1]))


@kernel()
def clock(view):
    """Return the time at which this step started, s."""
    return sensor_numbers(view)[SENSOR.clock]


@kernel()
def tick_number(par, time):
    """Return how many times the gyro has acted from time 0 to a time (s)."""
    return math.floor(time / par[PARAM.gyro_period] + TICK_TOLERANCE)


@kernel()
def is_tick(view):
    """Return whether the gyro acts now: at a step's start, once in each of its periods."""
    time = double(view.d, view.offsets.time)
    if time != clock(view):
        return False
    before = time - double(view.m, view.offsets.timestep)
    return tick_number(view.par, time) != tick_number(view.par, before)


@kernel()
def last_tick(view):
    """Return the time at which the gyro last acted, s; 0 where there is no clock."""
    if view.sensors < 0:
        return 0.0
    return view.par[PARAM.gyro_period] * tick_number(view.par, clock(view))


@kernel()
def delayed_control(view, ordinal, now):
    """Return a control one actuator delay before `now`, s, linear between ticks."""
    m, offsets = view.m, view.offsets
    actuator = view.rotor - ROTOR + ordinal
    history = ints(m, offsets.actuator_historyadr)[actuator]
    delay = doubles(m, offsets.actuator_delay)[actuator]
    if history < 0 or delay <= 0.0:
        return view.controls[ordinal]
    period = view.par[PARAM.gyro_period]  # whatever the time step, the control is read at ticks
    wanted = now - delay
    tick = period * math.floor(wanted / period + TICK_TOLERANCE)
    ahead = max(0.0, (wanted - tick) / period)
    before = past_control(view, actuator, tick)
    return before + ahead * (past_control(view, actuator, tick + period) - before)


@kernel()
def past_control(view, actuator, time):
    """Return a delayed actuator's control at a time, s: its newest sample not after that."""
    first = ints(view.m, view.offsets.actuator_historyadr)[actuator]
    count = ints(view.m, view.offsets.actuator_history)[2 * actuator]
    history = doubles(view.d, view.offsets.history)
    k = int(history[first + 1])
    left = count - 1
    while left > 0 and history[first + 2 + k] > time + TIME_TOLERANCE:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    return history[first + 2 + count + k]


ACTUATION_OFF = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
PASSIVE_OFF = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)
_SENSING_OFF = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_KINDS = ("GYRO", "ACCELEROMETER", "VELOCIMETER", "FRAMEQUAT", "FRAMEPOS", "GYRO")
_KINDS += ("USER",) * (len(SENSORS) - 7) + ("CLOCK",)
_TYPES = [int(getattr(mujoco.mjtSensor, f"mjSENS_{kind}")) for kind in _KINDS]
_GROUPS, _WHOLE = 31, 1e-6
_GOLDEN = 0x9E3779B1  # odd, 2^32 over the golden mean (Knuth's multiplicative hash)
_BUILD = "write the numbers with `helisim vehicle build FOLDER`, of the vehicle's folder"

NO_FREE_JOINT = (
    "must have the free joint of the vehicle: joint=NAME of the <freejoint/> in the body of the "
    "whole vehicle"
)

_met = (ctypes.c_int64 * 256)()
"""Models that are remembered as met or examined, by a number of their own."""
_met_address = address_of("helisim_met", ctypes.addressof(_met))
_remarks: list[str] = []


@cache
def _copied() -> Any:
    names = ("libmujoco.", "mujoco.dll")
    folder = Path(mujoco.__file__).parent
    library = next(file for file in folder.iterdir() if file.name.startswith(names))
    function = ctypes.CDLL(str(library)).mj_copyModel
    function.restype, function.argtypes = ctypes.c_void_p, [ctypes.c_void_p] * 2
    return function


@ctypes.CFUNCTYPE(None, ctypes.c_int64)
def _reported(address: int) -> None:
    if not _remarks:
        _remarks.extend(examine(mujoco.MjModel._from_model_ptr(_copied()(None, address))))


_report_address = address_of("helisim_report", ctypes.cast(_reported, ctypes.c_void_p).value or 0)


def taken() -> list[str]:
    """Return the first remark about models that were flown, and forget the others."""
    found = _remarks[:1]
    _remarks.clear()
    return found


def forget_models() -> None:
    """Let every model be new again."""
    ctypes.memset(_met, 0, ctypes.sizeof(_met))


@kernel()
def report(m):
    """Have Python examine a model, by its address."""
    call(_report_address(), (m,))


@kernel()
def examine_new(m, d, offsets, switched_off):
    """Have a model examined, once in a block, where so much is switched off by its options."""
    if integer(m, offsets.disableflags) & switched_off != switched_off:
        return
    number = m ^ (long(m, offsets.actuator_user) >> 4) ^ (long(m, offsets.sensor_adr) << 9)
    number ^= long(m, offsets.nuser_actuator) << 40
    number = number & 0x7FFFFFFFFFFFFFFF | 1  # another model hardly has it
    place = longs_at(_met_address() + 8 * ((number * _GOLDEN >> 24) & 0xFF))
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
    report(m)


def examine(model: mujoco.MjModel) -> list[str]:
    """Return what is wrong with the helicopters in a model, a sentence each."""
    users, count = model.actuator_user, model.nactuator
    ordinals = np.full(count, -1.0)
    if model.nuser_actuator > PARAM.ordinal:
        ours = users[:, PARAM.magic] == MAGIC
        ordinals[ours] = users[ours, PARAM.ordinal]
    faults = []
    for one, ordinal in enumerate(ordinals):
        first, it = one - int(ordinal), f"actuator {model.actuator(one).name or one!r}"
        if ordinal < 0.0:
            user = model.actuator_dyntype[one] == mujoco.mjtDyn.mjDYN_USER
            if user and model.actuator_actnum[one] >= ROTOR_STATES:
                faults.append(f"{it} has no user numbers, which the force laws need; {_BUILD}")
        elif ordinals[max(first, 0) : first + len(ACTUATORS)].tolist() != [*range(ROTOR + 1)]:
            faults.append(
                f"{it} is of a helicopter whose actuators don't stand one after the other, each "
                f"with its user numbers: {', '.join(ACTUATORS)}; put them in this order, then "
                f"{_BUILD}"
            )
        elif ordinal == ROTOR:
            faults += [f"{it} {text}" for text in _faults(model, one)][:1]
    name = model.names.partition(b"\0")[0].decode("utf-8", "replace")
    return [f"model {name!r}: {fault}" for fault in faults]


def _faults(model: mujoco.MjModel, rotor: int) -> Iterator[str]:
    par, option = model.actuator_user[rotor], model.opt
    if par.size < len(PARAM) or par[PARAM.layout] != LAYOUT:
        yield (
            f"has {par.size} user numbers, or those of another helisim, where {len(PARAM)} of this "
            f"one are needed; take nuser_actuator out of the scene's <size/>, or {_BUILD}"
        )
        return
    body = free_body(model, rotor)
    if body is None:
        yield NO_FREE_JOINT
        return
    flags, driven = option.disableflags, slice(rotor - ROTOR + CONTROL.servo_front, rotor + 1)
    groups = [g for g in model.actuator_group[driven].tolist() if 0 <= g < _GROUPS]
    off = flags & (ACTUATION_OFF | _SENSING_OFF) or flags & PASSIVE_OFF == PASSIVE_OFF
    if off or any(option.disableactuator >> group & 1 for group in groups):
        yield (
            "can't fly: the scene's <option> switches off actuation, a group of actuators, "
            "sensors, or both spring and damper; let them be on"
        )
    states = [par[PARAM.swash_states], par[PARAM.tail_states]]
    needed = [2, 2, 2, 2, int(WITHOUT_LAWS + 2.0 * sum(states))]
    found = model.actuator_actnum[driven].tolist()
    if found[:-1] != needed[:-1] or found[-1] < needed[-1]:
        yield f"and the servos before it have actdim {found}, needed are {needed}"
    yield from _sensor_faults(model, rotor, body)
    laws = {par[PARAM.tail_law]: states[1], par[PARAM.swash_law]: states[0]}  # one may be both
    for law, count in laws.items():
        if law > SHIPPED_LAW and not is_registered(law, par[PARAM.law_token], count):
            yield (
                "names a controller that this process does not know: it was set in another one, or "
                "its flight is over; set it here, with helisim.set_controller"
            )


def free_body(model: mujoco.MjModel, actuator: int) -> int | None:
    """Return the body whose free joint an actuator has, None if it has none."""
    joint = int(model.actuator_trnid[actuator, 0])
    moves = model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT
    if moves and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
        return int(model.jnt_bodyid[joint])
    return None


def _sensor_faults(model: mujoco.MjModel, rotor: int, body: int) -> Iterator[str]:
    kinds = zip(model.sensor_type, model.sensor_objtype, model.sensor_objid, model.sensor_dim)
    stick = _TYPES[_STICK], mujoco.mjtObj.mjOBJ_BODY, body, SENSORS["stick"]
    first = next((k for k, found in enumerate(kinds) if found == stick), -1) - _STICK
    run = slice(max(first, 0), first + len(SENSORS))
    sizes = model.sensor_dim[run].tolist()
    if model.sensor_type[run].tolist() != _TYPES or sizes != [*SENSORS.values()]:
        yield (
            f"is of body {model.body(body).name!r}, which lacks a helicopter's sensors, one after "
            f"the other: {', '.join(SENSORS)}; copy them from models/jr700"
        )
        return
    if model.sensor_interval[first + _GYRO_RATE, 0] == 0.0:
        return  # not sampled
    step, period = model.opt.timestep, model.actuator_user[rotor, PARAM.gyro_period]
    if step > period * (1.0 + _WHOLE):
        yield f"is of a gyro that acts each {period:g} s; give the scene no longer a timestep"
    pedal = rotor - ROTOR + CONTROL.ped
    kept, delay = model.actuator_history[pedal, 0], model.actuator_delay[pedal]
    needed = math.ceil((delay + period) / step - _WHOLE) + 1
    if delay > 0.0 and kept < needed:
        yield (
            f"is of pedals that keep nsample={kept}, and their delay needs {needed} of this time "
            "step; raise it, or take the time step of the vehicle's MJCF"
        )


def check_is_model(model: object) -> None:
    """Raise InputError unless it is a compiled model of MuJoCo's."""
    if not isinstance(model, mujoco.MjModel):
        raise InputError(
            f"a mujoco.MjModel is needed, such as from_xml_path(...) gives, got {model!r:.80}"
        )


def check_model(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names of the bodies of helisim's vehicles in a model, each with all it needs.

    CallbackError: there is none, or one lacks an element, which the message names.
    """
    check_is_model(model)
    for fault in examine(model):
        raise CallbackError(fault)
    bodies = []
    if model.nuser_actuator >= len(PARAM):
        users = model.actuator_user
        ours = (users[:, PARAM.magic] == MAGIC) & (users[:, PARAM.ordinal] == ROTOR)
        bodies = [model.body(model.jnt_bodyid[one]).name for one in model.actuator_trnid[ours, 0]]
    if not bodies:
        raise CallbackError(
            f"model {model.names.partition(bytes(1))[0].decode()!r} has no helicopter of helisim: "
            "no actuator has its user numbers. Write them into a vehicle's MJCF with `helisim "
            "vehicle build FOLDER`"
        )
    return tuple(bodies)
