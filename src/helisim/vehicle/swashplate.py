"""The mixing of a swashplate's three servos (CCPM), and the blade behind the tip-path plane.

A servo at an angle from the nose, positive to the left, moves by
col + arm (cos(angle) lon + sin(angle) lat), or the other way where it is reversed.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, astuple, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError
from helisim.physics import gyro as servo
from helisim.physics.layout import PARAM
from helisim.vehicle.parameters import Parameters, PhysicalParameter, check_values

SERVOS = ("front", "left", "right")  # "front" is the elevator's servo, wherever it stands

PLATE = slice(PARAM.mix_front_col, PARAM.unmix_lat_over + 1)
_EXACT = np.array([0.0, 0.5, np.sqrt(0.5), 0.5 * np.sqrt(3.0), 1.0])
"""Sines and cosines of whole multiples of 30 and 45 degrees, which rounding would miss."""
_ROUNDING, _FLATTEST = 1e-12, 1e-3  # least area that the three span, of arms of 1


@dataclass(frozen=True, eq=False)
class Swashplate:
    """The mixing of three servos; numbers: (21,) as from `PARAM.mix_front_col` on."""

    numbers: NDArray[np.float64]

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Swashplate":
        """Return a vehicle's, by its parameters; ModelError if the servos can't tilt it."""
        arm, sign, angle = (
            np.array([parameters[f"swashplate.{name}_{key}"] for name in SERVOS])
            for key in ("arm", "sign", "angle")
        )
        x, y = arm * _exact(np.cos(angle)), arm * _exact(np.sin(angle))
        rows = np.column_stack([np.ones(3), x, y])
        after, last = np.array([1, 2, 0]), np.array([2, 0, 1])
        back = np.array(  # the inverse of the rows, times its determinant
            [x[after] * y[last] - x[last] * y[after], y[after] - y[last], x[last] - x[after]]
        )
        if not abs(float(back[0].sum())) > _FLATTEST:
            raise ModelError(
                "the servos of the swashplate stand too nearly in one line to tilt it both ways: "
                f"{', '.join(f'{one:g}' for one in np.degrees(angle))} degrees; change "
                "swashplate.front_angle, left_angle or right_angle"
            )
        numbers = [*(sign[:, None] * rows).ravel()]
        for row, moved in zip(back, rows.T):
            whole = row / np.min(np.abs(row[np.abs(row) > _ROUNDING]))
            numbers += [*(sign * whole), whole @ moved]
        return cls(np.array(numbers))

    @classmethod
    def in_block(cls, par: NDArray[np.float64]) -> "Swashplate":
        """Return that of a vehicle's numbers, (n_param,), as in its model."""
        return cls(par[PLATE].copy())

    def mix(self, col: Any, lon: Any, lat: Any) -> tuple[Any, Any, Any]:
        """Return the front, left and right servo's position; numbers or arrays of one shape."""
        return servo.mix(self.numbers, col, lon, lat)

    def unmix(self, front: Any, left: Any, right: Any) -> tuple[Any, Any, Any]:
        """Return col, lon and lat of three servo positions; numbers or arrays of one shape."""
        return servo.unmix(self.numbers, front, left, right)


def as_it_is() -> Swashplate:
    """Return one whose front, left and right servo are col, lon and lat themselves."""
    back = np.hstack([np.eye(3), np.ones((3, 1))])
    return Swashplate(np.concatenate([np.eye(3).ravel(), back.ravel()]))


def _exact(values: NDArray[np.float64]) -> NDArray[np.float64]:
    size = np.abs(values)
    near = _EXACT[np.argmin(np.abs(_EXACT[:, None] - size), axis=0)]
    return np.where(np.abs(near - size) < _ROUNDING, np.copysign(near, values), values)


