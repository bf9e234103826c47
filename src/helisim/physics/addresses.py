"""Where one of our vehicles stands in mjModel: actuators, parameters, body, states, sensors."""

import mujoco

from helisim.physics.kernel import kernel
from helisim.physics.layout import MAGIC, PARAM, ROTOR, STATE
from helisim.physics.memory import doubles, doubles_from, ints, long

_USER_SENSOR = int(mujoco.mjtSensor.mjSENS_USER)
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)
_PARAMETERS = len(PARAM)
REPORTS = 24
"""Numbers in a vehicle's own sensors."""


@kernel()
def parameters(m, offsets, actuator):
    """Return the user numbers of an actuator; the rotor's are the vehicle's parameters."""
    stride = long(m, offsets.nuser_actuator)
    return doubles_from(m, offsets.actuator_user, actuator * stride)


@kernel()
def is_rotor(m, offsets, actuator):
    """Tell whether an actuator is the rotor of one of our vehicles, all the others before it."""
    if long(m, offsets.nuser_actuator) < _PARAMETERS:
        return False
    user = parameters(m, offsets, actuator)
    if user[PARAM.magic] != MAGIC or user[PARAM.ordinal] != ROTOR or actuator < ROTOR:
        return False
    first = parameters(m, offsets, actuator - ROTOR)
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
def state_of(m, offsets, rotor_id):
    """Return the address of a vehicle's first activation."""
    address = ints(m, offsets.actuator_actadr)[rotor_id]
    return address - STATE.flap_a


@kernel()
def control_of(m, offsets, rotor_id):
    """Return the address of a vehicle's first control, the collective stick."""
    return ints(m, offsets.actuator_ctrladr)[rotor_id] - ROTOR


@kernel()
def reports(m, offsets, body):
    """Return where a vehicle's own sensors start: the first user sensor on its body, or -1.

    The gyro's rates stand in the three numbers before, the clock in the one behind the last.
    """
    for k in range(long(m, offsets.nsensor)):
        ours = ints(m, offsets.sensor_type)[k] == _USER_SENSOR
        ours = ours and ints(m, offsets.sensor_objtype)[k] == _BODY
        ours = ours and ints(m, offsets.sensor_dim)[k] == 4
        if ours and ints(m, offsets.sensor_objid)[k] == body:
            return ints(m, offsets.sensor_adr)[k]
    return -1


@kernel()
def speed_ratio(m, d, offsets, rotor_id, par):
    """Return the rotor's speed over its nominal one; a pilot flies with the governor on."""
    if par[PARAM.pilot_on] != 0.0:
        return 1.0
    return doubles(d, offsets.ctrl)[control_of(m, offsets, rotor_id) + ROTOR]
