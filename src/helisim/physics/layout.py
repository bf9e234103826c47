"""Where a vehicle's numbers live inside MuJoCo's arrays: states, controls, sensors.

A vehicle is nine consecutive actuators: four sticks, four servos and
the rotor. The first two user numbers of each tell that it is ours and which of the nine it
is; the rotor's user numbers carry every parameter of the vehicle (`params.PARAM`).
The third is a number of that order itself.
Each of the index tuples names the numbers of one array, from the vehicle's first on.
"""

import zlib
from typing import NamedTuple

from helisim.physics.kernel import known
from helisim.physics.params import PARAM

MAGIC = 48756173.0
"""First user number of every actuator of a helisim vehicle; any other model is left alone."""

ACTUATORS = (
    "COL",
    "LON",
    "LAT",
    "PED",
    "servo_front",
    "servo_left",
    "servo_right",
    "servo_tail",
    "rotor",
)
"""The vehicle's actuators, consecutive and in this order."""


@known
class ControlIndex(NamedTuple):
    """Controls of a vehicle, one an actuator: sticks, servo commands (unitised), rotor speed."""

    col: int
    lon: int
    lat: int
    ped: int
    servo_front: int
    servo_left: int
    servo_right: int
    servo_tail: int
    rotor: int


CONTROL = ControlIndex(*range(len(ControlIndex._fields)))
ROTOR = CONTROL.rotor
"""Ordinal of the rotor among the vehicle's actuators."""

SENSORS = {
    "imu_gyro": 3,
    "imu_accelerometer": 3,
    "imu_velocity": 3,
    "imu_attitude": 4,
    "imu_position": 3,
    "gyro_rate": 3,
    "stick": 4,
    "servo_command": 4,
    "servo_position": 4,
    "flapping": 2,
    "rotor": 5,
    "power": 4,
    "air": 6,
    "contact": 3,
    "clock": 1,
}
"""The sensors that a vehicle needs, consecutive and in this order, and the numbers of each.

The first six and the last are MuJoCo's own; those between are user sensors that the callbacks
fill.
"""


@known
class SensorIndex(NamedTuple):
    """Numbers of a vehicle's `SENSORS`, from the first of the IMU's."""

    # the IMU, MuJoCo's axes (forward, left, up): rad/s, m/s^2, m/s, 1, m
    imu_p: int
    imu_q: int
    imu_r: int
    imu_ax: int
    imu_ay: int
    imu_az: int
    imu_u: int
    imu_v: int
    imu_w: int
    imu_quat_w: int
    imu_quat_x: int
    imu_quat_y: int
    imu_quat_z: int
    imu_x: int
    imu_y: int
    imu_z: int
    # gyro_rate: rad/s, MuJoCo's axes too
    gyro_x: int
    gyro_y: int
    gyro_z: int
    # stick and servo_command: the controls but the rotor's
    stick_col: int
    stick_lon: int
    stick_lat: int
    stick_ped: int
    command_front: int
    command_left: int
    command_right: int
    command_tail: int
    # servo_position: unitised
    position_front: int
    position_left: int
    position_right: int
    position_tail: int
    # flapping: rad
    flap_a: int
    flap_b: int
    # rotor: N, N m, inflow ratio, N, speed over the nominal one
    thrust: int
    torque: int
    inflow: int
    tail_thrust: int
    speed: int
    # power, W: what the motor delivers, main and tail shaft take, and what is lost to the air
    drive_power: int
    main_power: int
    tail_power: int
    heat: int
    # air: its own velocity and rotation, m/s and rad/s, body axes
    air_u: int
    air_v: int
    air_w: int
    air_p: int
    air_q: int
    air_r: int
    # contact: N, of all that is touched, world axes, north-east-down
    contact_north: int
    contact_east: int
    contact_down: int
    # s, of the start of the step
    clock: int


SENSOR = SensorIndex(*range(len(SensorIndex._fields)))


@known
class InjectionIndex(NamedTuple):
    """Numbers of `mjData.userdata` from its first on: what a manoeuvre adds in a time step."""

    # to the pilot's sticks, unitised
    stick_col: int
    stick_lon: int
    stick_lat: int
    stick_ped: int
    # to the gyro's commands, unitised
    command_front: int
    command_left: int
    command_right: int
    command_tail: int
    # to what reaches the servos, unitised
    actuator_front: int
    actuator_left: int
    actuator_right: int
    actuator_tail: int
    # to the rates that the gyro reads, rad/s, those of a disturbed attitude included
    rate_p: int
    rate_q: int
    rate_r: int
    # to the attitude that a law sees, rad
    angle_phi: int
    angle_theta: int
    angle_psi: int


INJECTION = InjectionIndex(*range(len(InjectionIndex._fields)))


@known
class StateIndex(NamedTuple):
    """Activations of a vehicle, from the address of its first one.

    From `feels_x` on they are not integrated: the callbacks write them, most at the gyro's ticks.
    The last are the states of the control laws, here those of the shipped gyro; behind them as many
    again are kept, the same states before the last tick.
    """

    front_position: int
    front_rate: int
    left_position: int
    left_rate: int
    right_position: int
    right_rate: int
    tail_position: int
    tail_rate: int
    flap_a: int
    flap_b: int
    # induced velocity of dynamic inflow, m/s: mean, more at the right tip, more at the rear tip
    inflow_0: int
    inflow_s: int
    inflow_c: int
    # rotor speed over the nominal one; what drives it
    speed: int
    engine: int
    governor: int
    air_u: int
    air_v_lag: int
    air_w_lag: int
    air_p: int
    air_v: int
    air_w: int
    air_q_lag: int
    air_r_lag: int
    # what the accelerometer feels in this time step, and felt in the one before the laws' last
    # tick, m/s^2, body axes (FRD)
    feels_x: int
    feels_y: int
    feels_z: int
    felt_x: int
    felt_y: int
    felt_z: int
    # what the gyro read at its last tick, rad/s
    read_p: int
    read_q: int
    read_r: int
    # derivatives of the rotor's states, from `flap_a` to `governor`, found with the forces
    flap_a_rate: int
    flap_b_rate: int
    inflow_0_rate: int
    inflow_s_rate: int
    inflow_c_rate: int
    speed_rate: int
    engine_rate: int
    governor_rate: int
    # one more than the number of the tick at which the laws last acted, and a half more at their
    # first; 0 before they have, -1 where one failed
    law_tick: int
    gyro_q_filter: int
    gyro_q_integral: int
    gyro_q_derivative: int
    gyro_p_filter: int
    gyro_p_integral: int
    gyro_p_derivative: int
    gyro_r_lead: int
    gyro_r_integral: int


STATE = StateIndex(*range(len(StateIndex._fields)))
FIRST_LAW_STATE = STATE.law_tick + 1
SWASH_STATES = STATE.gyro_r_lead - FIRST_LAW_STATE
TAIL_STATES = len(STATE) - STATE.gyro_r_lead
"""How many states the shipped gyro's two laws have: for the swashplate, for the tail."""


def rotor_states(law_states: int = SWASH_STATES + TAIL_STATES) -> int:
    """Return the activations of the rotor's actuator, where the laws have so many states."""
    return FIRST_LAW_STATE - STATE.flap_a + 2 * law_states


ROTOR_STATES = rotor_states()
"""What a vehicle's MJCF has at least."""

LAYOUT = float(zlib.crc32(repr((ACTUATORS, SENSORS, STATE._fields, PARAM._fields)).encode()))
"""What `PARAM.layout` says: numbers that were written for another order of anything are refused."""
