"""A third vehicle for the tests: all its own, of any size, built from nothing in a folder.

Three blades that turn counter-clockwise, another disc than the shipped ones, an H3-140 swashplate
with the elevator's servo behind, other servos and more travel, and every name its author's. Sizes
are Froude's: lengths scale with n, masses with n^3, times and speeds with the root of n.
"""

import math
from pathlib import Path

MASS = 4.2
"""kg, of the vehicle of size 1."""

_ACTUATORS = {
    "COL": "stick_lift",
    "LON": "stick_nick",
    "LAT": "stick_roll",
    "PED": "stick_tail",
    "servo_front": "elevator_servo",
    "servo_left": "port_servo",
    "servo_right": "starboard_servo",
    "servo_tail": "rudder_servo",
    "rotor": "main_shaft",
}
_SENSORS = {
    "imu_gyro": "nav_rate",
    "imu_accelerometer": "nav_force",
    "imu_velocity": "nav_speed",
    "imu_attitude": "nav_attitude",
    "imu_position": "nav_place",
    "gyro_rate": "stabiliser_rate",
    "stick": "seen_sticks",
    "servo_command": "seen_commands",
    "servo_position": "seen_servos",
    "flapping": "seen_tilt",
    "rotor": "seen_rotor",
    "power": "seen_power",
    "air": "seen_air",
    "contact": "seen_contact",
    "clock": "seen_time",
}

TARGETS = {
    "tau_f": (0.0360, "s", 0.5),
    "A_b": (0.300, "1", 0.0),
    "B_a": (-0.360, "1", 0.0),
    "A_lat": (-0.040, "rad", 0.0),
    "A_lon": (0.300, "rad", 0.0),
    "B_lat": (0.310, "rad", 0.0),
    "B_lon": (0.050, "rad", 0.0),
    "Z_w": (-1.10, "1/s", -0.5),
    "Z_col": (-50.0, "m/s^2", 0.0),
    "N_r": (-0.84, "1/s", -0.5),
    "N_ped": (62.0, "rad/s^2", -1.0),
    "L_b": (1130.0, "1/s^2", -1.0),
    "M_a": (402.0, "1/s^2", -1.0),
}
"""What the vehicle of size 1 is calibrated to: value, unit, and the power of n it scales with.

The signs of A_b, B_a, A_lat and B_lon are those of a rotor that turns counter-clockwise.
"""

_GEOMETRY = {
    "lift_slope": (5.5, "1/rad", 0.0),
    "blade_inertia": (0.0115, "kg m^2", 5.0),
    "hub_stiffness": (60.0, "N m/rad", 4.0),
    "collective_range": (0.30, "rad", 0.0),
    "cyclic_range": (0.30, "rad", 0.0),
    "tail_range": (0.45, "rad", 0.0),
    "iyy": (0.17, "kg m^2", 5.0),
    "izz": (0.165, "kg m^2", 5.0),
}

