"""ArduCopter's control law of a helicopter, exact and linear, from its parameters.

Source: ArduPilot 4.7, libraries/AC_PID, AC_AttitudeControl, Filter/NotchFilter and
HarmonicNotchFilter, and ArduCopter/mode_systemid.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfreqz

from helisim.base.arrays import Real
from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import Checked, Value
from helisim.handling.loop import axis_of
from helisim.records.record import ATTITUDES, RATES

Each = float | Real

COMMANDS = ("lat", "lon", "ped")  # commands, 1 being full; the collective is the pilot's
STICKS = ("LAT", "LON", "PED")
"""Asked angles of roll and pitch, rad, and the asked rate of yaw, rad/s."""
ADDED = ("p_added", "q_added", "r_added")
"""Rates, rad/s, that SystemID's axes 7 to 9 add to the wanted ones."""
WORDS = {"lat": "RLL", "lon": "PIT", "ped": "YAW"}

NOTCHES = ("INS_HNTCH", "INS_HNTC2")
"""First words of the parameters of the gyro's harmonic notches."""

_LEAK = 0.02  # share of the integral beyond its least leak that leaks at a tick
GYRO_RATE = 1000.0
"""Rate of the gyro's filters, Hz."""
# ArduPilot's notch by default, by the ends of its parameters' names.
_USUAL = {
    "ENABLE": 0.0, "REF": 0.0, "MODE": 1.0, "OPTS": 0.0,
    "FREQ": 80.0, "BW": 40.0, "ATT": 40.0, "HMNCS": 3.0,
}  # fmt: skip
# Of notches: centres are below that share of the rate and above that of the width; harmonics.
_HIGHEST, _LOWEST, _HARMONICS = 0.48, 0.52, 16


