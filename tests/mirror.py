"""A vehicle's parameters as a mirror shows them that swaps left and right.

What turns clockwise turns the other way there; forces to the left push to the right. Physics knows
no hand, so the mirrored vehicle flies the mirror image of every flight, and a helicopter that
turns counter-clockwise can start from the numbers of one that turns clockwise.
"""

from helisim.vehicle.parameters import Parameters, PhysicalParameter, completed

_ODD = (
    "main_rotor.direction",
    "fin.incidence",
    "flapping.a_b",
    "flapping.b_a",
    "flapping.a_lat",
    "flapping.b_lon",
    "gyro.phase",
    "gyro.p_per_lon",
    "gyro.q_per_lat",
    "swashplate.front_angle",
    "swashplate.left_angle",
    "swashplate.right_angle",
)
"""What changes sign: of pitch by roll and of roll by pitch, and angles seen from above."""


def mirrored(parameters: Parameters) -> Parameters:
    """Return the parameters of the mirrored vehicle; its MJCF's left and right want swapping too.

    The servo that was the left one is the right one then. Controls keep their sense: `lat` rolls
    right and `ped` turns the nose right for both.
    """
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
