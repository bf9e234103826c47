"""A vehicle's parameters as a mirror shows them that swaps left and right."""

from helisim.vehicle.parameters import Parameters, PhysicalParameter, completed

_ODD = {"main_rotor.direction", "fin.incidence", "gyro.phase", "gyro.p_per_lon", "gyro.q_per_lat"}
_ODD |= {f"flapping.{name}" for name in ("a_b", "b_a", "a_lat", "b_lon")}
_ODD |= {f"swashplate.{name}_angle" for name in ("front", "left", "right")}
"""What changes sign: of pitch by roll and of roll by pitch, and angles seen from above."""


def mirrored(parameters: Parameters) -> Parameters:
    """Return the parameters of the mirrored vehicle; its MJCF wants swapping too."""
    whole = completed(parameters)
    entries = {}
    for name in whole:
        entry = whole.entry(_swapped(name))
        value = -entry.value if name in _ODD else entry.value
        entries[name] = PhysicalParameter(name, value, entry.unit, entry.source)
    return Parameters(entries)


def _swapped(name: str) -> str:
    if name.startswith("swashplate.left_"):
        return name.replace("left", "right")
    if name.startswith("swashplate.right_"):
        return name.replace("right", "left")
    return name


def mirrored_parts(model):
    for places in (model.body_ipos, model.site_pos, model.geom_pos):
        places[:, 1] *= -1.0
    for turns in (model.body_iquat, model.site_quat, model.geom_quat):
        turns[:, [1, 3]] *= -1.0
