"""What a loop asks of its actuators: where their rate limit sets in, and how much they move."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.handling.curve import Curve
from helisim.handling.figures.crossings import crossings

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Onset:
    """The open loop onset point, OLOP: the broken loop where the rate limit sets in.

    Attributes:
        frequency: rad/s, the lowest at which the actuator is asked for its rate limit. Where the
            curve's whole band lies on one side, the end nearest to it.
        phase: rad from -180 deg, in [-pi, pi).
        gain: dB.
        reached: whether the limit is met within the band.
    """

    frequency: float
    phase: float
    gain: float
    reached: bool


@dataclass(frozen=True)
class ActuatorMotion:
    """How much an actuator moves.

    Attributes:
        position: rms, in the unit of the response.
        rate: rms, that a second.
    """

    position: float
    rate: float


def onset(loop: Curve, actuator: Curve, *, amplitude: float, rate_limit: float) -> Onset:
    """Return the open loop onset point of a rate limit.

    Duda, "Prediction of Pilot-in-the-Loop Oscillations Due to Rate Saturation", Journal of
    Guidance, Control, and Dynamics 20 (3), 1997: an input of the greatest amplitude, at rising
    frequency, until the actuator is asked for its greatest rate; there, the loop broken at the
    actuator.

    Args:
        loop: broken at the actuator.
        actuator: its command over the input, the rate limit left out, at the same frequencies.
        amplitude: of the input.
        rate_limit: of the actuator, in units of its command a second.
    """
    own = actuator.frequency
    excess = actuator.decibel + 20.0 * np.log10(own * amplitude / rate_limit)
    found = crossings(own, excess)
    rises = found.frequency[found.rising]
    if excess[0] > 0.0:
        where, reached = float(own[0]), True
    elif rises.size:
        where, reached = float(rises[0]), True
    else:
        where, reached = float(own[int(np.argmax(excess))]), False
    there = loop.at(min(max(where, loop.frequency[0]), loop.frequency[-1]))[0]
    gain = 20.0 * np.log10(abs(there))
    return Onset(where, float(np.angle(-there)), float(gain), reached)


def limited(excess: Real) -> NDArray[np.complex128]:
    """Return the describing function of a rate limit met by a sine, for the first harmonic.

    Exact from x = 1.862 on, where the output is a triangle: 4 / (pi x), behind by
    acos(pi / (2 x)). Between 1 and 1.862 cubics fitted to it: Gilbreath, "Prediction of Pilot-
    Induced Oscillations (PIO) Due to Actuator Rate Limiting Using the Open-Loop Onset Point
    (OLOP) Criterion", AFIT/GAE/ENY/01M-02, 2001, after Duda.

    Args:
        excess: (n_freq,) x, the rate that is asked for over the limit, 0 and more.

    Returns:
        (n_freq,) output over input, 1 up to x = 1.
    """
    x = np.asarray(excess, dtype=np.float64)
    size = np.polyval((0.2908, -1.4396, 1.9232, 0.2230), x)
    phase = np.polyval((0.5280, -2.6213, 3.5056, -1.4171), x)
    far = np.maximum(x, _TRIANGLE)
    size = np.where(x < _TRIANGLE, size, 4.0 / (np.pi * far))
    phase = np.where(x < _TRIANGLE, phase, -np.arccos(np.pi / (2.0 * far)))
    return np.where(x < 1.0, 1.0, size * np.exp(1j * phase)).astype(np.complex128)


_TRIANGLE = 1.862


def motion(actuator: Curve, spectrum: Real) -> ActuatorMotion:
    """Return the rms of an actuator's position and rate in noise.

    Args:
        actuator: its command over a disturbance.
        spectrum: (n_freq,) one-sided power spectral density of the disturbance at the curve's
            frequencies, its unit squared a rad/s; its integral over them is the variance.
    """
    power = np.abs(actuator.response) ** 2 * spectrum
    own = actuator.frequency
    return ActuatorMotion(
        float(np.sqrt(np.trapezoid(power, own))),
        float(np.sqrt(np.trapezoid(power * own**2, own))),
    )


def coloured(frequency: Real, *, rms: float, corner: float) -> Real:
    """Return the spectrum of white noise behind two equal lags, (n_freq,); see `motion`.

    An attitude with it has a rate of rms times corner.

    Args:
        frequency: (n_freq,) rad/s.
        rms: of all frequencies together.
        corner: of the lags, rad/s.
    """
    return 4.0 * rms**2 / (np.pi * corner) / (1.0 + (frequency / corner) ** 2) ** 2
