"""A third vehicle for the tests: all its own, of any size, built from nothing in a folder.

Three blades that turn counter-clockwise, an H3-140 swashplate with its servo behind, more travel.
Sizes are Froude's: lengths scale with n, masses with n^3, times and speeds with the root of n.
"""

from pathlib import Path

from helisim.vehicle.parameters import term

MASS = 4.2
"""kg, of the vehicle of size 1."""

TARGETS = {
    "tau_f": 0.0360,
    "A_b": 0.300,
    "B_a": -0.360,
    "A_lat": -0.040,
    "A_lon": 0.300,
    "B_lat": 0.310,
    "B_lon": 0.050,
    "Z_w": -1.10,
    "Z_col": -50.0,
    "N_r": -0.84,
    "N_ped": 62.0,
    "L_b": 1130.0,
    "M_a": 402.0,
}
"""What the vehicle of size 1 is calibrated to.

The signs of A_b, B_a, A_lat and B_lon are those of a rotor that turns counter-clockwise.
"""

_GIVEN = """
air: density 1.2, ground_effect 0
airframe: ixx 0.060, drag_area_x 0.02, drag_area_y 0.05, drag_area_z 0.04
fin: area 0.006
main_rotor: direction -1, radius 0.62, chord 0.050, blades 3, speed 190, induced_factor 1.15
main_rotor: profile_drag 0.012, stall 0.18, hub_x 0, hub_z -0.20, flap_back 1, flap_stop 0.35
tail_rotor: radius 0.11, chord 0.025, blades 2, speed 874, lift_slope 5, stall 0.18
tail_rotor: arm_x -0.78, arm_z 0
swashplate: front_angle 3.141592653589793, left_angle 0.7853981633974483, front_sign -1
swashplate: right_angle -0.7853981633974483, left_arm 1.4142135623730951
swashplate: right_arm 1.4142135623730951
servo: swash_frequency 170, swash_damping 0.8, tail_frequency 260, tail_damping 0.9
servo: rate_limit 8, travel 1.1
gyro: period 0.002, latency 0, lead 0, lead_filter 0.0025, heading_lock 1, ped_latency 0
gyro: k_delta 4, k_a 1, p_per_lat 6, p_per_lon 0, q_per_lat 0, q_per_lon 6, flight_mode 3
gyro: pitch_rate 1, elevator_rate 1, aileron_rate 1, anti_windup 1, filter 0.003
gyro: derivative_filter 0.003
gyro_tuned: pitch_rate 1, elevator_rate 1, aileron_rate 1
recorder_latency: p 0.010, q 0.010, r 0.008
tuning: cyclic_bandwidth 8, yaw_bandwidth 8, peak_sensitivity 1.6
pilot: k_attitude 0.15, k_velocity 0.04, k_position 0.1, k_heave 0.015, k_height 0.15
pilot: k_heading 0.035
sweep: col_amplitude 0.03, col_w_min 0.25, col_w_max 15, lon_amplitude 0.05, lon_w_min 1
sweep: lon_w_max 60, lat_amplitude 0.05, lat_w_min 1, lat_w_max 60, ped_amplitude 0.03
sweep: ped_w_min 0.4, ped_w_max 30
band: yaw_base_low 0.6, yaw_base_high 25, rollpitch_in1_low 4, rollpitch_in1_high 50
band: heave_low 0.3, heave_high 12
"""
"""The parameters at size 1."""

_POWERS = {
    "m": 1.0,
    "m^2": 2.0,
    "kg m^2": 5.0,
    "rad/s": -0.5,
    "1/s": -0.5,
    "s/m": -0.5,
    "rad s/m": -0.5,
    "s/rad": 0.5,
    "rad/s^2": -1.0,
    "1/s^2": -1.0,
}
"""Of n, by unit; servos and the times of gyro and recorder don't scale."""


def build(folder: Path, *, size: float = 1.0) -> Path:
    """Write the vehicle's folder, not calibrated and not tuned, and return it.

    folder: made; its name is the vehicle's; size: n, masses are n^3 times 4.2 kg.
    """
    folder.mkdir(parents=True)
    (folder / "parameters.toml").write_text(_toml(size))
    (folder / f"{folder.name}.xml").write_text(_mjcf(size))
    return folder


