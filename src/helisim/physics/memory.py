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
from functools import cache
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes, structs

from helisim.base.errors import CallbackError
from helisim.physics.kernel import doubles_at, ints_at, kernel, known, longs_at
from helisim.physics.layout import (
    CONTROL,
    HANDS_OFF_ROTOR,
    LAYOUT,
    MAGIC,
    PARAM,
    ROTOR,
    SENSOR,
    SENSORS,
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
