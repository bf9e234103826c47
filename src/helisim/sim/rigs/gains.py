"""Gains of a proportional-integral loop from one record of its input and output.

Reads a record and nothing else: the log of a real ground test does as well.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import InputError, RecordError
from helisim.records.record import FlightRecord

_Complex = NDArray[np.complexfloating[Any, Any]]

_LONGEST_DELAY = 0.1
"""s, searched on both sides: beyond any gyro's latency and any recorder's."""

_TYPICAL = (0.01, 0.01, 0.003)
"""s: the scales of delay, lead and its filter in the search."""


@dataclass(frozen=True, kw_only=True)
class LoopGains:
    """output = (proportional + integral/s) (1 + lead s/(1 + filter s)) e^(-delay s) input.

    The standard errors are those of white noise; the resolution of a recorded servo, which is
    not white, adds up to half a percent of the proportional part on the bench.

    Attributes:
        proportional: in units of output over input.
        integral: the same, 1/s.
        lead: s; 0 where it was not asked for.
        lead_filter: s; the given one where it was held.
        delay: s, from the input's record to the output's; negative where the input's is late.
        proportional_error: standard error.
        integral_error: standard error.
        lead_error: standard error.
        lead_filter_error: standard error; 0 where it was held.
        delay_error: standard error.
    """

    proportional: float
    integral: float
    lead: float
    lead_filter: float
    delay: float
    proportional_error: float
    integral_error: float
    lead_error: float
    lead_filter_error: float
    delay_error: float

    @property
    def ratio(self) -> float:
        """Integral over proportional, 1/s: free of every gain outside the controller."""
        return self.integral / self.proportional


def loop_gains(
    record: FlightRecord,
    *,
    input: str,
    output: str,
    band: tuple[float, float],
    noisy: Literal["input", "output"],
    lead: bool = False,
    lead_filter: float | None = None,
) -> LoopGains:
    """Identify a proportional-integral loop from a record that starts and ends at rest.

    Least squares on the Fourier transforms of the recorded differences, which begin and end
    at zero, so nothing leaks; the residual is taken where the noise is, so that it does not
    lower the gains as it would in a regression on a noisy input.

    Args:
        record: of the test.
        input: channel that drives the loop.
        output: channel that the loop drives.
        band: rad/s, what the test excites.
        noisy: which of the two channels carries the sensor noise.
        lead: True looks for a lead too, and for its filter.
        lead_filter: s, holds the filter of a lead that is looked for.

    Raises:
        InputError: the band is empty or above what the record resolves.
        RecordError: a channel does not move.
    """
    if noisy not in ("input", "output"):
        raise InputError(f"noisy must be 'input' or 'output', got {noisy!r}")
    step = record.sample_time
    frequency = 2.0 * np.pi * np.fft.rfftfreq(len(record) - 1, step)
    used = (frequency >= band[0]) & (frequency <= band[1]) & (frequency > 0.0)
    if np.count_nonzero(used) < 8 or band[1] > np.pi / step:
        raise InputError(
            f"a record of {record.duration:.3g} s at {step:.3g} s resolves less than 8 "
            f"frequencies in {band} rad/s"
        )
    omega: NDArray[np.float64] = np.asarray(frequency[used], dtype=np.float64)
    spectra = [_spectrum(record, name, step, omega, used) for name in (input, output)]
    drive, driven = spectra
    has_lead = lead or lead_filter is not None

    def miss(x: NDArray[np.float64]) -> NDArray[np.float64]:
        response = _response(x, omega)
        gap = driven - response * drive if noisy == "output" else drive - driven / response
        return np.concatenate([gap.real, gap.imag])

    start = _start(drive, driven, omega)
    scale = np.array([start[0], start[1], *_TYPICAL])
    free = np.array([True, True, True, has_lead, has_lead and lead_filter is None])

    def all_five(unknown: NDArray[np.float64], held: float = 0.0) -> NDArray[np.float64]:
        x = np.array([0.0, 0.0, 0.0, 0.0, held])
        x[free] = unknown * scale[free]
        return x

    first = (start / scale)[free]
    first[3:] = 1.0
    held = lead_filter or 0.0
    best = least_squares(
        lambda unknown: miss(all_five(unknown, held)),
        first,
        # a lead below zero has the gain of one above it: a second, false minimum
        bounds=([-np.inf, -np.inf, -np.inf, 0.0, 0.0][: len(first)], np.inf),
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    variance = 2.0 * best.cost / (best.fun.size - len(first))
    jacobian = np.asarray(best.jac)
    spread = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)) * variance)
    values, errors = all_five(best.x, held), np.abs(all_five(spread))
    return LoopGains(
        proportional=float(values[0]),
        integral=float(values[1]),
        delay=float(values[2]),
        lead=float(values[3]),
        lead_filter=float(values[4]),
        proportional_error=float(errors[0]),
        integral_error=float(errors[1]),
        delay_error=float(errors[2]),
        lead_error=float(errors[3]),
        lead_filter_error=float(errors[4]),
    )


def _spectrum(
    record: FlightRecord,
    name: str,
    step: float,
    omega: NDArray[np.float64],
    used: NDArray[np.bool_],
) -> _Complex:
    signal = record[name]
    if np.ptp(signal) == 0.0:
        raise RecordError(f"channel {name!r} does not move in this record")
    return np.fft.rfft(np.diff(signal))[used] / (1.0 - np.exp(-1j * omega * step))


def _response(x: NDArray[np.float64], omega: NDArray[np.float64]) -> _Complex:
    s = 1j * omega
    proportional, integral, delay, lead, lead_filter = x
    led = 1.0 + lead * s / (1.0 + lead_filter * s)
    return (proportional + integral / s) * led * np.exp(-s * delay)


def _start(drive: _Complex, driven: _Complex, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return gains without lead by linear least squares at the best of many delays."""
    best, lowest = np.zeros(5), np.inf
    for delay in np.linspace(-_LONGEST_DELAY, _LONGEST_DELAY, 81):
        late = drive * np.exp(-1j * omega * delay)
        columns = np.column_stack([late, late / (1j * omega)]).astype(np.complex128)
        stacked = np.concatenate([columns.real, columns.imag])
        target = np.concatenate([driven.real, driven.imag])
        gains, *_ = np.linalg.lstsq(stacked, target, rcond=None)
        left = float(np.sum((stacked @ gains - target) ** 2))
        if left < lowest:
            best, lowest = np.array([gains[0], gains[1], delay, 0.0, 0.0]), left
    return best
