"""A pilot's gains on another control law: the loops that they make on the vehicle's own gyro."""

import warnings
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import ModelError
from helisim.physics.layout import PARAM
from helisim.records.record import IN2
from helisim.vehicle import Vehicle
from helisim.vehicle.addresses import addresses
from helisim.vehicle.controller import GYRO
from helisim.vehicle.linearize import Linearization

MOTIONS = ("w", "theta", "phi", "psi")
"""The motion that each of the sticks COL, LON, LAT and PED holds, body axes."""
_CYCLIC = np.array([False, True, True, False])
_SLOWEST = 0.1  # rad/s, at which loops are compared at least
_SHARES = (1.0, 1e-3)  # of the attitude's feedback, tried in turn: all, and next to nothing
_ALIKE = 0.01  # of a gain: a law that asks for no more change is taken as the gyro
_GROWTH = 0.05  # 1/s, of motion with the pilot, at most: half of the slowest loop's crossover


def on_law(
    vehicle: Vehicle, sticks: tuple[float, ...], velocity: float, position: float, height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return gains of COL, LON, LAT and PED on the law that flies a vehicle, (4,) each.

    The first are of the motion wanted, the second of the motion itself, unitised over `MOTIONS`,
    SI, as are `sticks` on the vehicle's own gyro. velocity: attitude wanted over m/s; position and
    height: velocity wanted over m, 1/s. Each stick's loop keeps its gain at its crossover, and the
    closed loop of the attitude that at the velocity's. Warns, and returns `sticks`, if the vehicle
    would diverge or the law can't be linearised.
    """
    if vehicle.controller.laws:
        try:
            return _scaled(vehicle, sticks, velocity, position, height)
        except ModelError as error:
            if not hasattr(error, "__notes__"):  # a law that raises ends the flight, which says so
                warnings.warn(
                    f"controller {vehicle.controller.name!r}: {error}; the pilot keeps the gains "
                    f"that suit the gyro of {vehicle.name}: change the law, or [pilot]",
                    stacklevel=3,
                )
    return np.array(sticks), np.array(sticks)


@lru_cache(maxsize=8)
def _scaled(
    vehicle: Vehicle, sticks: tuple[float, ...], velocity: float, position: float, height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    own, law = (one.linearize("IN2") for one in (vehicle.with_controller(GYRO), vehicle))
    par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]
    given, grows = np.array(sticks), np.inf
    rates = [
        par[PARAM.gyro_q_per_lon],
        par[PARAM.gyro_p_per_lat],
        par[PARAM.gyro_k_delta] / par[PARAM.gyro_k_a],
    ]
    at = [
        height,
        *np.abs(rates * given[1:]),
        velocity * float(np.linalg.norm(vehicle.model.opt.gravity)),
    ]
    (before, wanted), (after, reached) = (_responses(one, at) for one in (own, law))
    after, reached = (np.where(a == 0.0, b, a) for a, b in ((after, before), (reached, wanted)))
    turned = after / before  # an attitude leads its rate by up to 90 deg
    sign = np.where(turned.real + turned.imag < 0.0, -1.0, 1.0)
    for share in _SHARES:
        back = sign * given / np.abs(turned) * np.where(_CYCLIC, share, 1.0)
        closes = given * wanted / (1.0 + given * wanted) * (1.0 + back * reached) / reached
        ahead, back = (
            np.where(np.isclose(one, given, _ALIKE, 0.0), given, one)
            for one in (np.where(_CYCLIC, sign * np.abs(closes), back), back)
        )
        grows = _growth(law, ahead, back, velocity, position, height)
        if grows < _GROWTH or np.array_equal(back, given):
            return ahead, back
    raise ModelError(f"with gains scaled to it the motion grows at {grows:.2g} 1/s")


def _responses(
    system: Linearization, at: list[float]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return `MOTIONS` over their sticks, level speed held, at a frequency each, and at the last.

    at: (5,) rad/s; returns (4,) each.
    """
    moves = ~np.isin(system.states, ("u", "v"))[:, None]
    held = replace(system, a=system.a * moves, b=system.b * moves).select(IN2, MOTIONS)
    found = held.response(np.maximum(at, _SLOWEST))[range(len(IN2)), range(len(IN2))]
    return np.diagonal(found), found[:, -1]


def _growth(
    system: Linearization,
    ahead: NDArray[np.float64],
    back: NDArray[np.float64],
    velocity: float,
    position: float,
    height: float,
) -> float:
    """Return the fastest growth of a motion with the pilot, 1/s."""
    closed = system.with_delays_as_states()
    names = (*MOTIONS, "down", "u", "north", "v", "east")
    gains = np.zeros((len(IN2), len(closed.a)))
    gains[[0, 1, 2, 3, 0, 1, 1, 2, 2], [closed.states.index(name) for name in names]] = [
        *-back,
        -height * ahead[0],
        *(ahead[[1, 1, 2, 2]] * velocity * [1.0, position, -1.0, -position]),
    ]
    return float(replace(closed, a=closed.a + closed.b @ gains).poles.real.max())
