"""Places of a vehicle's three servos under its swashplate, and how they share its motion (CCPM).

A servo whose ball link stands at an angle from the nose, towards the left, and at an arm of the
unit in which cyclic is counted, moves by col + arm (cos(angle) lon + sin(angle) lat), or by as
much the other way where it is reversed.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError
from helisim.base.settings import Value
from helisim.physics import gyro as servo
from helisim.physics.layout import PARAM
from helisim.vehicle.parameters import Parameters, PhysicalParameter

SERVOS = ("front", "left", "right")
"""The three in the order of the actuators. "front" is the elevator's servo, wherever it stands."""

_PLATE = slice(PARAM.mix_front_col, PARAM.unmix_lat_over + 1)
_EXACT = np.array([0.0, 0.5, np.sqrt(0.5), 0.5 * np.sqrt(3.0), 1.0])
"""Sines and cosines of whole multiples of 30 and 45 degrees, which rounding would miss."""
_ROUNDING = 1e-12
_FLATTEST = 1e-3
"""Area that the three span, of arms of 1, below which a degree of tilt asks for all travel."""


@dataclass(frozen=True, eq=False)
class Swashplate:
    """The mixing of three servos under one swashplate.

    Attributes:
        numbers: (21,) as the compiled force laws read them, from `PARAM.mix_front_col` on.
    """

    numbers: NDArray[np.float64]

    def __post_init__(self) -> None:
        numbers = np.array(self.numbers, dtype=np.float64)
        numbers.setflags(write=False)
        object.__setattr__(self, "numbers", numbers)

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "Swashplate":
        """Return a vehicle's, by its parameters `swashplate.front_angle` and so on.

        Raises:
            ModelError: an arm or a sign is none, or the servos can't tilt the swashplate.
        """
        rows = np.array([_row(parameters, name) for name in SERVOS])
        signs = np.array([parameters[f"swashplate.{name}_sign"] for name in SERVOS])
        back = _adjugate(rows)
        area = float(back[0].sum())
        if not abs(area) > _FLATTEST:
            degrees = [np.degrees(parameters[f"swashplate.{name}_angle"]) for name in SERVOS]
            raise ModelError(
                "the servos of the swashplate stand too nearly in one line to tilt it both ways: "
                f"{', '.join(f'{angle:g}' for angle in degrees)} degrees; change "
                "swashplate.front_angle, left_angle or right_angle"
            )
        numbers = [*(signs[:, None] * rows).ravel()]
        for row, moved in zip(back, rows.T):
            whole = row / np.min(np.abs(row[np.abs(row) > _ROUNDING]))
            numbers += [*(signs * whole), whole @ moved]
        return cls(np.array(numbers))

    @classmethod
    def in_block(cls, par: NDArray[np.float64]) -> "Swashplate":
        """Return that of a vehicle's numbers, (n_param,), as in its model."""
        return cls(par[_PLATE])

    def write(self, par: NDArray[np.float64]) -> None:
        """Put it into a vehicle's numbers, (n_param,)."""
        par[_PLATE] = self.numbers

    def mix(self, col: Any, lon: Any, lat: Any) -> tuple[Any, Any, Any]:
        """Return the front, left and right servo's position; numbers or arrays of one shape."""
        return servo.mix(self.numbers, col, lon, lat)

    def unmix(self, front: Any, left: Any, right: Any) -> tuple[Any, Any, Any]:
        """Return col, lon and lat of three servo positions; numbers or arrays of one shape."""
        return servo.unmix(self.numbers, front, left, right)

    def least_travel(self, cyclic: float) -> float:
        """Return the least that some servo is away from its middle at this much lon or lat."""
        columns = np.array(self.unmix(*np.eye(3)))[1:]
        return cyclic / float(np.abs(columns).sum(axis=1).max())


def as_it_is() -> Swashplate:
    """Return one whose front, left and right servo are col, lon and lat themselves."""
    back = np.hstack([np.eye(3), np.ones((3, 1))])
    return Swashplate(np.concatenate([np.eye(3).ravel(), back.ravel()]))


def _row(parameters: Mapping[str, float], name: str) -> list[float]:
    arm = parameters[f"swashplate.{name}_arm"]
    if not arm > 0.0:
        raise ModelError(f"swashplate.{name}_arm must be positive, got {arm:g}")
    sign = parameters[f"swashplate.{name}_sign"]
    if sign not in (-1.0, 1.0):
        raise ModelError(
            f"swashplate.{name}_sign must be 1, or -1 for a reversed servo, got {sign:g}"
        )
    angle = parameters[f"swashplate.{name}_angle"]
    return [1.0, arm * _exact(np.cos(angle)), arm * _exact(np.sin(angle))]