_PARAMETERS = {
    "air": {"density": (1.2, "kg/m^3", 0.0), "ground_effect": (0, "1", 0.0)},
    "airframe": {
        "ixx": (0.060, "kg m^2", 5.0),
        "drag_area_x": (0.02, "m^2", 2.0),
        "drag_area_y": (0.05, "m^2", 2.0),
        "drag_area_z": (0.04, "m^2", 2.0),
        "fin_area": (0.006, "m^2", 2.0),
    },
    "main_rotor": {
        "direction": (-1, "1", 0.0),
        "radius": (0.62, "m", 1.0),
        "chord": (0.050, "m", 1.0),
        "blades": (3, "1", 0.0),
        "speed": (190.0, "rad/s", -0.5),
        "induced_factor": (1.15, "1", 0.0),
        "profile_drag": (0.012, "1", 0.0),
        "stall": (0.18, "1", 0.0),
        "hub_x": (0.0, "m", 1.0),
        "hub_z": (-0.20, "m", 1.0),
        "flap_back": (1.0, "1", 0.0),
        "flap_stop": (0.35, "rad", 0.0),
    },
    "tail_rotor": {
        "radius": (0.11, "m", 1.0),
        "chord": (0.025, "m", 1.0),
        "blades": (2, "1", 0.0),
        "speed": (874.0, "rad/s", -0.5),
        "lift_slope": (5.0, "1/rad", 0.0),
        "stall": (0.18, "1", 0.0),
        "arm_x": (-0.78, "m", 1.0),
        "arm_z": (0.0, "m", 1.0),
    },
    "swashplate": {
        "front_angle": (math.pi, "rad", 0.0),
        "left_angle": (0.25 * math.pi, "rad", 0.0),
        "right_angle": (-0.25 * math.pi, "rad", 0.0),
        "left_arm": (math.sqrt(2.0), "1", 0.0),
        "right_arm": (math.sqrt(2.0), "1", 0.0),
        "front_sign": (-1, "1", 0.0),
    },
    "servo": {
        "swash_frequency": (170.0, "rad/s", 0.0),
        "swash_damping": (0.8, "1", 0.0),
        "tail_frequency": (260.0, "rad/s", 0.0),
        "tail_damping": (0.9, "1", 0.0),
        "rate_limit": (8.0, "1/s", 0.0),
        "travel": (1.1, "1", 0.0),
    },
    "gyro": {
        "period": (0.002, "s", 0.0),
        "latency": (0.0, "s", 0.0),
        "lead": (0.0, "s", 0.0),
        "lead_filter": (0.0025, "s", 0.0),
        "heading_lock": (1, "1", 0.0),
        "ped_latency": (0.0, "s", 0.0),
        "k_delta": (4.0, "1", 0.0),
        "k_a": (1.0, "s/rad", 0.5),
        "p_per_lat": (6.0, "rad/s", -0.5),
        "p_per_lon": (0.0, "rad/s", 0.0),
        "q_per_lat": (0.0, "rad/s", 0.0),
        "q_per_lon": (6.0, "rad/s", -0.5),
        "flight_mode": (3, "1", 0.0),
        "pitch_rate": (1.0, "1", 0.0),
        "elevator_rate": (1.0, "1", 0.0),
        "aileron_rate": (1.0, "1", 0.0),
        "anti_windup": (1, "1", 0.0),
        "filter": (0.003, "s", 0.0),
        "derivative_filter": (0.003, "s", 0.0),
    },
    "gyro_tuned": dict.fromkeys(("pitch_rate", "elevator_rate", "aileron_rate"), (1.0, "1", 0.0)),
    "recorder_latency": {"p": (0.010, "s", 0.0), "q": (0.010, "s", 0.0), "r": (0.008, "s", 0.0)},
    "tuning": {
        "cyclic_bandwidth": (8.0, "rad/s", -0.5),
        "yaw_bandwidth": (8.0, "rad/s", -0.5),
        "peak_sensitivity": (1.6, "1", 0.0),
    },
    "pilot": {
        "k_attitude": (0.15, "1/rad", 0.0),
        "k_velocity": (0.04, "rad s/m", -0.5),
        "k_position": (0.1, "1/s", -0.5),
        "k_heave": (0.015, "s/m", -0.5),
        "k_height": (0.15, "1/s", -0.5),
        "k_heading": (0.035, "1/rad", 0.0),
    },
    "sweep": {
        "col_amplitude": (0.03, "1", 0.0),
        "col_w_min": (0.25, "rad/s", -0.5),
        "col_w_max": (15.0, "rad/s", -0.5),
        "lon_amplitude": (0.05, "1", 0.0),
        "lon_w_min": (1.0, "rad/s", -0.5),
        "lon_w_max": (60.0, "rad/s", -0.5),
        "lat_amplitude": (0.05, "1", 0.0),
        "lat_w_min": (1.0, "rad/s", -0.5),
        "lat_w_max": (60.0, "rad/s", -0.5),
        "ped_amplitude": (0.03, "1", 0.0),
        "ped_w_min": (0.4, "rad/s", -0.5),
        "ped_w_max": (30.0, "rad/s", -0.5),
    },
    "band": {
        "yaw_base_low": (0.6, "rad/s", -0.5),
        "yaw_base_high": (25.0, "rad/s", -0.5),
        "rollpitch_in1_low": (4.0, "rad/s", -0.5),
        "rollpitch_in1_high": (50.0, "rad/s", -0.5),
        "heave_low": (0.3, "rad/s", -0.5),
        "heave_high": (12.0, "rad/s", -0.5),
    },
}
"""Section -> name -> value at size 1, unit, and the power of n it scales with."""


