"""ArduCopter's control law of a helicopter, exact and linear, from its parameters.

The autopilot ticks `SCHED_LOOP_RATE` times a second. At a tick the rates that the gyro's filter
gives are followed by three PIDs, whose sums are its commands, 1 being full; then the attitude is
read, and its error sets the rates that are wanted at the next tick. Understood from ArduPilot 4.7,
libraries/AC_PID, AC_AttitudeControl, and ArduCopter/mode_systemid; `Rates.tick` repeats the terms
of its logs' PIDR, PIDP and PIDY to their last digit.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import butter, freqz

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import FrozenMap, Value
from helisim.handling.loop import axis_of
from helisim.records.record import ATTITUDES, RATES

Array = NDArray[np.float64]

COMMANDS = ("lat", "lon", "ped")
"""What the law commands; the collective is the pilot's."""
STICKS = ("LAT", "LON", "PED")
"""What it is asked: angles of roll and pitch, rad, and a rate of yaw, rad/s."""
ADDED = ("p_added", "q_added", "r_added")
"""What SystemID's axes 7 to 9 add to the rates that are wanted, rad/s."""
_WORDS = {"lat": "RLL", "lon": "PIT", "ped": "YAW"}

_LEAK = 0.02
"""Share of the integral beyond its least leak that leaks at a tick."""
_GYRO_RATE = 1000.0
"""Hz, at which the gyro's filter runs where nothing else is known."""
_SMALL = 2.0**-20
"""Of what the linear form is asked with: no rounding, as a power of two."""


@dataclass(frozen=True)
class Rates:
    """The PID of one axis's rate. Each field is the parameter that its comment names.

    Attributes:
        p, i, d, ff, d_ff: gains, of full command over rad/s, its integral, its derivative, and of
            the rate that is wanted and its derivative.
        target_hz, error_hz, slope_hz: corners of the filters of what is wanted, of the error, and
            of its derivative; 0: none.
        most: the largest integral (IMAX).
        least_leak: the integral leaks beyond this (ILMI), if it leaks.
        leaks: whether it does: of roll and pitch in a hover, of yaw never in flight.
    """

    p: float  # P
    i: float  # I
    d: float  # D
    ff: float  # FF
    d_ff: float  # D_FF
    target_hz: float  # FLTT
    error_hz: float  # FLTE
    slope_hz: float  # FLTD
    most: float  # IMAX
    least_leak: float  # ILMI
    leaks: bool

    def tick(
        self, before: "Terms", wanted: ArrayLike, rate: ArrayLike, period: ArrayLike
    ) -> "Terms":
        """Return the terms after a tick; all arrays of one shape, each element by itself.

        Args:
            before: the terms of the tick before.
            wanted: rate, rad/s, as the attitude's law wanted it at the tick before.
            rate: as sensed and filtered now, rad/s.
            period: s, since the tick before.
        """
        wanted, rate, period = (np.asarray(one, dtype=np.float64) for one in (wanted, rate, period))
        last, error, slope, kept, _ = (np.asarray(one, dtype=np.float64) for one in before)
        target = last + _share(self.target_hz, period) * (wanted - last)
        rises = _share(self.error_hz, period) * (target - rate - error)
        error = error + rises
        slope = slope + _share(self.slope_hz, period) * (rises / period - slope)
        if self.leaks:
            kept = kept - _LEAK * (kept - np.clip(kept, -self.least_leak, self.least_leak))
        integral = np.clip(kept + self.i * error * period, -self.most, self.most)
        if not self.i:
            integral = np.zeros_like(error)
        asked = (target - last) / period
        command = self.p * error + self.d * slope + integral + self.ff * target + self.d_ff * asked
        return Terms(target, error, slope, integral, command)


class Terms(NamedTuple):
    """What an axis's PID keeps from tick to tick, and its command; arrays of one shape.

    Attributes:
        target: the rate that is wanted, filtered, rad/s (Tar of a log).
        error: filtered, rad/s (Err).
        slope: the error's derivative, filtered, rad/s^2: D over its gain.
        integral: of full command (I).
        command: the sum of all terms, of full command.
    """

    target: ArrayLike
    error: ArrayLike
    slope: ArrayLike
    integral: ArrayLike
    command: ArrayLike


