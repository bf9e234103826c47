"""Turn rates beside the rates that the slopes of the attitude angles make."""

from collections.abc import Mapping, Sequence

import numpy as np

from helisim.base.arrays import Complex, Real
from helisim.records.record import ATTITUDES, RATES, FlightRecord

ANGLES: dict[str, str] = dict(zip(RATES, ATTITUDES))


def slope_matrix(
    flights: Sequence[tuple[Mapping[str, Real] | FlightRecord, float]],
    rates: Sequence[str],
    band: tuple[float, float],
) -> tuple[Real, Real, Real]:
    """Return rates over those of the attitude's slopes, their errors, and shares, (n, n) each.

    `flights` are channels and the step between their samples, s, `band` is in rad/s. A share is how
    much of a rate's size such a slope makes, 1 if all.
    """
    measured, predicted = [], []
    for one, step in flights:
        own = np.column_stack([one[name] for name in rates])
        # both through the same filter: central differences of what the trapezoidal rule integrates
        smooth = own.copy()
        smooth[1:-1] = 0.25 * (own[:-2] + 2.0 * own[1:-1] + own[2:])
        made = _turning({name: one[name] for name in ATTITUDES if name in one}, step)
        both = np.column_stack([smooth, *(made[name] for name in rates)])[1:-1]
        omega = 2.0 * np.pi * np.fft.rfftfreq(len(both), step)
        inside = (omega >= band[0]) & (omega <= band[1])
        lines = np.fft.rfft(both - both.mean(axis=0), axis=0)[inside] / omega[inside, None]
        measured.append(lines[:, : len(rates)])
        predicted.append(lines[:, len(rates) :])
    b, a = np.concatenate(measured), np.concatenate(predicted)
    forward, error = _regressed(b, a)
    back, _ = _regressed(a, b)
    # noise in either makes its own regression too flat: the truth is between the two
    inverse = np.linalg.pinv(back)
    slope, between = 0.5 * (forward + inverse), 0.5 * np.abs(forward - inverse)
    sizes = np.linalg.norm(a, axis=0) / np.maximum(np.linalg.norm(b, axis=0), 1e-300)[:, None]
    return slope, np.hypot(error, between), np.abs(slope) * sizes


def _regressed(b: Complex, a: Complex) -> tuple[Real, Real]:
    normal = np.linalg.pinv(np.real(a.conj().T @ a))
    slope = (normal @ np.real(a.conj().T @ b)).T
    left = np.abs(b - a @ slope.T) ** 2  # larger at some lines than at others, so no common level
    weight = np.abs(a @ normal) ** 2
    return slope, np.sqrt(0.5 * left.T @ weight * len(a) / max(len(a) - a.shape[1], 1))


def _turning(angles: Mapping[str, Real], step: float) -> dict[str, Real]:
    """Return body rates by the slopes of the attitude angles; of single angles their slopes."""
    slope = {name: np.gradient(angle, step) for name, angle in angles.items()}
    if len(angles) < len(ATTITUDES):
        return {rate: slope[angle] for rate, angle in ANGLES.items() if angle in slope}
    phi, theta = angles["phi"], angles["theta"]
    return {
        "p": slope["phi"] - slope["psi"] * np.sin(theta),
        "q": slope["theta"] * np.cos(phi) + slope["psi"] * np.sin(phi) * np.cos(theta),
        "r": slope["psi"] * np.cos(phi) * np.cos(theta) - slope["theta"] * np.sin(phi),
    }