def build(folder: Path, *, size: float = 1.0, targets: bool = True, geometry: bool = False) -> Path:
    """Write the vehicle's folder, not calibrated and not tuned, and return it.

    Args:
        folder: made; its name is the vehicle's.
        size: n; masses are n^3 times 4.2 kg.
        targets: whether it says what it is calibrated to.
        geometry: whether it has what an estimate takes.
    """
    folder.mkdir(parents=True)
    sections = dict(_PARAMETERS)
    if targets:
        sections["targets"] = TARGETS
    if geometry:
        sections["geometry"] = _GEOMETRY
    (folder / "parameters.toml").write_text(_toml(sections, size) + _roles())
    (folder / f"{folder.name}.xml").write_text(_mjcf(size))
    return folder


def _toml(sections: dict, size: float) -> str:
    lines = []
    for section, entries in sections.items():
        lines += ["", f"[{section}]"]
        for name, (value, unit, power) in entries.items():
            scaled = float(value) * size**power
            lines.append(f'{name} = {{ value = {scaled!r}, unit = "{unit}", source = "chosen" }}')
    return "\n".join(lines) + "\n"


def _roles() -> str:
    kinds = {
        "body": {"fuselage": "pod", "rotor": "blades", "tail_rotor": "tail_blades"},
        "site": {"imu": "nav", "hub": "mast_top", "tail_hub": "tail_shaft"},
        "geom": {"rotor_disc": "swept"},
        "actuator": _ACTUATORS,
        "sensor": _SENSORS,
        "keyframe": {"hover": "aloft"},
    }
    lines = []
    for kind, names in kinds.items():
        lines += ["", f"[roles.{kind}]", *(f'{role} = "{name}"' for role, name in names.items())]
    return "\n".join(lines) + "\n"


