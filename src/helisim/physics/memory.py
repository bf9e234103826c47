"""mjModel and mjData as compiled code reads them: fields by address, helisim's vehicles, time.

`mujoco.introspect` describes MuJoCo's C structures and ctypes lays them out as the C compiler did;
the offsets are checked against live objects before any compiled code uses them.

The gyro acts at its ticks, once in each of its periods, and what it sees and says is held between.
Runge-Kutta asks for derivatives, four times a step. The other integrators ask once and hold the
result for the step: v += h dv/dt, then x += h v, and act += h d(act)/dt. To be of second order with
one evaluation, they are given the step's mean, by a staggered (leapfrog) scheme: velocities belong
to the steps, positions and the tip-path plane's tilt to halfway between them. The tilt kept at a
step is half a step old; moved on by a step with the rates at its middle, it acts on the body half
a step ahead. Servos are driven by commands that are held, so their mean is the exponential's.
"""

import ctypes
import math
from collections import namedtuple
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from helisim.base.errors import CallbackError
from helisim.physics.kernel import address_of, call, doubles_at, ints_at, kernel, known, longs_at
from helisim.physics.laws import is_registered
from helisim.physics.layout import (
    ACTUATORS,
    CONTROL,
    FIRST_LAW_STATE,
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
)

_MODEL = namedtuple(
    "_MODEL",
    "nactuator nuser_actuator nuserdata nsensor ngeom actuator_user actuator_group "
    "actuator_dyntype actuator_actnum actuator_trntype actuator_trnid actuator_actadr "
    "actuator_ctrladr actuator_history actuator_historyadr actuator_delay jnt_type jnt_bodyid "
    "body_rootid body_dofadr body_dofnum dof_parentid geom_type geom_contype geom_conaffinity "
    "geom_bodyid geom_size sensor_type sensor_dim sensor_adr sensor_objtype sensor_objid "
    "sensor_interval names name_bodyadr name_actuatoradr name_sensoradr",
)._fields
_OPTION = namedtuple(
    "_OPTION",
    "timestep wind integrator disableflags disableactuator",
)._fields
_DATA = namedtuple(
    "_DATA",
    "time act act_dot ctrl history xpos xmat cvel cdof subtree_com geom_xpos geom_xmat "
    "qfrc_passive qfrc_constraint sensordata userdata",
)._fields
_FIELDS = (*_MODEL, *_OPTION, *_DATA)
Offsets = namedtuple("Offsets", (*_FIELDS, "fingerprint"), defaults=[0])
"""Byte offsets of the fields that the callbacks read or write; `fingerprint` is no field."""
known(Offsets)
_ALIGNED = 64
"""Bytes; MuJoCo's arrays start at multiples of them."""
_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_RUNGE_KUTTA = int(mujoco.mjtIntegrator.mjINT_RK4)
_PARAMETERS = len(PARAM)
_STICKS = SENSORS["stick"]
_BEFORE_STICK = list(SENSORS).index("stick")
_BEHIND_STICK = len(SENSORS) - 1 - _BEFORE_STICK
TICK_TOLERANCE = 1e-6
"""Share of a period by which a tick, or a whole number of steps, counts early, for rounding."""
TIME_TOLERANCE = 1e-9
"""s, by which equal times may differ: far above their rounding, far below any time step."""


@cache
def offsets() -> Any:
    """Return the byte offset of every field, `Offsets`.

    Raises:
        CallbackError: this MuJoCo's structures are not laid out as it describes them.
    """
    model, data, option = map(_structure, ("mjModel", "mjData", "mjOption"))
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


def _structure(name: str) -> type[ctypes.Structure]:
    return _layout(name, (structs.STRUCTS.get(name) or structs.STRUCTS[f"{name}_"]).fields)


def _layout(name: str, fields: Any) -> type[ctypes.Structure]:
    members = []
    for index, field in enumerate(fields):
        label = getattr(field, "name", None) or f"anonymous_{index}"
        members.append((label, _ctype(getattr(field, "type", field), f"{name}_{label}")))
    return type(name, (ctypes.Structure,), {"_fields_": members})


def _ctype(node: Any, name: str) -> Any:
    match node:
        case ast_nodes.PointerType():
            return ctypes.c_void_p
        case ast_nodes.ArrayType():
            element = _ctype(node.inner_type, name)
            for extent in reversed(node.extents):
                element = element * extent
            return element
        case ast_nodes.AnonymousStructDecl():
            return _layout(name, node.fields)
    if node.name in structs.STRUCTS or f"{node.name}_" in structs.STRUCTS:
        return _structure(node.name)
    return _SCALARS.get(node.name, ctypes.c_int)  # int and enumerations


_PROBE = """
<mujoco>
  <option timestep="0.00137" integrator="RK4" wind="1.25 2.5 3.75" actuatorgroupdisable="2 5">
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
        base = data if name in _DATA else model
        if not _agrees(base._address + getattr(found, name), getattr(owner, name), name, model):
            raise CallbackError(
                f"MuJoCo {mujoco.__version__}: field {name!r} is not where the introspection "
                "says; the compiled force laws would read the wrong memory. Install a version "
                "of MuJoCo that this helisim supports"
            )


def _agrees(address: int, expected: Any, name: str, model: mujoco.MjModel) -> bool:
    match expected:
        case np.ndarray():
            held = expected.__array_interface__["data"][0]
            by_value = name in _OPTION
            return held == (address if by_value else ctypes.c_void_p.from_address(address).value)
        case bytes():  # the names, which end where their map begins
            held = ctypes.c_void_p.from_address(address).value or 0
            between = model.names_map.__array_interface__["data"][0] - held - len(expected)
            return 0 <= between < _ALIGNED and ctypes.string_at(held, len(expected)) == expected
        case float():
            return ctypes.c_double.from_address(address).value == expected
    size = ctypes.c_int if name in _OPTION else ctypes.c_int64
    return size.from_address(address).value == int(expected)


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
"""One of our vehicles inside mjModel and mjData, as the kernels hand it on.

