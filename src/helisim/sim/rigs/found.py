"""What a record of a ground test tells: a loop's gains, and the centre of gravity from plumb lines.

Reads records and nothing else: the log of a real ground test does as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from helisim.base.errors import InputError, RecordError
from helisim.records.record import FlightRecord

_Complex = NDArray[np.complexfloating[Any, Any]]

_LONGEST_DELAY = 0.1  # s, searched on both sides: beyond any gyro's latency and any recorder's
_TYPICAL = (0.01, 0.01, 0.003)  # s: the scales of delay, lead and its filter in the search
REST = 10.0
"""s at the end of a hanging, in which the attitude is averaged."""
_BLOCK = 0.25
"""s: a quarter of the pendulum's period, so that a swing shows in the scatter of the means."""
_STANDARD_ERROR = 1e-3
"""rad: greatest standard error of the mean attitude. At two points a foot from the centre of
gravity it is worth 0.6 mm."""
_DRIFT = 4e-3  # rad between the halves of the rest: two standard errors of each, added


@dataclass(frozen=True, kw_only=True)
class LoopGains:
    """output = (proportional + integral/s) (1 + lead s/(1 + filter s)) e^(-delay s) input.

    The standard errors are those of white noise; the resolution of a recorded servo, which is
    not white, adds up to half a percent of the proportional part on the bench.

    Attributes:
        proportional: in units of output over input.
        integral: the same, 1/s.
        delay: s, from the input's record to the output's; negative where the input's is late.
        lead: s; 0 where it was not asked for.
        lead_filter: s; the given one where it was held.
        proportional_error: standard error.
        integral_error: standard error.
        delay_error: standard error.
        lead_error: standard error.
        lead_filter_error: standard error; 0 where it was held.
    """

    proportional: float
    integral: float
    delay: float
    lead: float
    lead_filter: float
    proportional_error: float
    integral_error: float
    delay_error: float
    lead_error: float
    lead_filter_error: float

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

    def spectrum(name: str) -> _Complex:
        if np.ptp(record[name]) == 0.0:
            raise RecordError(f"channel {name!r} does not move in this record")
        return np.fft.rfft(np.diff(record[name]))[used] / (1.0 - np.exp(-1j * omega * step))

    drive, driven = spectrum(input), spectrum(output)
    has_lead, held = lead or lead_filter is not None, lead_filter or 0.0
    start = _start(drive, driven, omega)
    scale = np.array([start[0], start[1], *_TYPICAL])
    free = np.array([True, True, True, has_lead, has_lead and lead_filter is None])

    def all_five(unknown: NDArray[np.float64], held: float = 0.0) -> NDArray[np.float64]:
        x = np.array([0.0, 0.0, 0.0, 0.0, held])
        x[free] = unknown * scale[free]
        return x

    def residual(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        response = _response(all_five(unknown, held), omega)
        gap = driven - response * drive if noisy == "output" else drive - driven / response
        return np.concatenate([gap.real, gap.imag])

    first = (start / scale)[free]
    first[3:] = 1.0
    best = least_squares(
        residual,
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
    numbers = (*all_five(best.x, held).tolist(), *np.abs(all_five(spread)).tolist())
    return LoopGains(**dict(zip(LoopGains.__dataclass_fields__, numbers)))


def _response(x: NDArray[np.float64], omega: NDArray[np.float64]) -> _Complex:
    s = 1j * omega
    proportional, integral, delay, lead, lead_filter = x
    led = 1.0 + lead * s / (1.0 + lead_filter * s)
    return (proportional + integral / s) * led * np.exp(-s * delay)


def _start(drive: _Complex, driven: _Complex, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return gains without lead by linear least squares at the best of many delays."""
    best, lowest = np.zeros(5), np.inf
    target = np.concatenate([driven.real, driven.imag])
    for delay in np.linspace(-_LONGEST_DELAY, _LONGEST_DELAY, 81):
        delayed = drive * np.exp(-1j * omega * delay)
        columns = np.column_stack([delayed, delayed / (1j * omega)]).astype(np.complex128)
        stacked = np.concatenate([columns.real, columns.imag])
        gains, *_ = np.linalg.lstsq(stacked, target, rcond=None)
        residual = float(np.sum((stacked @ gains - target) ** 2))
        if residual < lowest:
            best, lowest = np.array([gains[0], gains[1], delay, 0.0, 0.0]), residual
    return best


@dataclass(frozen=True, eq=False)
class PlumbLine:
    """The vertical through a suspension point, in airframe axes (FRD).

    Attributes:
        point: (3,) m, where the airframe was held.
        down: (3,) unit vector.
        error: rad, standard error of its direction, each way across.
    """

    point: NDArray[np.float64]
    down: NDArray[np.float64]
    error: float = 0.0

    def __post_init__(self) -> None:
        for name in ("point", "down"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (3,) or not np.all(np.isfinite(array)):
                raise InputError(f"{name} must be three finite numbers, got {array}")
            array.flags.writeable = False
            object.__setattr__(self, name, array)


def plumb_line(record: FlightRecord, point: ArrayLike, *, rest: float = REST) -> PlumbLine:
    """Return the plumb line that the attitude at the end of a record gives.

    Args:
        record: of one hanging, with phi and theta.
        point: (3,) m, airframe axes (FRD), where it hung by.
        rest: s at the end of the record, in which it hung at rest.

    Raises:
        RecordError: it did not hang at rest.
    """
    at_rest = record.slice(record.time[-1] - rest, record.time[-1])
    angles = at_rest.select(("phi", "theta"))
    blocks = np.array_split(angles, max(4, round(at_rest.duration / _BLOCK)))
    means = np.array([block.mean(axis=0) for block in blocks])
    half = len(means) // 2
    drift = np.abs(means[:half].mean(axis=0) - means[half:].mean(axis=0))
    spread = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    if np.any(spread > _STANDARD_ERROR) or np.any(drift > _DRIFT):
        raise RecordError(
            f"the helicopter still moves: in the last {rest:g} s the standard error of phi and "
            f"theta is {spread[0]:.2g} and {spread[1]:.2g} rad (allowed {_STANDARD_ERROR:g}), "
            f"their drift {drift[0]:.2g} and {drift[1]:.2g} rad (allowed {_DRIFT:g}); record "
            "for longer"
        )
    phi, theta = angles.mean(axis=0)
    down = [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return PlumbLine(np.array(point), np.array(down), float(np.max(spread)))


def centre_of_gravity(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return the point nearest to all plumb lines, (3,) m, airframe axes (FRD).

    Raises:
        InputError: fewer than two lines, or all of them are parallel.
    """
    if len(lines) < 2:
        raise InputError(f"two plumb lines or more meet in a point, got {len(lines)}")
    across = [np.eye(3) - np.outer(line.down, line.down) for line in lines]
    total = np.sum(across, axis=0)
    if np.linalg.cond(total) > 1e4:
        raise InputError("the plumb lines are parallel; hang the helicopter from another point")
    return np.linalg.solve(
        total, np.sum([a @ line.point for a, line in zip(across, lines)], axis=0)
    )


def attitude_sensitivity(lines: Sequence[PlumbLine]) -> float:
    """Return how far the centre moves for the worst attitude error of given size, m/rad.

    All of phi and theta of all hangings are off by that size, with the worst signs.
    """
    shifts = _shifts(lines).reshape(-1, 3)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * len(shifts))).reshape(len(shifts), -1)
    return float(np.linalg.norm(signs.T @ shifts, axis=1).max())


def centre_errors(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return the standard error of the centre of gravity along each axis, (3,) m."""
    error = np.array([line.error for line in lines])
    return np.sqrt(np.sum((_shifts(lines) * error[:, None, None]) ** 2, axis=(0, 1)))


def _shifts(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return how the centre moves as a line tilts, (n_line, 2 ways across, 3) m/rad."""
    centre = centre_of_gravity(lines)
    shifts = np.empty((len(lines), 2, 3))
    for number, line in enumerate(lines):
        down = np.array(line.down)
        for k, direction in enumerate(np.linalg.svd(down[None, :])[2][1:]):
            tilted, moved = down + 1e-6 * direction, list(lines)
            moved[number] = PlumbLine(line.point, tilted / np.linalg.norm(tilted))
            shifts[number, k] = (centre_of_gravity(moved) - centre) / 1e-6
    return shifts