def _mjcf(n: float) -> str:
    """Return the MJCF of a vehicle of size n; the pod's place puts the centre of gravity at 0."""
    parts = {  # mass kg, x, z m
        "head": (0.35, 0.0, 0.19),
        "blades": (0.27, 0.0, 0.20),
        "boom": (0.30, -0.45, 0.0),
        "battery": (0.90, 0.10, -0.03),
        "skids": (0.18, 0.0, -0.16),
    }
    rest = MASS - sum(mass for mass, _, _ in parts.values())
    x, z = (-sum(part[0] * part[k] for part in parts.values()) / rest for k in (1, 2))
    m = {name: n**3 * mass for name, (mass, _, _) in parts.items()}
    disc = 0.25 * m["blades"] * (0.62 * n) ** 2 / 1.5
    a, s = _ACTUATORS, _SENSORS
    channel = 'joint="base" gear="0 0 0 0 0 0" gaintype="fixed" gainprm="0" biastype="none"'
    user = 'datatype="real" needstage="acc" objtype="body" objname="heron_frame"'
    return f"""<mujoco model="heron">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002" integrator="RK4" density="0" viscosity="0" gravity="0 0 -9.81">
    <flag autoreset="disable"/>
  </option>
  <size nuser_actuator="320"/>
  <worldbody>
    <body name="heron_frame" pos="0 0 {0.3 * n}">
      <freejoint name="base"/>
      <site name="nav" pos="{0.06 * n} {-0.015 * n} {-0.08 * n}"/>
      <site name="stabiliser" pos="{-0.1 * n} 0 {0.02 * n}"/>
      <site name="mast_top" pos="0 0 {0.20 * n}"/>
      <site name="tail_shaft" pos="{-0.78 * n} 0 0"/>
      <body name="pod">
        <inertial pos="{x * n} 0 {z * n}" mass="{n**3 * rest}"
          fullinertia="{0.02 * n**5} {0.03 * n**5} {0.03 * n**5} 0 0 0"/>
        <geom type="ellipsoid" size="{0.2 * n} {0.07 * n} {0.09 * n}" contype="0" conaffinity="0"/>
      </body>
      <body name="head" pos="0 0 {0.19 * n}">
        <geom type="cylinder" size="{0.02 * n} {0.02 * n}" mass="{m["head"]}" contype="0"
          conaffinity="0"/>
        <body name="blades" pos="0 0 {0.01 * n}">
          <inertial pos="0 0 0" mass="{m["blades"]}" diaginertia="{disc} {disc} {2 * disc}"/>
          <geom type="box" size="{0.62 * n} {0.025 * n} {0.002 * n}" contype="0" conaffinity="0"/>
          <geom name="swept" type="cylinder" size="{0.62 * n} {0.001 * n}" rgba="0.4 0.5 0.7 0.1"
            contype="0" conaffinity="0"/>
        </body>
      </body>
      <body name="boom" pos="{-0.45 * n} 0 0">
        <geom type="capsule" fromto="{-0.33 * n} 0 0 {0.33 * n} 0 0" size="{0.01 * n}"
          mass="{m["boom"]}" contype="0" conaffinity="0"/>
      </body>
      <body name="tail_blades" pos="{-0.78 * n} {-0.04 * n} 0">
        <geom type="box" size="{0.11 * n} {0.002 * n} {0.012 * n}" mass="0" contype="0"
          conaffinity="0"/>
      </body>
      <body name="battery" pos="{0.10 * n} 0 {-0.03 * n}">
        <geom type="box" size="{0.07 * n} {0.03 * n} {0.03 * n}" mass="{m["battery"]}" contype="0"
          conaffinity="0"/>
      </body>
      <body name="skids" pos="0 0 {-0.16 * n}">
        <geom type="capsule" fromto="{-0.15 * n} {0.1 * n} 0 {0.15 * n} {0.1 * n} 0"
          size="{0.006 * n}" mass="{0.5 * m["skids"]}" contype="0" conaffinity="1"/>
        <geom type="capsule" fromto="{-0.15 * n} {-0.1 * n} 0 {0.15 * n} {-0.1 * n} 0"
          size="{0.006 * n}" mass="{0.5 * m["skids"]}" contype="0" conaffinity="1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <general name="{a["COL"]}" {channel} ctrlrange="-0.5 0.5"/>
    <general name="{a["LON"]}" {channel} ctrlrange="-0.5 0.5"/>
    <general name="{a["LAT"]}" {channel} ctrlrange="-0.5 0.5"/>
    <general name="{a["PED"]}" {channel} ctrlrange="-0.5 0.5"/>
    <general name="{a["servo_front"]}" {channel} dyntype="user" actdim="2"/>
    <general name="{a["servo_left"]}" {channel} dyntype="user" actdim="2"/>
    <general name="{a["servo_right"]}" {channel} dyntype="user" actdim="2"/>
    <general name="{a["servo_tail"]}" {channel} dyntype="user" actdim="2"/>
    <general name="{a["rotor"]}" {channel} ctrlrange="0 1.2" dyntype="user" actdim="50"/>
  </actuator>
  <sensor>
    <gyro name="{s["imu_gyro"]}" site="nav"/>
    <accelerometer name="{s["imu_accelerometer"]}" site="nav"/>
    <velocimeter name="{s["imu_velocity"]}" site="nav"/>
    <framequat name="{s["imu_attitude"]}" objtype="site" objname="nav"/>
    <framepos name="{s["imu_position"]}" objtype="site" objname="nav"/>
    <gyro name="{s["gyro_rate"]}" site="stabiliser"/>
    <user name="{s["stick"]}" dim="4" {user}/>
    <user name="{s["servo_command"]}" dim="4" {user}/>
    <user name="{s["servo_position"]}" dim="4" {user}/>
    <user name="{s["flapping"]}" dim="2" {user}/>
    <user name="{s["rotor"]}" dim="5" {user}/>
    <user name="{s["power"]}" dim="4" {user}/>
    <user name="{s["air"]}" dim="6" {user}/>
    <user name="{s["contact"]}" dim="3" {user}/>
    <clock name="{s["clock"]}"/>
  </sensor>
  <keyframe>
    <key name="aloft" qpos="0 0 10 1 0 0 0" ctrl="0 0 0 0 0 0 0 0 1"/>
  </keyframe>
</mujoco>
"""
