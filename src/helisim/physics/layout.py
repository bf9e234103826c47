"""Places of a vehicle's numbers inside MuJoCo's arrays: parameters, states, controls, sensors.

A vehicle is nine consecutive actuators: four sticks, four servos and the rotor, whose user numbers
are the parameters (`PARAM`). Indices count from the vehicle's first number in each array.
"""

import zlib
from collections import namedtuple

from helisim.physics.kernel import known

ParamIndex = namedtuple(
    "ParamIndex",
    "magic ordinal layout air_density ground_effect "
    # main rotor
    "main_direction main_radius main_speed main_solidity main_lift_slope main_induced_factor "
    "main_profile_drag main_lift_drag main_divergence main_mach main_pitch_trim main_pitch_range "
    "main_twist main_stall main_stall_fall main_dynamic_inflow "
    # the hub in shaft axes, which lean forward by an angle of this cosine and sine
    "hub_x hub_z shaft_cosine shaft_sine hub_stiffness hub_cross "
    # tip-path plane: air's hold over inertia and density, Lock reduction, nu^2 - 1, springs (1/s)
    "flap_hold flap_reduction flap_stiffness spring_aa spring_ab spring_ba cyclic_a_lat "
    "cyclic_a_lon cyclic_b_lat cyclic_b_lon flap_back inflow_skew flap_stop "
    # tail rotor
    "tail_radius tail_speed tail_solidity tail_lift_slope tail_pitch_trim tail_pitch_range "
    "tail_stall tail_stall_fall tail_induced_factor tail_profile_drag tail_lift_drag "
    "tail_divergence tail_mach tail_direction tail_x tail_z tail_blockage "
    # drive: 0 keeps the rotor's speed as commanded, 1 is a motor; then all that follow count
    "drive_governor drive_engine drive_inertia drive_friction drive_gear drive_voltage "
    "drive_speed_constant drive_resistance drive_no_load_current drive_current_limit drive_power "
    "drive_power_speed drive_lag drive_k_p drive_k_i drive_collective_gain drive_spool_up "
    "drive_bail_out drive_droop drive_fuel_lag drive_lead drive_mast_inertia "
    # battery: 0 keeps `drive_voltage`, 1 is a battery; then all that follow count
    "drive_supply battery_cells battery_capacity battery_charge battery_temperature "
    "battery_voltage_0 battery_voltage_1 battery_voltage_2 battery_voltage_3 battery_end_voltage "
    "battery_end battery_resistance battery_activation battery_polarisation battery_lag "
    "battery_heat_capacity battery_cooling "
    # fuselage: drag areas and where they act, volumes of its moments, wash over induced velocity
    "drag_x drag_y drag_z drag_centre_x drag_centre_z pitch_volume pitch_zero yaw_volume "
    "download "
    # fin and tailplane, in the same order, which `flow.surface` counts on
    "fin_area fin_x fin_z fin_stall fin_pressure fin_slope fin_cosine fin_sine tailplane_area "
    "tailplane_x tailplane_z tailplane_stall tailplane_pressure tailplane_slope "
    "tailplane_cosine tailplane_sine "
    # the main rotor's wash at tail rotor and fin, and at the tailplane, of `WASH` numbers each
    "tail_wash tail_wash_1 tail_wash_2 tail_wash_3 tail_wash_4 tail_wash_5 tail_wash_6 "
    "tail_wash_7 tailplane_wash tailplane_wash_1 tailplane_wash_2 tailplane_wash_3 "
    "tailplane_wash_4 tailplane_wash_5 tailplane_wash_6 tailplane_wash_7 "
    # servos
    "swash_frequency swash_damping tail_frequency tail_damping servo_rate_limit servo_travel "
    # swashplate: from col, lon, lat to each servo's position, and back
    "mix_front_col mix_front_lon mix_front_lat mix_left_col mix_left_lon mix_left_lat "
    "mix_right_col mix_right_lon mix_right_lat unmix_col_front unmix_col_left unmix_col_right "
    "unmix_col_over unmix_lon_front unmix_lon_left unmix_lon_right unmix_lon_over "
    "unmix_lat_front unmix_lat_left unmix_lat_right unmix_lat_over "
    # gyro
    "gyro_on swash_law tail_law law_token swash_states tail_states "
    # commands of servos that no law moves, where a plan flies: 1, and then these count
    "planned planned_front planned_left planned_right planned_tail gyro_period gyro_heading_lock "
    "gyro_attitude_lock gyro_collective gyro_hold_above gyro_k_p gyro_k_i gyro_k_delta gyro_k_a "
    "gyro_lead gyro_lead_share gyro_lead_lag gyro_kp_lat gyro_kp_lon gyro_ki_lat gyro_ki_lon "
    "gyro_kd_lat gyro_kd_lon gyro_filter_share gyro_filter_mean gyro_derivative_share "
    "gyro_derivative_through gyro_derivative_lag gyro_phase_cosine gyro_phase_sine "
    "gyro_p_per_lat gyro_p_per_lon gyro_q_per_lat gyro_q_per_lon "
    # pilot: hover hold
    "pilot_on pilot_north pilot_east pilot_down pilot_psi pilot_phi pilot_theta pilot_col "
    "pilot_lon pilot_lat pilot_ped pilot_k_attitude pilot_k_velocity pilot_k_position "
    "pilot_k_heave pilot_k_height pilot_k_heading "
    # pilot: remnant, white at knots, linear between them
    "pilot_seed remnant_col remnant_lon remnant_lat remnant_ped remnant_interval "
    # excitation
    "excitation excitation_start excitation_duration excitation_col excitation_lon "
    "excitation_lat excitation_ped sweep_w_min sweep_w_max sweep_fade sweep_unsteadiness "
    # a gust, north-east-down
    "gust_north gust_east gust_down gust_start gust_rise gust_hold "
    # turbulence, along the path through the air
    "turbulence_on turbulence_seed turbulence_cosine turbulence_sine turbulence_span "
    "turbulence_u turbulence_v turbulence_w turbulence_p turbulence_lag_u turbulence_lag_v "
    "turbulence_lag_w turbulence_lag_p "
    # faults: 1 where there are any; then all that follow count, up to `tail_fault_high`; the rest,
    # of which `ROLL_ATTITUDE` and `ROLL_VELOCITY` take two, like `STATE.read_p` to `read_r`, keeps
    # its place, as a model's digest is of all
    "faults front_fault_at front_fault_rate_limit front_fault_low front_fault_high left_fault_at "
    "left_fault_rate_limit left_fault_low left_fault_high right_fault_at right_fault_rate_limit "
    "right_fault_low right_fault_high tail_fault_at tail_fault_rate_limit tail_fault_low "
    "tail_fault_high restart_at restart_until restart_neutral dropout_at dropout_until dropout_p "
    "dropout_q dropout_r",
)
PARAM = known(ParamIndex)(*range(len(ParamIndex._fields)))  # the rotor's user numbers, SI
ROLL_ATTITUDE, ROLL_VELOCITY = PARAM.restart_at, PARAM.restart_until
"""Of `pilot_k_attitude` and `pilot_k_velocity` roll has so much more than pitch."""