def _toml(size: float) -> str:
    sections = {"targets": dict(TARGETS)}
    for section, items in (line.split(": ") for line in _GIVEN.split("\n") if line):
        values = (item.split() for item in items.split(", "))
        sections.setdefault(section, {}).update({key: float(value) for key, value in values})
    lines = []
    for section, entries in sections.items():
        lines += ["", f"[{section}]"]
        for name, value in entries.items():
            known = term(f"{section}.{name}")
            assert known is not None
            unit = known.unit
            power = 0.5 if name == "tau_f" else _POWERS.get(unit, 0.0)
            scaled = value if section == "servo" else value * size**power
            lines.append(f'{name} = {{ value = {scaled!r}, unit = "{unit}", source = "chosen" }}')
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
    channel = 'joint="base" gear="0 0 0 0 0 0" gaintype="fixed" gainprm="0" biastype="none"'
    user = 'datatype="real" needstage="acc" objtype="body" objname="heron_frame"'
    sticks = "".join(
        f'<general name="{one}" {channel} ctrlrange="-0.5 0.5"/>'
        for one in ("COL", "LON", "LAT", "PED")
    )
    servos = "".join(
        f'<general name="servo_{one}" {channel} dyntype="user" actdim="2"/>'
        for one in ("front", "left", "right", "tail")
    )
    told = {"stick": 4, "servo_command": 4, "servo_position": 4, "flapping": 2, "rotor": 5}
    told |= {"power": 4, "air": 6, "contact": 3}
    told = "".join(f'<user name="{one}" dim="{dim}" {user}/>' for one, dim in told.items())
    skids = "".join(
        f'<geom type="capsule" fromto="{-0.15 * n} {y} 0 {0.15 * n} {y} 0" size="{0.006 * n}" '
        f'mass="{0.5 * m["skids"]}" contype="0" conaffinity="1"/>'
        for y in (0.1 * n, -0.1 * n)
    )
    return f"""<mujoco model="heron">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.002" integrator="RK4" density="0" viscosity="0" gravity="0 0 -9.81">
    <flag autoreset="disable"/>
  </option>
  <size nuser_actuator="320"/>
  <worldbody>
    <body name="heron_frame" pos="0 0 {0.3 * n}">
      <freejoint name="base"/>
      <site name="imu" pos="{0.06 * n} {-0.015 * n} {-0.08 * n}"/>
      <site name="stabiliser" pos="{-0.1 * n} 0 {0.02 * n}"/>
      <site name="hub" pos="0 0 {0.20 * n}"/>
      <site name="tail_hub" pos="{-0.78 * n} 0 0"/>
      <body name="fuselage">
        <inertial pos="{x * n} 0 {z * n}" mass="{n**3 * rest}"
          fullinertia="{0.02 * n**5} {0.03 * n**5} {0.03 * n**5} 0 0 0"/>
        <geom type="ellipsoid" size="{0.2 * n} {0.07 * n} {0.09 * n}" contype="0" conaffinity="0"/>
      </body>
      <body name="head" pos="0 0 {0.19 * n}">
        <geom type="cylinder" size="{0.02 * n} {0.02 * n}" mass="{m["head"]}" contype="0"
          conaffinity="0"/>
        <body name="rotor" pos="0 0 {0.01 * n}">
          <inertial pos="0 0 0" mass="{m["blades"]}" diaginertia="{disc} {disc} {2 * disc}"/>
          <geom type="box" size="{0.62 * n} {0.025 * n} {0.002 * n}" contype="0" conaffinity="0"/>
          <geom name="rotor_disc" type="cylinder" size="{0.62 * n} {0.001 * n}" contype="0"
            conaffinity="0" rgba="0.4 0.5 0.7 0.1"/>
        </body>
      </body>
      <body name="boom" pos="{-0.45 * n} 0 0">
        <geom type="capsule" fromto="{-0.33 * n} 0 0 {0.33 * n} 0 0" size="{0.01 * n}"
          mass="{m["boom"]}" contype="0" conaffinity="0"/>
      </body>
      <body name="tail_rotor" pos="{-0.78 * n} {-0.04 * n} 0">
        <geom type="box" size="{0.11 * n} {0.002 * n} {0.012 * n}" mass="0" contype="0"
          conaffinity="0"/>
      </body>
      <body name="battery" pos="{0.10 * n} 0 {-0.03 * n}">
        <geom type="box" size="{0.07 * n} {0.03 * n} {0.03 * n}" mass="{m["battery"]}" contype="0"
          conaffinity="0"/>
      </body>
      <body name="skids" pos="0 0 {-0.16 * n}">
        {skids}
      </body>
    </body>
  </worldbody>
  <actuator>
    {sticks}
    {servos}
    <general name="rotor" {channel} ctrlrange="0 1.2" dyntype="user" actdim="50"/>
  </actuator>
  <sensor>
    <gyro name="imu_gyro" site="imu"/>
    <accelerometer name="imu_accelerometer" site="imu"/>
    <velocimeter name="imu_velocity" site="imu"/>
    <framequat name="imu_attitude" objtype="site" objname="imu"/>
    <framepos name="imu_position" objtype="site" objname="imu"/>
    <gyro name="gyro_rate" site="stabiliser"/>
    {told}
    <clock name="clock"/>
  </sensor>
  <keyframe>
    <key name="hover" qpos="0 0 10 1 0 0 0" ctrl="0 0 0 0 0 0 0 0 1"/>
  </keyframe>
</mujoco>
"""