@dataclass(frozen=True)
class Flapping:
    """The tip-path plane's equation (8) at one density and rotor speed.

    tau_f: s; a_b, b_a: coupling of b into a, a into b; a_lat, a_lon: rearward tilt per unit of
    cyclic, rad; b_lat, b_lon: to the right.
    """

    tau_f: float
    a_b: float
    b_a: float
    a_lat: float
    a_lon: float
    b_lat: float
    b_lon: float

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Flapping":
        """Return a vehicle's section [flapping]."""
        return cls(**{one.name: parameters[f"flapping.{one.name}"] for one in fields(cls)})

    def to_parameters(self) -> dict[str, float]:
        """Return them as the section [flapping], by dotted names."""
        return {f"flapping.{name}": value for name, value in asdict(self).items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class TipPathPlane:
    """The parts of the tip-path plane's equation; rows and columns of matrices: a, b.

    share: a sixteenth of the Lock number; springs: over the air's moments, (2, 2); cyclic:
    swashplate's tilt, rad a unit, (2, 2), columns lat, lon.
    """

    share: float
    springs: NDArray[np.float64]
    cyclic: NDArray[np.float64]

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "TipPathPlane":
        """Return the disc of a vehicle's section [flapping]; ModelError if no blade has it."""
        speed, direction = parameters["main_rotor.speed"], parameters["main_rotor.direction"]
        flapping = Flapping.of(parameters)
        tau, mean = flapping.tau_f, 0.5 * direction * (flapping.b_a - flapping.a_b)
        if not tau * speed + mean > 0.0:
            raise ModelError(
                f"no blade has flapping.tau_f = {tau:g} s with a_b = {flapping.a_b:g} and "
                f"b_a = {flapping.b_a:g} at {speed:g} rad/s: the couplings' signs are those of a "
                "rotor that turns the other way"
            )
        with _in_proportion():
            if not max(map(abs, (speed, 1.0 / (tau * speed), *astuple(flapping)))) < _MOST:
                raise FloatingPointError
            share = 1.0 / (tau * speed + mean)
            turn = _turn(share, direction) / (share * speed * tau)
            return cls(
                share=share,
                springs=np.eye(2) + turn @ [[-1.0, flapping.a_b], [flapping.b_a, -1.0]],
                cyclic=turn @ [[flapping.a_lat, flapping.a_lon], [flapping.b_lat, flapping.b_lon]],
            )

    def flapping(self, *, speed: float, direction: float) -> Flapping:
        """Return eq. (8) at a speed, rad/s, tau_f the axes' mean; ModelError if not held."""
        with _in_proportion():
            back = np.linalg.inv(_turn(self.share, direction)) * self.share * speed
            rates = back @ (self.springs - np.eye(2))
            held = -0.5 * float(np.trace(rates))
            if not held > 1.0 / _MOST:
                raise ModelError("springs of the wrong sign leave nothing that holds the disc")
            tau = 1.0 / held
            couplings = tau * rates[0, 1], tau * rates[1, 0]
            cyclic = (tau * back @ self.cyclic).ravel()
        return Flapping(*map(float, (tau, *couplings, *cyclic)))


_MOST = 1e9  # above any flapping number, SI; its inverse is below any


@contextmanager
def _in_proportion() -> Iterator[None]:
    try:
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            yield
    except (ArithmeticError, np.linalg.LinAlgError):
        raise ModelError(
            "the blades' numbers are out of all proportion: look at air.density, [flapping] and "
            "at the main rotor's speed, radius, chord, lift_slope and blade_inertia"
        ) from None


def flapping_from_blade(
    *,
    lock_number: float,
    speed: float,
    direction: float,
    lon_range: float,
    lat_range: float,
    flap_frequency: float = 1.0,
    pitch_flap: float = 0.0,
) -> Flapping:
    """Return the section [flapping] of a known blade; InputError on numbers that no rotor has.

    `main_rotor.hub_stiffness` is then blades / 2 x inertia x speed^2 x (flap_frequency^2 - 1).

    lock_number: density x lift slope x chord x radius^4 / flapping inertia; over `lock_reduction`
    for quasi-steady inflow that answers flapping. speed: of the rotor, rad/s. direction: 1 for
    blades that turn clockwise seen from above, -1 for others. lon_range, lat_range: tilt back and
    to the right for one unit of cyclic, rad. flap_frequency: nu over the rotor's: 1 teetering,
    sqrt(1 + 1.5 e / (1 - e)) with hinges at e radii, near 1.1 without hinges. pitch_flap: tangent
    of delta-3: pitch taken away for a radian of flapping.
    """
    sizes = 0.0 < lock_number < math.inf and 0.0 < speed < math.inf
    if not (sizes and abs(direction) == 1.0 and 1.0 <= flap_frequency < 2.0):
        raise InputError(
            "a rotor has a positive lock_number and speed, a direction of 1 or -1 and a "
            "flap_frequency from 1, of a teetering rotor, to below 2; got "
            f"{lock_number:g}, {speed:g}, {direction:g} and {flap_frequency:g}"
        )
    stiffness = direction * ((flap_frequency**2 - 1.0) * 8.0 / lock_number + pitch_flap)
    return TipPathPlane(
        share=lock_number / 16.0,
        springs=np.array([[0.0, -stiffness], [stiffness, 0.0]]),
        cyclic=np.array([[0.0, 1.0], [1.0, 0.0]]) * [lat_range, lon_range],
    ).flapping(speed=speed, direction=direction)


def lock_reduction(lift_slope: float, solidity: float, inflow: float) -> float:
    """Return the reduction of Lock's number by quasi-steady inflow, 1 + a sigma / (16 lambda).

    In hover (Curtiss and Shupe, 1971; Padfield, ch. 3). lift_slope: 1/rad; inflow: lambda.
    """
    return 1.0 + lift_slope * solidity / (16.0 * inflow)


def _turn(share: float, direction: float) -> NDArray[np.float64]:
    """Return the matrix at the rates: how the air of a tilting disc couples the axes, (2, 2)."""
    cross = direction * share
    return np.array([[1.0, cross], [-cross, 1.0]])


INERTIA = "main_rotor.blade_inertia"
TIME_CONSTANT = "flapping.tau_f"
REDUCTION = "flapping.lock_reduction"

INSTEAD = {TIME_CONSTANT: (INERTIA,)}  # needed parameter -> others that may be given in its place

_FELT = (
    "air.density",
    "main_rotor.lift_slope",
    "main_rotor.chord",
    "main_rotor.radius",
    "main_rotor.speed",
    REDUCTION,
    INERTIA,
)
"""Parameters that change what the blade's springs and inertia make of [flapping]."""
_SAME = 1e-6  # relative difference up to which both agree
_FOLLOWS = "follows from "
_MOVED = "of the same blade, in other air or at another speed"
_LEAST_INFLOW = 0.01  # inflow ratio of the lightest disc, where the collective's centre is no hover


def with_both(parameters: Parameters) -> Parameters:
    """Return the parameters with blade inertia, time constant and reduction of the Lock number.

    ModelError where one of the parameters is impossible, or where these contradict.
    """
    check_values(parameters)
    entries = parameters.entries()

    def add(name: str, value: float, unit: str, causes: str) -> None:
        entries[name] = PhysicalParameter(name, value, unit, f"{_FOLLOWS}{causes}")

    with _in_proportion():
        if REDUCTION not in entries:
            causes = "lift slope, solidity and the collective's centre"
            add(REDUCTION, _reduction(parameters), "1", causes)
        known = Parameters(entries)
        if TIME_CONSTANT not in entries:
            add(TIME_CONSTANT, _time_constant(known), "s", INERTIA)
            return Parameters(entries)
        inertia = _grip(known) / (16.0 * TipPathPlane.of(known).share)
        if INERTIA not in entries:
            add(INERTIA, inertia, "kg m^2", TIME_CONSTANT)
        elif not abs(entries[INERTIA].value / inertia - 1.0) < _SAME:
            raise ModelError(
                f"{INERTIA} = {entries[INERTIA].value:g} kg m^2 and {TIME_CONSTANT} = "
                f"{entries[TIME_CONSTANT].value:g} s contradict: with this time constant it is "
                f"{inertia:g} kg m^2; give one of both"
            )
    return Parameters(entries)


def stated(parameters: Parameters) -> Parameters:
    """Return the parameters without what follows from others by `with_both`."""
    return Parameters(
        {
            name: one
            for name, one in parameters.entries().items()
            if not one.source.startswith(_FOLLOWS)
        }
    )


def changed(parameters: Parameters, changes: Mapping[str, float | str]) -> Parameters:
    """Return the parameters with some replaced, and the rest of [flapping] for the same blade.

    A new time constant is that of another blade inertia; ModelError if both contradict.
    """
    new = parameters.replace(changes)
    check_values(new)
    entries = new.entries()
    if any(name in changes for name in _FELT):
        with _in_proportion():
            slower = parameters["main_rotor.speed"] / new["main_rotor.speed"]
            lighter = parameters[INERTIA] / new[INERTIA]
            air = _grip(new) / _grip(parameters) * lighter  # ratio of Lock numbers
            spring = slower * slower * lighter
            there = TipPathPlane.of(parameters)
            moved = TipPathPlane(
                share=air * there.share,
                springs=there.springs * (spring / air),
                cyclic=there.cyclic,
            ).flapping(speed=new["main_rotor.speed"], direction=new["main_rotor.direction"])
        for name, value in moved.to_parameters().items():
            if name not in changes:
                entries[name] = PhysicalParameter(name, value, entries[name].unit, _MOVED)
    if INERTIA not in changes:
        del entries[INERTIA]
    return with_both(Parameters(entries))


def lock_number(parameters: Mapping[str, float]) -> float:
    """Return the blades' own Lock number, of parameters that have their inertia."""
    return parameters[REDUCTION] * (_grip(parameters) / parameters[INERTIA])


def _grip(parameters: Mapping[str, float]) -> float:
    """Return density x lift slope x chord x radius^4 over the reduction, kg m^2."""
    air = parameters["air.density"] * parameters["main_rotor.lift_slope"]
    square = parameters["main_rotor.radius"] * parameters["main_rotor.radius"]
    found = air * (parameters["main_rotor.chord"] * square * square) / parameters[REDUCTION]
    if not _MOST**-2 < found < _MOST**2:
        raise FloatingPointError
    return found


def _time_constant(parameters: Mapping[str, float]) -> float:
    speed, direction = parameters["main_rotor.speed"], parameters["main_rotor.direction"]
    mean = 0.5 * direction * (parameters["flapping.b_a"] - parameters["flapping.a_b"])
    found = (16.0 / (_grip(parameters) / parameters[INERTIA]) - mean) / speed
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
