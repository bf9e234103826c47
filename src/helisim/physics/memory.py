"""mjModel and mjData as compiled code reads them: fields by address, our vehicles among them."""

from typing import Any, NamedTuple

import llvmlite.binding
import mujoco
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from helisim.physics.kernel import kernel
from helisim.physics.layout import CONTROL, LAYOUT, MAGIC, ROTOR, SENSOR, SENSORS, STATE
from helisim.physics.params import HANDS_OFF_ROTOR, PARAM

_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_PARAMETERS = len(PARAM)
_STICKS = SENSORS["stick"]
_AHEAD = list(SENSORS).index("stick")
_BEHIND = len(SENSORS) - 1 - _AHEAD


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
longs_at = _pointer_intrinsic(types.int64)
bytes_at = _pointer_intrinsic(types.uint8)


def address_of(symbol: str, address: int):
    """Return a function for kernels that returns an address of this process, under a name.

    It is looked up when code is loaded, so that code can be kept on disk.
    """
    llvmlite.binding.add_symbol(symbol, address)

    @intrinsic
    def known(typingctx):
        del typingctx

        def codegen(context, builder, signature, args):
            del context, signature, args
            found = builder.module.globals.get(symbol)
            found = found or cgutils.add_global_variable(builder.module, ir.IntType(64), symbol)
            return builder.ptrtoint(found, ir.IntType(64))

        return types.int64(), codegen

    return known


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
    return _ints_at(longs_at(base + offset)[0])


@kernel()
def long(base, offset):
    """Return the value of a 64-bit integer field."""
    return longs_at(base + offset)[0]


@kernel()
def integer(base, offset):
    """Return the value of an int field."""
    return _ints_at(base + offset)[0]


@kernel()
def double(base, offset):
    """Return the value of a double field."""
    return doubles_at(base + offset)[0]


@intrinsic
def fence(typingctx):
    """Let what follows read memory anew, after all that was read and written before."""
    del typingctx

    def codegen(context, builder, signature, args):
        del signature, args
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), codegen


@intrinsic
def from_element(typingctx, array, first):
    """Return an array of doubles from its element `first` on."""
    del typingctx

    def codegen(context, builder, signature, args):
        del context, signature
        return builder.gep(args[0], [args[1]])

    return array(array, first), codegen


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


class VehicleView(NamedTuple):
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

    m: int
    d: int
    offsets: Any
    rotor: int
    body: int
    sensors: int
    par: Any
    act: Any
    rate: Any
    controls: Any


@kernel()
def vehicles(m, d, offsets):
    """Yield a view of every vehicle of ours in the model."""
    for actuator in range(ROTOR, long(m, offsets.nactuator)):
        if is_rotor(m, offsets, actuator):
            yield view_of(m, d, offsets, actuator)


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
    stick = stick_sensor(m, offsets, body)
    if stick < _AHEAD or stick + _BEHIND >= long(m, offsets.nsensor):
        return -1
    address = ints(m, offsets.sensor_adr)
    first = address[stick] - SENSOR.stick_col
    whole = address[stick - _AHEAD] == first and address[stick + _BEHIND] == first + SENSOR.clock
    return first if whole else -1


@kernel()
def stick_sensor(m, offsets, body):
    """Return the first user sensor of four numbers on a body, the sticks; negative for none."""
    for k in range(long(m, offsets.nsensor)):
        ours = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        ours = ours and ints(m, offsets.sensor_objtype)[k] == _BODY
        ours = ours and ints(m, offsets.sensor_dim)[k] == _STICKS
        if ours and ints(m, offsets.sensor_objid)[k] == body:
            return k
    return -1


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
