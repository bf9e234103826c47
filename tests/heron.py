"""A third vehicle for the tests: all its own, of any size, built from nothing in a folder.

Three blades that turn counter-clockwise, an H3-140 swashplate with its servo behind, more travel.
Sizes are Froude's: lengths scale with n, masses with n^3, times and speeds with the root of n.
"""

from pathlib import Path
from xml.etree import ElementTree

from helisim.vehicle.parameters import term

TARGETS = {
    "tau_f": 0.0360, "A_b": 0.300, "B_a": -0.360, "A_lat": -0.040, "A_lon": 0.300, "B_lat": 0.310,
    "B_lon": 0.050, "Z_w": -1.10, "Z_col": -50.0, "N_r": -0.84, "N_ped": 62.0, "L_b": 1130.0,
    "M_a": 402.0,
}  # fmt: skip
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

_POWERS = {"m": 1.0, "m^2": 2.0, "kg m^2": 5.0, "s/rad": 0.5, "rad/s^2": -1.0, "1/s^2": -1.0}
_POWERS |= dict.fromkeys(("rad/s", "1/s", "s/m", "rad s/m"), -0.5)
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


_SCALED = {"pos": 1, "size": 1, "fromto": 1, "mass": 3, "fullinertia": 5, "diaginertia": 5}
"""Power of n of each attribute of the MJCF."""


def _mjcf(n: float) -> str:
    """Return the MJCF of a vehicle of size n, from that of size 1 beside this file."""
    tree = ElementTree.parse(Path(__file__).with_name("heron.xml")).getroot()
    for one in tree.iter():
        for name in _SCALED.keys() & one.attrib.keys():
            numbers = (float(number) * n ** _SCALED[name] for number in one.attrib[name].split())
            one.attrib[name] = " ".join(map(repr, numbers))
    return ElementTree.tostring(tree, encoding="unicode")
