"""mjModel and mjData as compiled code reads them: fields by address, our vehicles among them.

What the kernels hand on, and call everywhere the same:

    m, d        addresses of mjModel and mjData (int64)
    offsets     byte offsets of their fields, `fields.Offsets`
    rotor_id    a vehicle's rotor actuator, which stands for the vehicle
    body        the body that the vehicle's forces act on
    par         its parameters, by `layout.PARAM`
    act, rate   its activations and their derivatives per second, by `layout.STATE`
    controls    its controls, by `layout.CONTROL`
    sensors     address of its first sensor number in `sensordata`, or negative if it has none

The last six are found by the functions below. `par`, `act`, `rate` and `controls` are pointers
into MuJoCo's own arrays: what is written there is written in mjData.
"""

import mujoco
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, MAGIC, PARAM, ROTOR, SENSOR, SENSORS, STATE

_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_PARAMETERS = len(PARAM)
_STICKS = SENSORS["stick"]


def _pointer_intrinsic(element: types.Type):
    @intrinsic
    def cast(typingctx, address):
        del typingctx
        signature = types.CPointer(element)(types.int64)

        def codegen(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return signature, codegen

    return cast


doubles_at = _pointer_intrinsic(types.float64)
_ints_at = _pointer_intrinsic(types.int32)
_longs_at = _pointer_intrinsic(types.int64)


@kernel()
def doubles(base, offset):
    """Return the double array that a pointer field holds."""
    return doubles_at(_longs_at(base + offset)[0])


@kernel()
def doubles_from(base, offset, first):
    """Return the double array that a pointer field holds, from its element `first` on."""
    return doubles_at(_longs_at(base + offset)[0] + 8 * first)


@kernel()
def ints(base, offset):
    """Return the int array that a pointer field holds."""
    return _ints_at(_longs_at(base + offset)[0])


@kernel()
def long(base, offset):
    """Return the value of a 64-bit integer field."""
    return _longs_at(base + offset)[0]


@kernel()
def integer(base, offset):
    """Return the value of an int field."""
    return _ints_at(base + offset)[0]


@kernel()
def double(base, offset):
    """Return the value of a double field."""
    return doubles_at(base + offset)[0]


@intrinsic
def buffer(typingctx, count):
    """Return an uninitialised array of doubles, (count,), on the caller's own stack.

    `count` is a literal number.
    """
    del typingctx
    if not isinstance(count, types.IntegerLiteral):
        return None
    signature = types.CPointer(types.float64)(count)

    def codegen(context, builder, signature, args):
        del args
        element = context.get_value_type(types.float64)
        return cgutils.alloca_once(builder, element, size=signature.args[0].literal_value)

    return signature, codegen


@kernel()
def parameters_of(m, offsets, actuator):
    """Return the user numbers of an actuator; the rotor's are the vehicle's parameters."""
    stride = long(m, offsets.nuser_actuator)
    return doubles_from(m, offsets.actuator_user, actuator * stride)


@kernel()
def is_rotor(m, offsets, actuator):
    """Tell whether an actuator is the rotor of one of our vehicles, all the others before it."""
    if long(m, offsets.nuser_actuator) < _PARAMETERS:
        return False
    user = parameters_of(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC or user[PARAM.ordinal] != ROTOR or actuator < ROTOR:
        return False
    first = parameters_of(m, offsets, actuator - ROTOR)
    return first[PARAM.magic] == MAGIC and first[PARAM.ordinal] == 0.0


@kernel()
def vehicles(m, offsets):
    """Yield the rotor actuator of every vehicle of ours in the model."""
    for actuator in range(ROTOR, long(m, offsets.nactuator)):
        if is_rotor(m, offsets, actuator):
            yield actuator


@kernel()
def body_of(m, offsets, rotor_id):
    """Return the body that a vehicle's rotor actuator acts on."""
    joint = ints(m, offsets.actuator_trnid)[2 * rotor_id]
    return ints(m, offsets.jnt_bodyid)[joint]


@kernel()
def states_of(m, d, offsets, rotor_id, first=0):
    """Return a vehicle's activations, from one of `STATE` on."""
    address = ints(m, offsets.actuator_actadr)[rotor_id] - STATE.flap_a
    return doubles_from(d, offsets.act, address + first)


@kernel()
def state_rates_of(m, d, offsets, rotor_id, first=0):
    """Return the derivatives of a vehicle's activations, from one of `STATE` on."""
    address = ints(m, offsets.actuator_actadr)[rotor_id] - STATE.flap_a
    return doubles_from(d, offsets.act_dot, address + first)


@kernel()
def controls_of(m, d, offsets, rotor_id):
    """Return a vehicle's controls."""
    first = ints(m, offsets.actuator_ctrladr)[rotor_id] - ROTOR
    return doubles_from(d, offsets.ctrl, first)


@kernel()
def sensors_of(m, offsets, body):
    """Return the address of a vehicle's first sensor number; negative where it has no sensors.

    The sticks are the first user sensor on its body, and what the gyro sees stands before them.
    """
    for k in range(long(m, offsets.nsensor)):
        ours = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        ours = ours and ints(m, offsets.sensor_objtype)[k] == _BODY
        ours = ours and ints(m, offsets.sensor_dim)[k] == _STICKS
        if ours and ints(m, offsets.sensor_objid)[k] == body:
            return ints(m, offsets.sensor_adr)[k] - SENSOR.stick_col
    return -1


@kernel()
def speed_ratio_of(m, d, offsets, rotor_id, par):
    """Return the rotor's speed over its nominal one; a pilot flies with the governor on."""
    if par[PARAM.pilot_on] != 0.0:
        return 1.0
    return controls_of(m, d, offsets, rotor_id)[CONTROL.rotor]
