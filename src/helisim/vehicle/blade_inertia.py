"""How heavy a blade is to the air, or how fast the disc follows: a vehicle's author says one.

The other follows, by `main_rotor.blade_inertia` = density x lift slope x chord x radius^4 / Lock
number. [flapping] holds at the vehicle's own density and rotor speed; where these change, so do its
numbers, and the blade, its springs and the swashplate stay.
"""

import math
from collections.abc import Mapping

from helisim.base.errors import ModelError
from helisim.vehicle.blade import FLAPPING, TipPathPlane, lock_reduction
from helisim.vehicle.parameters import Parameters, PhysicalParameter

INERTIA = "main_rotor.blade_inertia"
TIME_CONSTANT = "flapping.tau_f"
REDUCTION = "flapping.lock_reduction"

INSTEAD = {TIME_CONSTANT: (INERTIA,)}
"""Needed parameter -> others that may be given in its place."""

_AIR = ("air.density", "main_rotor.lift_slope", "main_rotor.chord", REDUCTION, INERTIA)
_FELT = (*_AIR, "main_rotor.radius", "main_rotor.speed")
"""Parameters that change what the blade's springs and inertia make of [flapping]."""
_SAME = 1e-6
"""Relative difference up to which an inertia and a time constant say the same."""
_LEAST = 1e-18
"""kg m^2, below any inertia of a blade; its inverse is above any."""
_FOLLOWS = "follows from "
_MOVED = "of the same blade, in other air or at another speed"
_LEAST_INFLOW = 0.01
"""Inflow ratio of the lightest disc, where the collective's centre is no hover."""


def with_both(parameters: Parameters) -> Parameters:
    """Return the parameters with blade inertia, time constant and reduction of the Lock number.

    Where one of the parameters that they follow from can't be, they are as they were.

    Raises:
        ModelError: inertia and time constant are both given and contradict, or no blade has them.
    """
    entries = {name: parameters.entry(name) for name in parameters}
    if not _sound(parameters):
        return parameters
    if REDUCTION not in entries:
        said = f"{_FOLLOWS}lift slope, solidity and the collective's centre"
        entries[REDUCTION] = PhysicalParameter(REDUCTION, _reduction(parameters), "1", said)
    known = Parameters(entries)
    if TIME_CONSTANT not in entries:
        value, said = _time_constant(known), f"{_FOLLOWS}{INERTIA}"
        entries[TIME_CONSTANT] = PhysicalParameter(TIME_CONSTANT, value, "s", said)
        return Parameters(entries)
    inertia = _inertia(known)
    if INERTIA not in entries:
        said = f"{_FOLLOWS}{TIME_CONSTANT}"
        entries[INERTIA] = PhysicalParameter(INERTIA, inertia, "kg m^2", said)
    elif not abs(entries[INERTIA].value / inertia - 1.0) < _SAME:
        raise ModelError(
            f"{INERTIA} = {entries[INERTIA].value:g} kg m^2 and {TIME_CONSTANT} = "
            f"{entries[TIME_CONSTANT].value:g} s contradict: with this time constant it is "
            f"{inertia:g} kg m^2; give one of both"
        )
    return Parameters(entries)


def stated(parameters: Parameters) -> Parameters:
    """Return the parameters without what follows from others by `with_both`."""
    entries = {name: parameters.entry(name) for name in parameters}
    return Parameters(
        {name: one for name, one in entries.items() if not one.source.startswith(_FOLLOWS)}
    )


def changed(parameters: Parameters, changes: Mapping[str, float | str]) -> Parameters:
    """Return the parameters with some replaced, and the flapping that follows from them.

    What is replaced by name stands. Of [flapping] the rest is that of the same blade, on the same
    springs, under the same swashplate; a new time constant is that of a blade of other inertia.

    Args:
        parameters: of a vehicle, all of them.
        changes: values or words by name.

    Raises:
        UnknownNameError: no such parameter.
        InputError: a value is not finite, or not among the words that it can be.
        ModelError: a blade inertia and a time constant contradict.
    """
    new = parameters.replace(changes)
    follows = [f"flapping.{name}" for name in FLAPPING if f"flapping.{name}" not in changes]
    entries = {name: new.entry(name) for name in new}
    if not _sound(new):
        return new
    if any(name in changes for name in _FELT):
        there = TipPathPlane.of(parameters)
        slower = parameters["main_rotor.speed"] / new["main_rotor.speed"]
        lighter = parameters[INERTIA] / new[INERTIA]
        air = _grip(new) / _grip(parameters) * lighter
        moved = there.scaled(air=air, spring=slower * slower * lighter).flapping(
            speed=new["main_rotor.speed"], direction=new["main_rotor.direction"]
        )
        for name in follows:
            unit, value = entries[name].unit, moved.to_parameters()[name]
            entries[name] = PhysicalParameter(name, value, unit, _MOVED)
    if INERTIA not in changes:
        del entries[INERTIA]
    return with_both(Parameters(entries))


def lock_number(parameters: Mapping[str, float]) -> float:
    """Return the blades' own Lock number, of parameters that have their inertia."""
    return parameters[REDUCTION] * _held(parameters)


def _sound(parameters: Mapping[str, float]) -> bool:
    """Return whether a rotor can have these parameters; the force laws refuse others by name."""
    positive = {*_FELT, "main_rotor.blades", TIME_CONSTANT} & set(parameters)
    return abs(parameters["main_rotor.direction"]) == 1.0 and all(
        parameters[name] > 0.0 for name in positive
    )


def _grip(parameters: Mapping[str, float]) -> float:
    """Return density x lift slope x chord x radius^4 over the reduction, kg m^2."""
    air = parameters["air.density"] * parameters["main_rotor.lift_slope"]
    square = parameters["main_rotor.radius"] * parameters["main_rotor.radius"]
    size = parameters["main_rotor.chord"] * square * square
    found = air * size / parameters[REDUCTION]
    if not _LEAST < found < 1.0 / _LEAST:
        raise ModelError(
            f"air.density, or lift_slope, chord or radius of the main rotor, or {REDUCTION} is out "
            "of all proportion"
        )
    return found


def _held(parameters: Mapping[str, float]) -> float:
    """Return the Lock number that the tip-path plane has, reduced by the inflow."""
    return _grip(parameters) / parameters[INERTIA]


def _inertia(parameters: Mapping[str, float]) -> float:
    return _grip(parameters) / (16.0 * TipPathPlane.of(parameters).share)


def _time_constant(parameters: Mapping[str, float]) -> float:
    speed, direction = parameters["main_rotor.speed"], parameters["main_rotor.direction"]
    mean = 0.5 * direction * (parameters["flapping.b_a"] - parameters["flapping.a_b"])
    found = (16.0 / _held(parameters) - mean) / speed
    if not found > 0.0:
        raise ModelError(
            f"{INERTIA} = {parameters[INERTIA]:g} kg m^2 is too light for couplings of "
            f"{parameters['flapping.a_b']:g} and {parameters['flapping.b_a']:g}"
        )
    return found


def _reduction(parameters: Mapping[str, float]) -> float:
    area = parameters["main_rotor.blades"] * parameters["main_rotor.chord"]
    solidity = area / (math.pi * parameters["main_rotor.radius"])
    slope, pitch = parameters["main_rotor.lift_slope"], parameters["main_rotor.pitch_trim"]
    part = solidity * slope / 16.0
    inflow = math.sqrt(part**2 + 4.0 / 3.0 * part * max(pitch, 0.0)) - part  # of the hover
    return lock_reduction(slope, solidity, max(inflow, _LEAST_INFLOW))