The pointers lead into MuJoCo's own arrays: what is written there is written in mjData.

Attributes:
    m: address of mjModel.
    d: address of mjData.
    offsets: byte offsets of their fields, `fields.Offsets`.
    rotor: the vehicle's rotor actuator.
    body: the body that its forces act on.
    sensors: where its `SENSORS` start in `sensordata`; negative if it has none.
    par: its parameters, by `PARAM`.
    act: its activations, by `STATE`.
    rate: their derivatives, per second.
    controls: its controls, by `CONTROL`.
"""


@kernel()
def is_rotor(m, offsets, actuator):
    """Return whether an actuator is the rotor of one of our vehicles, all the others before it."""
    if long(m, offsets.nuser_actuator) < _PARAMETERS:
        return False
    user = user_numbers(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC or user[PARAM.ordinal] != ROTOR or actuator < ROTOR:
        return False
    if user[PARAM.layout] != LAYOUT:
        return False
    first = user_numbers(m, offsets, actuator - ROTOR)
    return first[PARAM.magic] == MAGIC and first[PARAM.ordinal] == 0.0


@kernel()
def user_numbers(m, offsets, actuator):
    """Return the user numbers of an actuator; the rotor's are the vehicle's parameters."""
    stride = long(m, offsets.nuser_actuator)
    return doubles_from(m, offsets.actuator_user, actuator * stride)


@kernel()
def view_of(m, d, offsets, rotor):
    """Return a view of the vehicle to which a rotor actuator belongs."""
    joint = ints(m, offsets.actuator_trnid)[2 * rotor]
    body = ints(m, offsets.jnt_bodyid)[joint]
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
    """Return where a vehicle's `SENSORS` start in `sensordata`; negative where they are not whole.

    The sticks are among them, and as many numbers before and behind as there should be.
    """
    stick = -1
    for k in range(long(m, offsets.nsensor)):
        is_user = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        is_user = is_user and ints(m, offsets.sensor_objtype)[k] == _BODY
        is_user = is_user and ints(m, offsets.sensor_dim)[k] == _STICKS
        if is_user and ints(m, offsets.sensor_objid)[k] == body:
            stick = k
            break
    if stick < _BEFORE_STICK or stick + _BEHIND_STICK >= long(m, offsets.nsensor):
        return -1
    address = ints(m, offsets.sensor_adr)
    first = address[stick] - SENSOR.stick_col
    whole = (
        address[stick - _BEFORE_STICK] == first
        and address[stick + _BEHIND_STICK] == first + SENSOR.clock
    )
    return first if whole else -1


@kernel()
def sensor_numbers(view):
    """Return the numbers of a vehicle's sensors, by `SENSOR`."""
    return doubles_from(view.d, view.offsets.sensordata, view.sensors)


@kernel()
def speed_ratio(view):
    """Return the rotor's speed over its nominal one; an ideal governor keeps what is asked for."""
    if view.par[PARAM.drive_governor] != 0.0:
        return view.act[STATE.speed]
    return commanded_speed(view)


@kernel()
def commanded_speed(view):
    """Return the rotor speed that is asked for, over the nominal one; 1 where a pilot flies.

    Unless he leaves it to the caller.
    """
    pilot = view.par[PARAM.pilot_on]
    if pilot != 0.0 and pilot != HANDS_OFF_ROTOR:
        return 1.0
    return view.controls[CONTROL.rotor]


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
    rate = view.act[position + 1]
    return view.act[position] + ahead * min(limit, max(-limit, rate))


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
    """Return whether the gyro acts now: at a step's start, once in each of its periods.

    MuJoCo computes sensors at the start of a step only, so the clock separates the start from the
    later stages of the integrator.
    """
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
    """Return a control as it was one delay of its actuator before `now`, linear between ticks.

    ordinal: of the control, one of `CONTROL`; now: s.
    """
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
    before, after = past_controls(view, actuator, tick, tick + period)
    return before + ahead * (after - before)


@kernel()
def past_controls(view, actuator, earlier, later):
    """Return an actuator's control at two past times: each its newest sample not after it.

    actuator: its id; it has a delay; earlier: s; later: s.
    """
    first = ints(view.m, view.offsets.actuator_historyadr)[actuator]
    count = ints(view.m, view.offsets.actuator_history)[2 * actuator]
    history = doubles(view.d, view.offsets.history)
    times, values = first + 2, first + 2 + count
    k = int(history[first + 1])
    left = count - 1
    while left > 0 and history[times + k] > later + TIME_TOLERANCE:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    value_later = history[values + k]
    while left > 0 and history[times + k] > earlier + TIME_TOLERANCE:
        k = k - 1 if k > 0 else count - 1
        left -= 1
    return history[values + k], value_later


EXAMINE, UNKNOWN_LAW = 0, 1
"""Reports of compiled code: a model that is flown for the first time, a law that isn't there."""

_USER = int(mujoco.mjtDyn.mjDYN_USER)
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_SERVO_STATES = 2
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
