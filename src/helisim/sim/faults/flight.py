"""Faults of servos and gyro in flight. What a recorder does wrong is in `recorder`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.physics.layout import NEVER, PARAM, READS_HELD, READS_ZERO
from helisim.records.channels import RATES, SERVOS

_READS = {"zero": READS_ZERO, "held": READS_HELD}


@dataclass(frozen=True, kw_only=True)
class ServoStuck:
    """A servo that moves no more. Its command is recorded as ever.

    Attributes:
        servo: "servo_front", "servo_left", "servo_right" or "servo_tail".
        at: s.
        position: where it sticks, unitised: it runs there as fast as it can. None: where it is.
    """

    servo: str
    at: float
    position: float | None = None

    def __post_init__(self) -> None:
        _check_servo(self.servo)
        check_time(self, "at")
        if self.position is not None and not -1.0 <= self.position <= 1.0:
            raise InputError(
                f"{self.servo}: position must be in [-1, 1], unitised, got {self.position}"
            )

    @property
    def part(self) -> str:
        """What fails."""
        return self.servo

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        if self.position is None:
            _limit(par, self.servo, self.at, rate_limit=0.0)
        else:
            _limit(par, self.servo, self.at, low=self.position, high=self.position)


@dataclass(frozen=True, kw_only=True)
class ServoWeak:
    """A servo that is slow, or that lost some of its travel.

    Attributes:
        servo: as for `ServoStuck`.
        at: s.
        rate_limit: its greatest speed from then on, 1/s; None for no change.
        travel: the greatest `abs(command)` that it follows from then on, unitised; None likewise.
    """

    servo: str
    at: float
    rate_limit: float | None = None
    travel: float | None = None

    def __post_init__(self) -> None:
        _check_servo(self.servo)
        check_time(self, "at")
        if self.rate_limit is None and self.travel is None:
            raise InputError(f"{self.servo}: a weak servo needs rate_limit, travel or both")
        for name in ("rate_limit", "travel"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{self.servo}: {name} must be positive, got {value}")

    @property
    def part(self) -> str:
        """What fails."""
        return self.servo

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        rate_limit = NEVER if self.rate_limit is None else self.rate_limit
        travel = NEVER if self.travel is None else self.travel
        _limit(par, self.servo, self.at, rate_limit=rate_limit, low=-travel, high=travel)


@dataclass(frozen=True, kw_only=True)
class GyroRestart:
    """The gyro starts anew: its integrators and filters go to zero, sticks do nothing meanwhile.

    Attributes:
        at: s.
        lasts: s, until the gyro is back.
        output: "neutral" sends all four servos to their middle meanwhile, the collective too;
            "held" leaves their last commands.
    """

    at: float
    lasts: float = 0.3
    output: Literal["neutral", "held"] = "neutral"

    part: ClassVar[str] = "restarting gyro"

    def __post_init__(self) -> None:
        check_time(self, "at", "lasts")
        if self.output not in _OUTPUTS:
            raise UnknownNameError("output of a gyro that restarts", self.output, _OUTPUTS)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.restart_at], par[PARAM.restart_until] = self.at, self.at + self.lasts
        par[PARAM.restart_neutral] = float(self.output == "neutral")


_OUTPUTS = ("neutral", "held")


@dataclass(frozen=True, kw_only=True)
class GyroDropout:
    """The gyro's own rate sensors freeze, or read zero, for a while; the recorder's go on.

    Attributes:
        at: s.
        lasts: s.
        rates: which of "p", "q", "r".
        reads: "zero", or "held" for what the gyro's filters hold at that moment.
    """

    at: float
    lasts: float
    rates: str | Sequence[str] = RATES
    reads: Literal["zero", "held"] = "zero"

    part: ClassVar[str] = "gyro's sensors"

    def __post_init__(self) -> None:
        check_time(self, "at", "lasts")
        object.__setattr__(self, "rates", tuple(self.rates))
        for name in self.rates:
            if name not in RATES:
                raise UnknownNameError("rate", name, RATES)
        if not self.rates:
            raise InputError("a gyro dropout needs one of the rates p, q, r")
        if self.reads not in _READS:
            raise UnknownNameError("reading of a rate that dropped out", self.reads, _READS)

    def write(self, par: NDArray[np.float64]) -> None:
        """Put the fault into a vehicle's parameters (n_param,) for the force laws."""
        par[PARAM.dropout_at], par[PARAM.dropout_until] = self.at, self.at + self.lasts
        for name in self.rates:
            par[PARAM.dropout_p + RATES.index(name)] = _READS[self.reads]


FlightFault = ServoStuck | ServoWeak | GyroRestart | GyroDropout


def check_parts(faults: Sequence[FlightFault]) -> None:
    """Raise InputError if two faults are of the same part."""
    parts = [fault.part for fault in faults]
    for part in parts:
        if parts.count(part) > 1:
            raise InputError(f"{part}: a flight has one fault of a part, got {parts.count(part)}")


def write_faults(par: NDArray[np.float64], faults: Sequence[FlightFault]) -> None:
    """Put all faults of a flight into a vehicle's parameters (n_param,) for the force laws."""
    par[PARAM.faults] = float(bool(faults))
    par[PARAM.faults + 1 : PARAM.dropout_p] = NEVER
    par[PARAM.dropout_p : PARAM.dropout_r + 1] = 0.0
    for fault in faults:
        fault.write(par)


def check_time(fault: object, *names: str) -> None:
    """Raise InputError unless a fault's times are such."""
    kind = type(fault).__name__
    for name in names:
        value = getattr(fault, name)
        if not (isinstance(value, int | float) and math.isfinite(value) and value >= 0.0):
            raise InputError(f"{kind}: {name} must be 0 s or more, got {value!r}")
        if name == "lasts" and value == 0.0:
            raise InputError(f"{kind}: lasts must be above 0 s")


def _check_servo(name: str) -> None:
    if name not in SERVOS:
        raise UnknownNameError("servo", name, SERVOS)


def _limit(
    par: NDArray[np.float64],
    servo: str,
    at: float,
    *,
    rate_limit: float = NEVER,
    low: float = -NEVER,
    high: float = NEVER,
) -> None:
    first = PARAM.front_fault_at + 4 * SERVOS.index(servo)
    par[first : first + 4] = [at, rate_limit, low, high]