@dataclass(frozen=True, eq=False)
class ArduCopterLaw(Value):
    """The whole law, as a `Linear` from motion to commands; see `helisim.base.linear`.

    Attributes:
        rates: axis "lat", "lon", "ped" -> its PID.
        angle: axis -> rate that is wanted over an error of attitude, 1/s (ATC_ANG_*_P).
        period: s, between ticks.
        gyro_hz: corner of the gyro's filter (INS_GYRO_FILTER); 0: none.
        gyro_rate: Hz, at which that filter runs.
        input_time: s, in which what is asked is followed (ATC_INPUT_TC); None where it is the
            target at once (ATC_RATE_FF_ENAB 0, and SystemID's axes 4 to 6).
        yaw_time: s, likewise of the asked rate of yaw (PILOT_Y_RATE_TC).
        lean: (phi, theta) of the steady flight, rad: roll, pitch and heading errors turn by it.
        steady: axis -> the integral of the steady flight, of full command.
        remarks: of what the parameters ask for beyond this law.
    """

    rates: Mapping[str, Rates]
    angle: Mapping[str, float]
    period: float
    gyro_hz: float = 20.0
    gyro_rate: float = _GYRO_RATE
    input_time: float | None = 0.15
    yaw_time: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)
    steady: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("rates", "angle", "steady"):
            object.__setattr__(self, name, FrozenMap(getattr(self, name)))

    @classmethod
    def of(
        cls,
        parameters: Mapping[str, float],
        *,
        lean: tuple[float, float] = (0.0, 0.0),
        steady: Mapping[str, float] | None = None,
        gyro_rate: float = _GYRO_RATE,
    ) -> Self:
        """Return the law that parameters say: of a log's PARM messages, or of a .parm file.

        Args:
            parameters: by ArduPilot's names.
            lean: (phi, theta) of the steady flight, rad.
            steady: axis -> integral of the steady flight.
            gyro_rate: Hz, at which the gyro is sampled.

        Raises:
            InputError: some are missing.
        """

        def given(name: str) -> float:
            if name not in parameters:
                raise InputError(
                    f"the parameters lack {name}: expected those of an ArduCopter-heli, all of "
                    "them, as its log's PARM messages or a ground station's file have them"
                )
            return float(parameters[name])

        shaped = given("ATC_RATE_FF_ENAB") != 0.0
        return cls(
            {axis: _rates(axis, given) for axis in COMMANDS},
            {axis: given(f"ATC_ANG_{word}_P") for axis, word in _WORDS.items()},
            1.0 / given("SCHED_LOOP_RATE"),
            given("INS_GYRO_FILTER"),
            gyro_rate,
            max(given("ATC_INPUT_TC"), 0.01) if shaped else None,
            float(parameters.get("PILOT_Y_RATE_TC", 0.0)),
            lean,
            steady or {},
            _beyond(parameters),
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Rates and attitudes, rad, as they are, and what is asked."""
        return (*RATES, *ATTITUDES, *STICKS)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Its commands; 1 is full."""
        return COMMANDS

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response, (3, 9, n_freq), at frequencies, (n_freq,) rad/s.

        The gyro's filter is part of it.
        """
        whole = self.ticked.response(frequency)[:, : len(self.inputs)].copy()
        whole[:, : len(RATES)] *= self.gyro(frequency)
        return whole

    def gyro(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response of the gyro's filter, (n_freq,), at frequencies, (n_freq,) rad/s."""
        if not self.gyro_hz:
            return np.ones(np.shape(frequency), dtype=np.complex128)
        b, a = butter(2, min(self.gyro_hz, 0.4 * self.gyro_rate), fs=self.gyro_rate)
        return np.asarray(freqz(b, a, frequency, fs=2.0 * np.pi * self.gyro_rate)[1])

    def added(self, axis: str, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the command over what SystemID's axes 7 to 9 add to the wanted rate, (n_freq,).

        The loop is open: what is sensed stands still. What such an axis adds is thus as if this
        times as much had been added at the command.

        Args:
            axis: of control.
            frequency: (n_freq,) rad/s.
        """
        row = COMMANDS.index(axis_of(axis).name)
        return self.ticked.response(frequency)[row, len(self.inputs) + row]

    def wanted(self, error: Array, moves: Array) -> Array:
        """Return the rates that the attitude's law wants, (3, ...) rad/s.

        Args:
            error: (3, ...) of roll, pitch and heading: what is aimed at less what is, rad.
            moves: (3, ...) derivatives of what is aimed at, rad/s.
        """
        gains = np.array([self.angle[axis] for axis in COMMANDS])
        return (gains[:, None] * self._turned) @ error + self._turned @ moves

    @cached_property
    def ticked(self) -> LinearSystem:
        """The law at its ticks; its rates are those behind the gyro's filter.

        Inputs are `inputs` and `ADDED`.
        """
        inputs = (*self.inputs, *ADDED)
        n, m = 7 * len(COMMANDS), len(inputs)
        columns = [self._tick(one[:n], one[n:]) / _SMALL for one in _SMALL * np.eye(n + m)]
        whole = np.column_stack(columns)
        return LinearSystem(
            whole[:n, :n],
            whole[:n, n:],
            whole[n:, :n],
            whole[n:, n:],
            self.period,
            inputs,
            COMMANDS,
        )

    def _tick(self, state: Array, seen: Array) -> Array:
        """Return states and commands, (21 + 3,), as they differ from the steady flight's.

        States, three each: rates that are wanted, filtered, errors, slopes, integrals, attitudes
        that are aimed at and their derivatives.
        """
        wanted, target, error, slope, integral, aim, moves = state.reshape(7, 3)
        rate, attitude, asked, added = seen.reshape(4, 3)
        terms = np.zeros((5, 3))
        for k, axis in enumerate(COMMANDS):
            own, steady = self.rates[axis], self.steady.get(axis, 0.0)
            kept = Terms(target[k], error[k], slope[k], steady + integral[k], steady)
            now = own.tick(kept, wanted[k], rate[k], self.period)
            still = own.tick(Terms(0.0, 0.0, 0.0, steady, steady), 0.0, 0.0, self.period)
            terms[:, k] = np.array([*now]) - np.array([*still])
        aim, moves = self._aimed(aim, moves, asked)
        wanted = self.wanted(aim - attitude, moves) + added
        *kept, commands = terms
        return np.concatenate([wanted, *kept, aim, moves, commands])

    def _aimed(self, aim: Array, moves: Array, asked: Array) -> tuple[Array, Array]:
        """Return the attitude that is aimed at, (3,) rad, and its derivative."""
        if self.input_time is None:
            return np.array([asked[0], asked[1], aim[2] + self.period * asked[2]]), np.zeros(3)
        aim = aim + self.period * moves
        along = min(1.0, self.period / max(self.yaw_time, 0.01)) if self.yaw_time > 0.0 else 1.0
        yaw = moves[2] + along * (asked[2] - moves[2])
        return aim, np.array([*((asked - aim)[:2] / self.input_time), yaw])

    @cached_property
    def _turned(self) -> Array:
        """Rotations about the body's axes over changes of roll, pitch and heading, (3, 3)."""
        (sp, cp), (st, ct) = ((math.sin(one), math.cos(one)) for one in self.lean)
        return np.array([[1.0, 0.0, -st], [0.0, cp, sp * ct], [0.0, -sp, cp * ct]])


def _share(corner: float, period: Array) -> Array:
    """Return how far a filter of first order goes in a tick, 0 to 1."""
    if not corner:
        return np.ones_like(period)
    return np.asarray(period / (period + 1.0 / (2.0 * math.pi * corner)))


def _rates(axis: str, given: Callable[[str], float]) -> Rates:
    names = ["P", "I", "D", "FF", "D_FF", "FLTT", "FLTE", "FLTD", "IMAX", "ILMI"]
    values = [given(f"ATC_RAT_{_WORDS[axis]}_{name}") for name in names]
    return Rates(*values, leaks=axis != "ped")


_BEYOND = {
    "ATC_RAT_{}_SMAX": "the slew limiter of {} lowers its gain in fast motion",
    "ATC_RAT_{}_PDMX": "the sum of P and D of {} is limited",
    "ATC_RAT_{}_NTF": "the notch of {}'s target is left out",
    "ATC_RAT_{}_NEF": "the notch of {}'s error is left out",
}
_ALSO = {
    "INS_HNTCH_ENABLE": "the gyro's harmonic notch is left out",
    "INS_HNTC2_ENABLE": "the gyro's second harmonic notch is left out",
    "ATC_PIRO_COMP": "pirouette compensation is left out",
    "H_FLYBAR_MODE": "with a flybar roll and pitch are the pilot's in ACRO",
}


def _beyond(parameters: Mapping[str, float]) -> tuple[str, ...]:
    """Return what the parameters switch on that this law has not."""
    said = {
        name.format(word): text.format(axis_of(axis).word)
        for axis, word in _WORDS.items()
        for name, text in _BEYOND.items()
    }
    return tuple(
        f"{text} ({name} {parameters[name]:g})"
        for name, text in (said | _ALSO).items()
        if parameters.get(name, 0.0)
    )
