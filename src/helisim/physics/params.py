"""A vehicle's parameters by name: its rotor's user numbers, in the order of `PARAM`."""

from typing import NamedTuple

from helisim.physics.kernel import known


@known
class ParamIndex(NamedTuple):
    """Parameters of a vehicle, by index into the rotor actuator's user numbers. SI."""

    magic: int
    ordinal: int
    layout: int
    air_density: int
    ground_effect: int
    # main rotor
    main_direction: int
    main_radius: int
    main_speed: int
    main_solidity: int
    main_lift_slope: int
    main_induced_factor: int
    main_profile_drag: int
    main_pitch_trim: int
    main_pitch_range: int
    main_twist: int
    main_stall: int
    main_dynamic_inflow: int
    # the hub in shaft axes, which lean forward by an angle of this cosine and sine
    hub_x: int
    hub_z: int
    shaft_cosine: int
    shaft_sine: int
    hub_stiffness: int
    hub_cross: int
    # flapping of the tip-path plane: the air's hold on it over inertia and density, how much inflow
    # that follows reduces that, nu^2 - 1, springs at full speed in 1/s, tilt by the swashplate
    flap_hold: int
    flap_reduction: int
    flap_stiffness: int
    spring_aa: int
    spring_ab: int
    spring_ba: int
    cyclic_a_lat: int
    cyclic_a_lon: int
    cyclic_b_lat: int
    cyclic_b_lon: int
    flap_back: int
    flap_stop: int
    # tail rotor
    tail_radius: int
    tail_speed: int
    tail_solidity: int
    tail_lift_slope: int
    tail_pitch_trim: int
    tail_pitch_range: int
    tail_stall: int
    tail_induced_factor: int
    tail_profile_drag: int
    tail_direction: int
    tail_x: int
    tail_z: int
    tail_blockage: int
    # drive: 0 keeps the rotor's speed as commanded, 1 is a motor; then all that follow count
    drive_governor: int
    drive_engine: int
    drive_inertia: int
    drive_friction: int
    drive_gear: int
    drive_voltage: int
    drive_speed_constant: int
    drive_resistance: int
    drive_no_load_current: int
    drive_current_limit: int
    drive_power: int
    drive_power_speed: int
    drive_lag: int
    drive_k_p: int
    drive_k_i: int
    drive_collective_gain: int
    drive_spool_up: int
    drive_bail_out: int
    # fuselage: drag areas and where they act, volumes of its moments, wash over induced velocity
    drag_x: int
    drag_y: int
    drag_z: int
    drag_centre_x: int
    drag_centre_z: int
    pitch_volume: int
    pitch_zero: int
    yaw_volume: int
    download: int
    # fin and tailplane
    fin_area: int
    fin_x: int
    fin_z: int
    fin_stall: int
    fin_slope: int
    fin_cosine: int
    fin_sine: int
    tailplane_area: int
    tailplane_x: int
    tailplane_z: int
    tailplane_stall: int
    tailplane_slope: int
    tailplane_cosine: int
    tailplane_sine: int
    # the main rotor's wash at tail rotor and fin, and at the tailplane, by wake.COEFFICIENTS
    tail_wash: int
    tail_wash_1: int
    tail_wash_2: int
    tail_wash_3: int
    tail_wash_4: int
    tail_wash_5: int
    tail_wash_6: int
    tail_wash_7: int
    tailplane_wash: int
    tailplane_wash_1: int
    tailplane_wash_2: int
    tailplane_wash_3: int
    tailplane_wash_4: int
    tailplane_wash_5: int
    tailplane_wash_6: int
    tailplane_wash_7: int
    # servos
    swash_frequency: int
    swash_damping: int
    tail_frequency: int
    tail_damping: int
    servo_rate_limit: int
    servo_travel: int
    # swashplate: from col, lon, lat to each servo's position, and back
    mix_front_col: int
    mix_front_lon: int
    mix_front_lat: int
    mix_left_col: int
    mix_left_lon: int
    mix_left_lat: int
    mix_right_col: int
    mix_right_lon: int
    mix_right_lat: int
    unmix_col_front: int
    unmix_col_left: int
    unmix_col_right: int
    unmix_col_over: int
    unmix_lon_front: int
    unmix_lon_left: int
    unmix_lon_right: int
    unmix_lon_over: int
    unmix_lat_front: int
    unmix_lat_left: int
    unmix_lat_right: int
    unmix_lat_over: int
    # gyro
    gyro_on: int
    swash_law: int
    tail_law: int
    law_token: int
    swash_states: int
    tail_states: int
    # commands of servos that no law moves, where a plan flies: 1, and then these count
    planned: int
    planned_front: int
    planned_left: int
    planned_right: int
    planned_tail: int
    gyro_period: int
    gyro_heading_lock: int
    gyro_attitude_lock: int
    gyro_collective: int
    gyro_hold_above: int
    gyro_k_p: int
    gyro_k_i: int
    gyro_k_delta: int
    gyro_k_a: int
    gyro_lead: int
    gyro_lead_share: int
    gyro_lead_lag: int
    gyro_kp_lat: int
    gyro_kp_lon: int
    gyro_ki_lat: int
    gyro_ki_lon: int
    gyro_kd_lat: int
    gyro_kd_lon: int
    gyro_filter_share: int
    gyro_filter_mean: int
    gyro_derivative_share: int
    gyro_derivative_through: int
    gyro_derivative_lag: int
    gyro_phase_cosine: int
    gyro_phase_sine: int
    gyro_p_per_lat: int
    gyro_p_per_lon: int
    gyro_q_per_lat: int
    gyro_q_per_lon: int
    # pilot: hover hold
    pilot_on: int
    pilot_north: int
    pilot_east: int
    pilot_down: int
    pilot_psi: int
    pilot_phi: int
    pilot_theta: int
    pilot_col: int
    pilot_lon: int
    pilot_lat: int
    pilot_ped: int
    pilot_k_attitude: int
    pilot_k_velocity: int
    pilot_k_position: int
    pilot_k_heave: int
    pilot_k_height: int
    pilot_k_heading: int
    # pilot: remnant, white at knots, linear between them
    pilot_seed: int
    remnant_col: int
    remnant_lon: int
    remnant_lat: int
    remnant_ped: int
    remnant_interval: int
    # excitation
    excitation: int
    excitation_start: int
    excitation_duration: int
    excitation_col: int
    excitation_lon: int
    excitation_lat: int
    excitation_ped: int
    sweep_w_min: int
    sweep_w_max: int
    sweep_fade: int
    sweep_unsteadiness: int
    # a gust, north-east-down
    gust_north: int
    gust_east: int
    gust_down: int
    gust_start: int
    gust_rise: int
    gust_hold: int
    # turbulence, along the path through the air
    turbulence_on: int
    turbulence_seed: int
    turbulence_cosine: int
    turbulence_sine: int
    turbulence_span: int
    turbulence_u: int
    turbulence_v: int
    turbulence_w: int
    turbulence_p: int
    turbulence_lag_u: int
    turbulence_lag_v: int
    turbulence_lag_w: int
    turbulence_lag_p: int
    # faults: 1 where there are any; then all that follow count
    faults: int
    front_fault_at: int
    front_fault_rate_limit: int
    front_fault_low: int
    front_fault_high: int
    left_fault_at: int
    left_fault_rate_limit: int
    left_fault_low: int
    left_fault_high: int
    right_fault_at: int
    right_fault_rate_limit: int
    right_fault_low: int
    right_fault_high: int
    tail_fault_at: int
    tail_fault_rate_limit: int
    tail_fault_low: int
    tail_fault_high: int
    restart_at: int
    restart_until: int
    restart_neutral: int
    dropout_at: int
    dropout_until: int
    dropout_p: int
    dropout_q: int
    dropout_r: int


PARAM = ParamIndex(*range(len(ParamIndex._fields)))

NO_LAW = 0
SHIPPED_LAW = 1
"""What `PARAM.swash_law` and `PARAM.tail_law` say; from 2 on, a row of the laws' table."""

SWEEP = 1
DOUBLET = 2
HISTORY = 3
"""What `PARAM.excitation` says; 0 is no excitation, and `HISTORY` is what `INJECTION` holds."""

HANDS_OFF_ROTOR = 2
"""What `PARAM.pilot_on` says of a pilot who leaves the rotor's control to the caller; 1 is one who
keeps it at its nominal speed."""

READS_ZERO = 1
READS_HELD = 2
"""How a rate that dropped out reads: what `PARAM.dropout_p` and the like say; 0 is as ever."""

NEVER = 1e9
"""s, of a fault that does not come; also a limit that none reaches."""