def _exact(value: float) -> float:
    near = _EXACT[int(np.argmin(np.abs(_EXACT - abs(value))))]
    return float(np.copysign(near, value)) if abs(near - abs(value)) < _ROUNDING else float(value)


def _adjugate(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of rows (1, x, y), (3, 3), times its determinant."""
    _, x, y = rows.T
    after, last = np.array([1, 2, 0]), np.array([2, 0, 1])
    return np.array(
        [x[after] * y[last] - x[last] * y[after], y[after] - y[last], x[last] - x[after]]
    )


FLAPPING = ("tau_f", "a_b", "b_a", "a_lat", "a_lon", "b_lat", "b_lon")
"""The numbers of eq. (8), in the order of the section [flapping]."""

_GREATEST = 1e9
"""Beyond any number of a rotor's flapping, in SI; its inverse is below any that can't be 0."""


@dataclass(frozen=True, kw_only=True)
class Flapping:
    """The tip-path plane's equation (8) at one density and rotor speed.

    Attributes:
        tau_f: time constant, s.
        a_b: coupling of b into a.
        b_a: coupling of a into b.
        a_lat: rearward tilt for one unit of lateral cyclic, rad.
        a_lon: for one of longitudinal cyclic, rad.
        b_lat: tilt to the right for one unit of lateral cyclic, rad.
        b_lon: for one of longitudinal cyclic, rad.
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
        """Return what the section [flapping] of a vehicle's parameters says."""
        return cls(**{name: parameters[f"flapping.{name}"] for name in FLAPPING})

    def to_parameters(self) -> dict[str, float]:
        """Return them as the section [flapping], by dotted names."""
        return {f"flapping.{name}": value for name, value in asdict(self).items()}


@dataclass(frozen=True, eq=False, kw_only=True)
class TipPathPlane(Value):
    """The parts of the tip-path plane's equation: blade, springs and swashplate.

    Attributes:
        share: eps, a sixteenth of the Lock number: how much the air holds the disc in a radian of
            rotation.
        springs: K, moments of springs and stops over those of the air for the same tilt, (2, 2):
            rows and columns a, b.
        cyclic: tilt against the shaft that the swashplate asks for, rad a unit, (2, 2): rows a, b,
            columns lat, lon.
    """

    share: float
    springs: NDArray[np.float64]
    cyclic: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("springs", "cyclic"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def _compared(self) -> tuple[Any, ...]:
        return self.share, self.springs, self.cyclic

    @classmethod
    def behind(cls, flapping: Flapping, *, speed: float, direction: float) -> "TipPathPlane":
        """Return what lies behind an equation (8) that was found at a rotor speed.

        Eq. (8) has seven numbers and one time constant for both axes. Couplings that differ in
        size, as identified ones do, come from springs that are not the same all around; of these
        the mean belongs to the air.

        flapping: eq. (8); speed: of the rotor, rad/s; direction: 1 for blades that turn clockwise
        seen from above, -1 for others.

        Raises:
            ModelError: no blade has this equation.
        """
        tau, mean = flapping.tau_f, 0.5 * direction * (flapping.b_a - flapping.a_b)
        for name, value in (*flapping.to_parameters().items(), ("main_rotor.speed", speed)):
            if abs(value) > _GREATEST or not tau * speed > 1.0 / _GREATEST:
                raise ModelError(f"{name} = {value:g} is out of all proportion")
        if not tau * speed + mean > 0.0:
            raise ModelError(
                f"no blade has flapping.tau_f = {tau:g} s with a_b = {flapping.a_b:g} and "
                f"b_a = {flapping.b_a:g} at {speed:g} rad/s: the couplings' signs are those of a "
                "rotor that turns the other way"
            )
        share = 1.0 / (tau * speed + mean)
        turn = _turn(share, direction) / (share * speed * tau)
        return cls(
            share=share,
            springs=np.eye(2) + turn @ [[-1.0, flapping.a_b], [flapping.b_a, -1.0]],
            cyclic=turn @ [[flapping.a_lat, flapping.a_lon], [flapping.b_lat, flapping.b_lon]],
        )

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "TipPathPlane":
        """Return what lies behind the section [flapping] of a vehicle's parameters.

        Raises:
            ModelError: no blade has these numbers.
        """
        return cls.behind(
            Flapping.of(parameters),
            speed=parameters["main_rotor.speed"],
            direction=parameters["main_rotor.direction"],
        )

    def flapping(self, *, speed: float, direction: float) -> Flapping:
        """Return eq. (8) of this disc at a rotor speed, rad/s; `direction` as in `behind`.

        Its one time constant is the mean of both axes'.

        Raises:
            ModelError: nothing holds the disc.
        """
        back = np.linalg.inv(_turn(self.share, direction)) * self.share * speed
        rates = back @ (self.springs - np.eye(2))
        held = -0.5 * float(np.trace(rates))
        if not held > 1.0 / _GREATEST:
            raise ModelError("springs of the wrong sign leave nothing that holds the disc")
        tau = 1.0 / held
        cyclic = tau * back @ self.cyclic
        return Flapping(
            tau_f=tau,
            a_b=float(tau * rates[0, 1]),
            b_a=float(tau * rates[1, 0]),
            a_lat=float(cyclic[0, 0]),
            a_lon=float(cyclic[0, 1]),
            b_lat=float(cyclic[1, 0]),
            b_lon=float(cyclic[1, 1]),
        )

    def scaled(self, *, air: float = 1.0, spring: float = 1.0) -> "TipPathPlane":
        """Return it where the air's moments, or the springs', are so many times those of inertia.

        Args:
            air: ratio of Lock numbers, as of densities.
            spring: ratio of spring stiffness over inertia and square of rotor speed.

        Raises:
            ModelError: they are none that one rotor can have.
        """
        if not all(1.0 / _GREATEST < ratio < _GREATEST for ratio in (air, spring)):
            raise ModelError(
                f"a Lock number {air:.3g} times and springs {spring:.3g} times the rotor's are out "
                "of all proportion: look at air.density and at the main rotor's speed, radius, "
                "chord, lift_slope and blade_inertia"
            )
        springs = self.springs * (spring / air)
        return TipPathPlane(share=air * self.share, springs=springs, cyclic=self.cyclic)


def flapping_from_blade(
    *,
    lock_number: float,
    speed: float,
    direction: float,
    lon_range: float,
    lat_range: float,
    flap_frequency: float = 1.0,
    pitch_flap: float = 0.0,
    phase: float = 0.0,
) -> Flapping:
    """Return the section [flapping] of a helicopter whose blades are known: tau_f, A_b and so on.

    `Flapping.to_parameters` gives it as parameters. The hub's stiffness,
    `main_rotor.hub_stiffness`, goes with the same flap frequency: blades / 2 x inertia x speed^2 x
    (flap_frequency^2 - 1).

    Args:
        lock_number: gamma = density x lift slope x chord x radius^4 / flapping inertia; divide it
            by `lock_reduction` where quasi-steady inflow is to answer the blades' flapping.
        speed: of the rotor, rad/s.
        direction: 1 for blades that turn clockwise seen from above, -1 for others.
        lon_range: tilt back against the shaft for one unit of longitudinal cyclic, rad: the
            blades' cyclic pitch at 0 phase.
        lat_range: tilt to the right for one unit of lateral cyclic, rad.
        flap_frequency: nu, natural frequency of flapping over the rotor's: 1 for a teetering
            rotor, sqrt(1 + 1.5 e / (1 - e)) with hinges at e radii, near 1.1 without hinges.
        pitch_flap: tangent of delta-3: pitch taken away for a radian of flapping.
        phase: by how much the swashplate turns the cyclic tilt from lon and lat, rad: of the
            disc seen from above, in the sense of rotation.

    Raises:
        InputError: a number that no rotor has.
    """
    for name, value in (("lock_number", lock_number), ("speed", speed)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name} must be a positive number, got {value:g}")
    if direction not in (-1.0, 1.0):
        raise InputError(f"direction must be 1 or -1, got {direction:g}")
    if not 1.0 <= flap_frequency < 2.0:
        raise InputError(
            f"flap_frequency must be 1, of a teetering rotor, or more, below 2; got "
            f"{flap_frequency:g}"
        )
    stiffness = direction * ((flap_frequency**2 - 1.0) * 8.0 / lock_number + pitch_flap)
    cosine, sine = math.cos(phase), direction * math.sin(phase)
    disc = TipPathPlane(
        share=lock_number / 16.0,
        springs=np.array([[0.0, -stiffness], [stiffness, 0.0]]),
        cyclic=np.array([[sine, cosine], [cosine, -sine]]) * [lat_range, lon_range],
    )
    return disc.flapping(speed=speed, direction=direction)


def lock_reduction(lift_slope: float, solidity: float, inflow: float) -> float:
    """Return by how much inflow that follows the blades' flapping at once reduces Lock's number.

    1 + a sigma / (16 lambda) in hover (Curtiss and Shupe, 1971; Padfield, Helicopter Flight
    Dynamics, ch. 3): tilting blades blow the air that would hold them.

    lift_slope: a, 1/rad; solidity: sigma; inflow: lambda, in hover.
    """
    return 1.0 + lift_slope * solidity / (16.0 * inflow)


def _turn(share: float, direction: float) -> NDArray[np.float64]:
    """Return the matrix at the rates: how the air of a tilting disc couples the axes, (2, 2)."""
    cross = direction * share
    return np.array([[1.0, cross], [-cross, 1.0]])


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

    parameters: of a vehicle, all of them; changes: values or words by name.

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