@dataclass(frozen=True)
class Rates:
    """PID of one axis's rate. Each field is the parameter that its comment names.

    Gains are of full command over rate, rad/s, its integral and derivative; corners in Hz, 0 for
    none. In a hover `leaks` is true of roll and pitch; of yaw it never is.
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

    def tick(self, before: "Terms", wanted: Each, rate: Each, period: Each) -> "Terms":
        """Return the terms after a tick; all arrays of one shape, rates in rad/s, `period` in s.

        `wanted` is of the tick before, `rate` filtered; each element counts by itself.
        """
        last, error, slope, kept, _ = before
        target = last + _share(self.target_hz, period) * (wanted - last)
        rises = _share(self.error_hz, period) * (target - rate - error)
        error = error + rises
        slope = slope + _share(self.slope_hz, period) * (rises / period - slope)
        if self.leaks:
            kept = kept - _LEAK * (kept - np.clip(kept, -self.least_leak, self.least_leak))
        summed = np.clip(kept + self.i * error * period, -self.most, self.most)
        integral = summed if self.i else np.zeros_like(error)
        asked = (target - last) / period
        command = self.p * error + self.d * slope + integral + self.ff * target + self.d_ff * asked
        return Terms(target, error, slope, integral, command)


class Terms(NamedTuple):
    """State and command of an axis's PID, arrays of one shape, of full command but where said.

    `target` (Tar of a log) and `error` (Err) are filtered, rad/s; `slope` likewise, rad/s^2.
    """

    target: Each
    error: Each
    slope: Each
    integral: Each
    command: Each


@dataclass(frozen=True)
class Notch:
    """A static harmonic notch of the gyro: `centre` and `bandwidth`, Hz, of its first harmonic.

    `attenuation` is in dB, `harmonics` has bit n - 1 for the nth.
    """

    centre: float  # FREQ
    bandwidth: float  # BW
    attenuation: float  # ATT
    harmonics: int  # HMNCS

    @classmethod
    def of(cls, parameters: Mapping[str, float], name: str) -> Self | None:
        """Return a notch by its parameters' first word, INS_HNTCH or INS_HNTC2.

        None if it is off, follows a sensor (MODE and REF), or is a double or triple one (OPTS).
        """
        on, ref, mode, several, *own = (
            parameters.get(f"{name}_{word}", usual) for word, usual in _USUAL.items()
        )
        return (
            None
            if not on or (ref and mode) or int(several) & 0b10001
            else cls(*own[:3], harmonics=int(own[3]))
        )

    @property
    def sections(self) -> NDArray[np.float64]:
        """Its second-order sections at `GYRO_RATE`, (n_harmonic, 6)."""
        centre, bits = max(self.centre, _LOWEST * self.bandwidth), range(_HARMONICS)
        n = np.array([k + 1 for k in bits if self.harmonics >> k & 1], np.float64)
        turn = 2.0 * math.pi * centre / GYRO_RATE * n[n * centre < _HIGHEST * GYRO_RATE]
        ratio, depth = (1.0 - 0.5 * self.bandwidth / centre) ** -2, 10.0 ** (-self.attenuation / 20)
        alpha, middle = np.sin(turn) * (ratio - 1.0) / (2.0 * math.sqrt(ratio)), -2.0 * np.cos(turn)
        shares = 1.0 + alpha * depth, middle, 1.0 - alpha * depth, 1.0 + alpha, middle, 1.0 - alpha
        return np.column_stack(shares) / (1.0 + alpha)[:, None]


@dataclass(frozen=True, eq=False)
class ArduCopterLaw(Checked, Value):
    """The whole law, a `Linear` from motion to commands; mappings are by axis, "lat", "lon", "ped".

    `angle`: wanted rate over attitude error, 1/s (ATC_ANG_*_P); `period`, s, between ticks;
    `gyro_hz`: INS_GYRO_FILTER, 0 for none; `input_time`, s: ATC_INPUT_TC, None without shaping, as
    with ATC_RATE_FF_ENAB 0 and SystemID's axes 4 to 6; `yaw_time`, s: PILOT_Y_RATE_TC; `lean`,
    (phi, theta), rad, and integrals `steady`, of full command: of the steady flight; `remarks`:
    parameters that ask for more than this law has; `notches`: the gyro's, static.
    """

    rates: Mapping[str, Rates]
    angle: Mapping[str, float]
    period: float
    gyro_hz: float = 20.0
    input_time: float | None = 0.15
    yaw_time: float = 0.0
    lean: tuple[float, float] = (0.0, 0.0)
    steady: Mapping[str, float] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    notches: tuple[Notch, ...] = ()

    @classmethod
    def of(
        cls,
        parameters: Mapping[str, float],
        *,
        lean: tuple[float, float] = (0.0, 0.0),
        steady: Mapping[str, float] | None = None,
        source: str = "",
    ) -> Self:
        """Return the law of a log's PARM messages or a .parm file; InputError if some are missing.

        `lean` is (phi, theta) of the steady flight, rad, `steady` its integrals, of full command;
        a refusal begins with `source`.
        """

        def given(name: str) -> float:
            if name not in parameters:
                raise InputError(
                    f"{source}the parameters lack {name}: expected those of an ArduCopter-heli, "
                    "all of them, as its log's PARM messages or a ground station's file have them"
                )
            return float(parameters[name])

        shaped = given("ATC_RATE_FF_ENAB") != 0.0
        notches = {name: Notch.of(parameters, name) for name in NOTCHES}
        known = {f"{name}_ENABLE": 0.0 for name, one in notches.items() if one}
        return cls(
            {axis: _rates(axis, given) for axis in COMMANDS},
            {axis: given(f"ATC_ANG_{word}_P") for axis, word in WORDS.items()},
            1.0 / given("SCHED_LOOP_RATE"),
            given("INS_GYRO_FILTER"),
            max(given("ATC_INPUT_TC"), 0.01) if shaped else None,
            float(parameters.get("PILOT_Y_RATE_TC", 0.0)),
            lean,
            steady or {},
            _beyond({**parameters, **known}),
            tuple(one for one in notches.values() if one),
        )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Rates, rad/s, attitudes, rad, and sticks."""
        return (*RATES, *ATTITUDES, *STICKS)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Commands; 1 is full."""
        return COMMANDS

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response with the gyro's filter, (3, 9, n_freq), at (n_freq,) rad/s."""
        return _response(self, np.asarray(frequency, np.float64).tobytes())

    def gyro(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response of the gyro's filters, (n_freq,), at frequencies, (n_freq,) rad/s."""
        return np.asarray(sosfreqz(self.gyro_sections, frequency, fs=2.0 * np.pi * GYRO_RATE)[1])

    @property
    def gyro_sections(self) -> NDArray[np.float64]:
        """Second-order sections of the gyro's filters at `GYRO_RATE`, (n_section, 6)."""
        corner = min(self.gyro_hz, 0.4 * GYRO_RATE)
        low = [butter(2, corner, fs=GYRO_RATE, output="sos")] if self.gyro_hz else []
        return np.vstack([(1.0, 0, 0, 1, 0, 0), *low, *(one.sections for one in self.notches)])

    def wanted(self, error: Real, moves: Real) -> Real:
        """Return wanted rates, (3, ...) rad/s, of errors of roll, pitch and heading, (3, ...) rad.

        `moves` are the target's derivatives, (3, ...) rad/s.
        """
        gains = np.array([self.angle[axis] for axis in COMMANDS])
        return (gains[:, None] * self._turned) @ error + self._turned @ moves

    @cached_property
    def ticked(self) -> LinearSystem:
        """The law at its ticks from `inputs`, rates behind the gyro's filter, and `ADDED`."""
        inputs, count = (*self.inputs, *ADDED), 7 * len(COMMANDS)
        return LinearSystem.of_steps(self._tick, count, self.period, inputs, COMMANDS)

    def _tick(self, state: Real, seen: Real) -> Real:
        """Return 21 states and 3 commands, less those of the steady flight.

        States: wanted rates, filtered ones, errors, slopes, integrals, target attitudes and rates.
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

    def _aimed(self, aim: Real, moves: Real, asked: Real) -> tuple[Real, Real]:
        if self.input_time is None:
            return np.array([asked[0], asked[1], aim[2] + self.period * asked[2]]), np.zeros(3)
        aim = aim + self.period * moves
        along = min(1.0, self.period / max(self.yaw_time, 0.01)) if self.yaw_time > 0.0 else 1.0
        yaw = moves[2] + along * (asked[2] - moves[2])
        return aim, np.array([*((asked - aim)[:2] / self.input_time), yaw])

    @cached_property
    def _turned(self) -> Real:
        """Rotations about the body's axes over changes of roll, pitch and heading, (3, 3)."""
        (sp, cp), (st, ct) = ((math.sin(one), math.cos(one)) for one in self.lean)
        return np.array([[1.0, 0.0, -st], [0.0, cp, sp * ct], [0.0, -sp, cp * ct]])


@lru_cache(maxsize=16)  # hundreds of draws of a plant close their loops by one law
def _response(law: ArduCopterLaw, frequency: bytes) -> NDArray[np.complex128]:
    """Return the response, read-only, at frequencies given by their bytes."""
    omega = np.frombuffer(frequency)
    whole = law.ticked.response(omega)[:, : len(law.inputs)].copy()
    whole[:, : len(RATES)] *= law.gyro(omega)
    whole.setflags(write=False)
    return whole


def _share(corner: float, period: Each) -> Real:
    return (
        np.asarray(period / (period + 1.0 / (2.0 * math.pi * corner)))
        if corner
        else np.ones_like(period)
    )


def _rates(axis: str, given: Callable[[str], float]) -> Rates:
    names = ["P", "I", "D", "FF", "D_FF", "FLTT", "FLTE", "FLTD", "IMAX", "ILMI"]
    return Rates(*(given(f"ATC_RAT_{WORDS[axis]}_{name}") for name in names), leaks=axis != "ped")


_BEYOND = {
    "ATC_RAT_{}_SMAX": "the slew limiter of {} lowers its gain in fast motion",
    "ATC_RAT_{}_PDMX": "the sum of P and D of {} is limited",
    "ATC_RAT_{}_NTF": "the notch of {}'s target is left out",
    "ATC_RAT_{}_NEF": "the notch of {}'s error is left out",
}
_ALSO = {
    "INS_HNTCH_ENABLE": "the gyro's harmonic notch is left out: it follows a sensor, or is several",
    "INS_HNTC2_ENABLE": "so is the gyro's second harmonic notch",
    "ATC_PIRO_COMP": "pirouette compensation is left out",
    "H_FLYBAR_MODE": "with a flybar roll and pitch are the pilot's in ACRO",
}


def _beyond(parameters: Mapping[str, float]) -> tuple[str, ...]:
    said = {
        name.format(word): text.format(axis_of(axis).word)
        for axis, word in WORDS.items()
        for name, text in _BEYOND.items()
    }
    return tuple(
        f"{text} ({name} {parameters[name]:g})"
        for name, text in (said | _ALSO).items()
        if parameters.get(name, 0.0)
    )
