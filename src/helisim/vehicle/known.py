"""A vehicle whose blades, hub and inertias are known: nothing is solved from derivatives.

What is left to find is where its hover stands: the pitch of main and tail blades with collective
and pedals centred. Its derivatives are then a prediction.
"""

import math
from collections.abc import Mapping
from os import PathLike

from helisim.base.errors import ModelError
from helisim.vehicle.assembly import assemble, mass_and_gravity
from helisim.vehicle.blade import Flapping, flapping_from_blade
from helisim.vehicle.calibrate import UNKNOWNS, Disc, hover_torque
from helisim.vehicle.parameters import Parameters, PhysicalParameter, completed, untuned
from helisim.vehicle.trim import find_trim

HOVER = ("main_rotor.pitch_trim", "tail_rotor.pitch_trim")
"""What hovering fixes."""
BLADE = ("main_rotor.blade_inertia", "flapping.lock_reduction", "geometry.cyclic_range")
"""What the tip-path plane takes beside the rotor's own parameters."""
_TRIALS = 4
"""Pitch is linear in the controls: one trial finds the hover, a second confirms it."""
_CENTRED = 1e-9
"""Of the controls, unitised."""


def is_known(given: Mapping[str, float]) -> bool:
    """Return whether parameters, uncalibrated, say all but the hover that is solved for."""
    solved = set(UNKNOWNS) - {*HOVER, "main_rotor.hub_cross"}
    return all(name in given for name in (*solved, *BLADE))


def settled(vehicle: str | PathLike[str], given: Parameters) -> Parameters:
    """Return what follows from a vehicle's known parameters: section [flapping], and the hover.

    Args:
        vehicle: name of a shipped one or path of a folder, whose MJCF is flown.
        given: its parameters; the gyro's may be missing.

    Raises:
        ModelError: there are no such blades, or they carry it in no hover.
        TrimError: it can't hover.
    """
    entries = {name: given.entry(name) for name in given}
    for name, value in flapping_of(given).to_parameters().items():
        unit = {"flapping.tau_f": "s", "flapping.a_b": "1", "flapping.b_a": "1"}.get(name, "rad")
        source = "computed: blade, hub stiffness and cyclic range"
        entries[name] = PhysicalParameter(name, value, unit, source)
    pitch = _first_pitch(given, *mass_and_gravity(vehicle))
    for _ in range(_TRIALS):
        for name, value in pitch.items():
            source = (
                f"solved: hover with the {'pedals' if 'tail' in name else 'collective'} centred"
            )
            entries[name] = PhysicalParameter(name, value, "rad", source)
        complete = completed(untuned(Parameters(entries)))
        trim = find_trim(assemble(vehicle, complete, delays=False))
        if max(abs(trim.col), abs(trim.ped)) < _CENTRED:
            solved = (name for name in entries if name not in given)
            return Parameters({name: entries[name] for name in solved})
        pitch["main_rotor.pitch_trim"] += complete["main_rotor.pitch_range"] * trim.col
        hand = complete["main_rotor.direction"]
        pitch["tail_rotor.pitch_trim"] += hand * complete["tail_rotor.pitch_range"] * trim.ped
    raise ModelError(f"{vehicle}: no pitch of the blades holds the hover with controls centred")


def flapping_of(given: Mapping[str, float]) -> Flapping:
    """Return the tip-path plane's equation of a rotor whose blade and hub are known.

    Args:
        given: parameters by name, `BLADE` and the main rotor's among them.

    Raises:
        InputError: a number that no rotor has.
    """
    inertia, speed = given["main_rotor.blade_inertia"], given["main_rotor.speed"]
    lift = given["air.density"] * given["main_rotor.lift_slope"] * given["main_rotor.chord"]
    lift /= given["flapping.lock_reduction"]
    spring = 2.0 * given["main_rotor.hub_stiffness"] / given["main_rotor.blades"]  # of one blade
    return flapping_from_blade(
        lock_number=lift * given["main_rotor.radius"] ** 4 / inertia,
        speed=speed,
        direction=given["main_rotor.direction"],
        lon_range=given["geometry.cyclic_range"],
        lat_range=given["geometry.cyclic_range"],
        flap_frequency=math.sqrt(1.0 + spring / (inertia * speed**2)),
    )


def _first_pitch(given: Mapping[str, float], mass: float, gravity: float) -> dict[str, float]:
    """Return the pitch of main and tail blades in hover, near enough to solve from."""
    main = Disc.of(given, "main_rotor", mass * gravity)
    tail = Disc.of(given, "tail_rotor", hover_torque(given, main) / abs(given["tail_rotor.arm_x"]))
    return {
        f"{rotor}.pitch_trim": disc.pitch(given[f"{rotor}.lift_slope"] * disc.solidity)
        for rotor, disc in (("main_rotor", main), ("tail_rotor", tail))
    }