WASH = 8  # numbers of hover and descent, then by powers of the skew's cosine
NO_LAW = 0
SHIPPED_LAW = 1
"""Values of `PARAM.swash_law` and `PARAM.tail_law`; from 2 on, a row of the laws' table."""
SWEEP = 1
DOUBLET = 2
HISTORY = 3
"""Values of `PARAM.excitation`; 0 is no excitation, and `HISTORY` is what `INJECTION` holds."""
HANDS_OFF_ROTOR = 2
"""Value of `PARAM.pilot_on` for a pilot who leaves the rotor's control; 1 keeps nominal speed."""
NEVER = 1e9  # s, of a fault that does not come; also a limit that none reaches

MAGIC = 48756173.0  # first user number of every actuator of a helisim vehicle

ACTUATORS = (  # consecutive
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

ControlIndex = namedtuple(
    "ControlIndex",
    "col lon lat ped servo_front servo_left servo_right servo_tail rotor",
)
CONTROL = known(ControlIndex)(*range(len(ControlIndex._fields)))
"""Controls, one an actuator: sticks, servo commands (unitised), rotor speed."""
ROTOR = CONTROL.rotor  # its ordinal among actuators

SENSORS = {  # needed, in this order, and their sizes
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
    "battery": 4,
    "air": 6,
    "contact": 3,
    "clock": 1,
}

SensorIndex = namedtuple(
    "SensorIndex",
    # the IMU, MuJoCo's axes (forward, left, up): rad/s, m/s^2, m/s, 1, m
    "imu_p imu_q imu_r imu_ax imu_ay imu_az imu_u imu_v imu_w imu_quat_w imu_quat_x imu_quat_y "
    "imu_quat_z imu_x imu_y imu_z "
    # gyro_rate: rad/s, MuJoCo's axes too
    "gyro_x gyro_y gyro_z "
    # stick and servo_command: the controls but the rotor's
    "stick_col stick_lon stick_lat stick_ped command_front command_left command_right "
    "command_tail "
    # servo_position: unitised
    "position_front position_left position_right position_tail "
    # flapping: rad
    "flap_a flap_b "
    # rotor: N, N m, inflow ratio, N, speed over the nominal one
    "thrust torque inflow tail_thrust speed "
    # power, W: what the motor delivers, main and tail shaft take, and what is lost to the air
    "drive_power main_power tail_power heat "
    # battery: V at its poles, A, share of its capacity that is left, K; 0 without one
    "voltage current charge temperature "
    # air: its own velocity and rotation, m/s and rad/s, body axes
    "air_u air_v air_w air_p air_q air_r "
    # contact: N, of all that is touched, world axes, north-east-down
    "contact_north contact_east contact_down "
    # s, of the start of the step
    "clock",
)
SENSOR = known(SensorIndex)(*range(len(SensorIndex._fields)))  # from the IMU's first

InjectionIndex = namedtuple(
    "InjectionIndex",
    # to the pilot's sticks, unitised
    "stick_col stick_lon stick_lat stick_ped "
    # to the gyro's commands, unitised
    "command_front command_left command_right command_tail "
    # to what reaches the servos, unitised
    "actuator_front actuator_left actuator_right actuator_tail "
    # to the rates that the gyro reads, rad/s, those of a disturbed attitude included
    "rate_p rate_q rate_r "
    # to the attitude that a law sees, rad
    "angle_phi angle_theta angle_psi",
)
INJECTION = known(InjectionIndex)(*range(len(InjectionIndex._fields)))  # of `mjData.userdata`

StateIndex = namedtuple(
    "StateIndex",
    "front_position front_rate left_position left_rate right_position right_rate tail_position "
    "tail_rate flap_a flap_b "
    # induced velocity of dynamic inflow, m/s: mean, more at the right tip, more at the rear tip
    "inflow_0 inflow_s inflow_c "
    # rotor speed over the nominal one; what drives it
    "speed engine governor "
    # a turbine's fuel flow, share; share of the battery taken, V of its slow drop, K of its rise
    "fuel discharge polarisation warming "
    "air_u air_v_lag air_w_lag air_p air_v air_w air_q_lag air_r_lag "
    # specific force in this step, and in the one before the laws' last tick, m/s^2, FRD
    "feels_x feels_y feels_z felt_x felt_y felt_z "
    # of no use any more
    "read_p read_q read_r "
    # derivatives of the rotor's states, from `flap_a` to `warming`, found with the forces
    "flap_a_rate flap_b_rate inflow_0_rate inflow_s_rate inflow_c_rate speed_rate engine_rate "
    "governor_rate fuel_rate discharge_rate polarisation_rate warming_rate "
    # 1 + number of the laws' last tick, a half more at their first; 0 before, -1 after a failure
    "law_tick gyro_q_filter gyro_q_integral gyro_q_derivative gyro_p_filter gyro_p_integral "
    "gyro_p_derivative gyro_r_lead gyro_r_integral",
)
STATE = known(StateIndex)(*range(len(StateIndex._fields)))
"""The activations; from `feels_x` the callbacks', last the law states, then their old copies."""
FIRST_LAW_STATE = STATE.law_tick + 1
SWASH_STATES = STATE.gyro_r_lead - FIRST_LAW_STATE
TAIL_STATES = len(STATE) - STATE.gyro_r_lead
"""States of the shipped gyro's two laws: for the swashplate, for the tail."""


WITHOUT_LAWS = FIRST_LAW_STATE - STATE.flap_a  # less two a law state
ROTOR_STATES = WITHOUT_LAWS + 2 * (SWASH_STATES + TAIL_STATES)  # the MJCF's least

LAYOUT = float(zlib.crc32(repr((ACTUATORS, SENSORS, STATE._fields, PARAM._fields)).encode()))
"""Value of `PARAM.layout`: numbers that were written for another order of anything are refused."""
