"""The sweeps of a proof: what is added where, as large as the loop stays linear with it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from helisim.handling.loop import Curve, axis_of
from helisim.records.channels import ATTITUDES, IN1, RATES
from helisim.sim import Multisine
from helisim.study.proof.exact import ExactLoop
from helisim.vehicle import Vehicle

Array = NDArray[np.float64]

LINEAR = {
    **dict.fromkeys(IN1, 0.3),
    "ped": 0.07,
    **dict.fromkeys(RATES, 2.0),
    **dict.fromkeys(ATTITUDES, 0.12),
    **dict.fromkeys(("u", "v", "w"), 2.5),
}
"""How far a channel may go from its trim in a sweep: commands stop at 0.5, unitised; rad/s, rad;
m/s, of a hover whose induced velocity is about 5 m/s."""

TRIM_TIME = 5.0
"""s of trimmed flight before a sweep, and again after."""
_SERVO = 0.6
"""Of a servo's rate limit."""
_MOST = 0.5
"""Of a command or a stick that is added, unitised."""
_GRID = np.geomspace(0.1, 700.0, 600)
_SAMPLES = 400.0
"""A second, at which peaks are looked for."""


@dataclass(frozen=True, kw_only=True)
class SweepKind:
    """How something is swept.

    Attributes:
        place: "actuators", "sensors" (an attitude is turned) or "sticks".
        axes: that are swept at once, told apart by their own lines.
        band: rad/s.
        slope: of the power over frequency.
        corner: rad/s, below which it is flat.
    """

    place: str
    axes: tuple[str, ...]
    band: tuple[float, float]
    slope: float = 0.0
    corner: float = 0.0

    @property
    def moved(self) -> str:
        """What the excitation calls its axes: angles at the sensors."""
        angles = [axis_of(axis).angle for axis in self.axes]
        return "+".join(angles if self.place == "sensors" else self.axes)


SWEEPS = (
    SweepKind(place="actuators", axes=("lat", "lon"), band=(2.0, 150.0), slope=3.0, corner=20.0),
    SweepKind(place="actuators", axes=("ped",), band=(2.0, 240.0), slope=1.5, corner=20.0),
    SweepKind(place="sensors", axes=("lat", "lon"), band=(2.0, 110.0), slope=6.0, corner=20.0),
    SweepKind(place="sensors", axes=("ped",), band=(2.0, 110.0), slope=5.0, corner=20.0),
    SweepKind(place="sticks", axes=("lat", "lon"), band=(2.0, 60.0), slope=-1.0),
    SweepKind(place="sticks", axes=("ped",), band=(2.0, 60.0)),
)
"""The sweeps of a proof: loops cut at the actuators, attitudes disturbed, commands."""


def sweep(
    kind: SweepKind,
    loop: ExactLoop,
    vehicle: Vehicle,
    *,
    period: float,
    periods: int = 1,
    trim_time: float = TRIM_TIME,
) -> Multisine:
    """Return the multisine of a sweep, as large as everything stays linear.

    Args:
        kind: of the sweep.
        loop: of the vehicle with its law, by which peaks are foreseen.
        vehicle: that flies.
        period: s, of the multisine.
        periods: how many are flown.
        trim_time: s, before and after.
    """
    ticks = max(1, round(period / vehicle.parameters["gyro.period"]))
    made = Multisine(
        axis=kind.moved,
        at=kind.place,
        amplitude=1e-3,
        band=kind.band,
        period=ticks * vehicle.parameters["gyro.period"],
        duration=periods * ticks * vehicle.parameters["gyro.period"] + 2.0 * trim_time,
        slope=kind.slope,
        corner=kind.corner,
        trim_time=trim_time,
    )
    most = LINEAR | {"rate": _SERVO * vehicle.parameters["servo.rate_limit"]}
    share = 1.0 / np.sqrt(len(kind.axes))
    large = []
    for axis, one in zip(kind.axes, made.axes):
        time = np.arange(round(made.period * _SAMPLES)) / _SAMPLES + trim_time
        unit = made.sticks(time)[:, list(_columns(kind.place)).index(one)] / 1e-3
        peaks = _peaks(unit, loop.at(_GRID).reached(kind.place, axis))
        fits = min(most[name] / peak for name, peak in peaks.items() if name in most)
        large.append(float(min(share * fits, _MOST)))
    return replace(made, amplitude=tuple(large))


def _columns(place: str) -> tuple[str, ...]:
    from helisim.sim.places import PLACES

    return PLACES[place]


def _peaks(signal: Array, moved: dict[str, Curve]) -> dict[str, float]:
    """Return the peaks of what a periodic signal (n_time,) moves, and of servos' rates."""
    lines = np.fft.rfft(signal)
    frequency = 2.0 * np.pi * np.fft.rfftfreq(signal.size, 1.0 / _SAMPLES)
    lines[np.abs(lines) < 1e-9 * np.abs(lines).max()] = 0.0
    there = np.flatnonzero(lines)
    found = {}

    def peak(response: NDArray[np.complex128]) -> float:
        spectrum = np.zeros_like(lines)
        spectrum[there] = lines[there] * response
        return float(np.abs(np.fft.irfft(spectrum, signal.size)).max())

    for name, curve in moved.items():
        found[name] = peak(curve.at(frequency[there]))
    turning = [1j * frequency[there] * moved[name].at(frequency[there]) for name in IN1]
    found["rate"] = max(map(peak, turning))
    return found
