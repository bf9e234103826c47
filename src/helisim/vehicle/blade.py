"""From a blade to the tip-path plane's equation, and back.

A rigid blade's flapping, averaged over a turn, is a tip-path plane that lags (first order in its
rates; Heffley and Mnich, NASA CR 177476, section 2, with the hinge offset in the spring). With
s = 1 for blades that turn clockwise seen from above and -1 for others,

    tau (da/dt + q) = -(a - a_t) + K_aa a + K_ab b - s eps tau (db/dt + p - p_air)
    tau (db/dt + p) = -(b - b_t) + K_ba a + K_bb b + s eps tau (da/dt + q - q_air)

where eps = gamma / 16, tau = 1 / (eps Omega) = 16 / (gamma Omega), and K is the blades' springs
over the air's: for a hub that is the same all around K_ba = -K_ab = s (nu^2 - 1) 8 / gamma. Solved
for the rates it is Wu and Chen's eq. (8) with effective numbers, the section [flapping]. Density
and rotor speed change those; the blade, its springs and the swashplate stay.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, ModelError
from helisim.base.value import Value

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
    """What the tip-path plane's equation is made of: blade, springs and swashplate.

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

        Args:
            flapping: eq. (8).
            speed: of the rotor, rad/s.
            direction: 1 for blades that turn clockwise seen from above, -1 for others.

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

    Args:
        lift_slope: a, 1/rad.
        solidity: sigma.
        inflow: lambda, in hover.
    """
    return 1.0 + lift_slope * solidity / (16.0 * inflow)


def _turn(share: float, direction: float) -> NDArray[np.float64]:
    """Return the matrix at the rates: how the air of a tilting disc couples the axes, (2, 2)."""
    cross = direction * share
    return np.array([[1.0, cross], [-cross, 1.0]])
