"""Rotorflight's rate controller, mode 3, as plain data in the firmware's own units.

Scales, filters and curves: rotorflight-firmware 4.6, flight/pid.h, pid.c, setpoint.c, mixer.c,
common/filter.c, pg/pid.c; its words for the settings, its defaults. Gains are 0 to 1000, cutoffs
Hz, rates deg/s.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem
from helisim.base.settings import check, setting
from helisim.design.laws.law import Law, number, positive, probed, register
from helisim.design.laws.rotorflight_kernel import (
    AXIS,
    BLOCK,
    COLLECTIVE,
    COMPILED,
    COUNT,
    FIRST,
    GENERAL,
    MOST_NOTCHES,
    OF_AXIS,
    PITCH,
    POINTS,
    ROLL,
    SETTINGS,
    YAW,
)
from helisim.physics.gyro import Seen
from helisim.physics.layout import PARAM
from helisim.records.record import IN2, RATES
from helisim.vehicle.addresses import addresses
from helisim.vehicle.swashplate import as_it_is

if TYPE_CHECKING:
    from helisim.vehicle import Controller, Vehicle

CYCLIC_PITCH, TAIL_PITCH = math.radians(12.0), math.radians(24.0)
"""Blade pitch of a mixer's 1, rad: of roll, pitch and collective, and of the tail."""
SCALES: Mapping[str, Mapping[str, float]] = {
    "roll": dict(zip("pidfbo", (6.66666e-6, 2e-4, 1e-7, 2.5e-5, 1e-7, 2e-4))),
    "pitch": dict(zip("pidfbo", (6.66666e-6, 2e-4, 1e-6, 2.5e-5, 1e-7, 2e-4))),
    "yaw": dict(zip("pidfbo", (6.66666e-5, 5e-4, 1e-6, 2.5e-5, 1e-6, 0.0))),
}
"""What one of a gain gives, a mixer's 1 over deg/s, deg, deg/s^2, deg/s, deg/s^2 and deg."""
CROSS_SCALE, PRECOMP_SCALE = 1e-5, 0.01
_SIGNS = {"cw": -1.0, "ccw": 1.0}
_FADE = (12, 13, 14, 15, 17, 20, 23, 28, 36, 49, 78, 187, 250, 250, 250, 250)  # of errors
_CHARGE = (0, 100, 100, 100, 100, 100, 95, 90, 82, 76, 72, 68, 65, 62, 60, 58)  # of offsets
_OFFSET_FADE = (250, 250, 250, 250, 250, 30, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0)
_OFFSET_LIMIT = (12, 12, 10, 8, 6, 4, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2)
_BLOCKS = {"roll": ROLL, "pitch": PITCH, "yaw": YAW, "collective": COLLECTIVE}
_SLOW, _SHARE = 0.475, 500.0  # of the loops' rate, at most of a cutoff; Hz s of a response's time

Numbers = Sequence[float] | NDArray[np.float64]
gain = partial(setting, low=0.0, high=1000.0)


@dataclass(frozen=True, kw_only=True)
class Notch:
    """A notch of the gyro at a frequency, Hz, as of a rotor whose speed is held."""

    frequency: float = setting(above=0.0, high=1e4)
    q: float = setting(3.0, above=0.0, high=100.0)


@dataclass(frozen=True, kw_only=True)
class RotorflightAxis:
    """Gains and settings that all three axes have.

    `range` is blade pitch for one unit of command, rad; `rate` of a full stick, deg/s, `expo` the
    share of its cube; `response_time` in ms; `error_limit` in deg; `error_decay` of a time in
    0.1 s and a rate in deg/s, 0 for none; `relax_level` in deg/s, 0 for none; `limit` of the
    mixer's input, of 1000.
    """

    range: float = positive(MISSING)
    p: float = gain(50.0)
    i: float = gain(100.0)
    d: float = gain(0.0)
    f: float = gain(100.0)
    b: float = gain(0.0)
    gyro_cutoff: float = gain(50.0)
    d_cutoff: float = gain(15.0)
    b_cutoff: float = gain(15.0)
    rate: float = setting(240.0, above=0.0, high=2000.0)
    expo: float = setting(0.0, low=0.0, high=1.0)
    response_time: float = gain(0.0)
    error_limit: float = setting(45.0, above=0.0, high=180.0)
    error_decay_time: float = gain(250.0)
    error_decay_limit: float = gain(12.0)
    relax_level: float = gain(40.0)
    relax_cutoff: float = gain(10.0)
    limit: float = setting(1250.0, above=0.0, high=2500.0)

    def __post_init__(self) -> None:
        check(self)
        if not self.i > 0.0:
            raise InputError("i must be above 0: it holds the servos where they stand at the start")


@dataclass(frozen=True, kw_only=True)
class CyclicRotorflight(RotorflightAxis):
    """Roll or pitch: `o` on the error times collective, `offset_limit` of it in deg."""

    o: float = gain(50.0)
    offset_limit: float = setting(90.0, low=0.0, high=180.0)


@dataclass(frozen=True, kw_only=True)
class YawRotorflight(RotorflightAxis):
    """Yaw: P times `stop_gain` by the error's direction, %, precompensation in F; see the axis.

    `centre` is the blade pitch of the tail servo's middle, rad; the precompensation's gains are
    those of collective and cyclic.
    """

    centre: float = number(0.0)
    p: float = gain(80.0)
    i: float = gain(120.0)
    d: float = gain(10.0)
    f: float = gain(0.0)
    gyro_cutoff: float = gain(100.0)
    d_cutoff: float = gain(20.0)
    b_cutoff: float = gain(20.0)
    error_limit: float = setting(60.0, above=0.0, high=180.0)
    error_decay_time: float = gain(0.0)
    error_decay_limit: float = gain(0.0)
    cw_stop_gain: float = gain(120.0)
    ccw_stop_gain: float = gain(80.0)
    collective_ff_gain: float = gain(60.0)
    cyclic_ff_gain: float = gain(10.0)
    precomp_cutoff: float = gain(5.0)


@dataclass(frozen=True, kw_only=True)
class CollectiveRotorflight:
    """Collective: a full stick moves the blades by `rate`, deg, about the stick's middle, `centre`.

    `range` and `centre` as of the axes, rad.
    """

    range: float = positive(MISSING)
    centre: float = number(0.0)
    rate: float = setting(7.0, above=0.0, high=30.0)
    expo: float = setting(0.0, low=0.0, high=1.0)
    response_time: float = gain(0.0)
    limit: float = setting(1250.0, above=0.0, high=2500.0)


@register
@dataclass(frozen=True, kw_only=True, repr=False)
class Rotorflight(Law):
    """Rotorflight's rate controller, one loop of it at each tick of the vehicle's gyro.

    `rotor` is "cw" or "ccw", seen from above; `swash_phase` in deg; `swash_ring` 0 to 100, 0 for
    none; the cross coupling's cutoff in 0.1 Hz; `smoothing` of the sticks and `gyro_lowpass` in Hz,
    0 for none. Left out are the gyro's decimation, what moves an offset to the error and back at an
    unchanged output (bleed, flood), precompensation of the rotor's acceleration and for pitch,
    levelling, rescue and governor.
    """

    kind: ClassVar[str] = "rotorflight"
    not_tuned: ClassVar[tuple[str, ...]] = (
        *("range", "centre", "rate", "expo", "limit", "error_limit", "offset_limit"),
        *("swash_ring", "smoothing", "error_decay_time", "error_decay_limit"),
        *("relax_level", "relax_cutoff", "response_time"),
    )
    roll: CyclicRotorflight
    pitch: CyclicRotorflight
    yaw: YawRotorflight
    collective: CollectiveRotorflight
    rotor: str = setting("cw", choices=tuple(_SIGNS))
    swash_phase: float = setting(0.0, low=-180.0, high=180.0)
    swash_ring: float = setting(100.0, low=0.0, high=100.0)
    cyclic_cross_coupling_gain: float = gain(50.0)
    cyclic_cross_coupling_cutoff: float = setting(25.0, above=0.0, high=1000.0)
    smoothing: float = gain(0.0)
    gyro_lowpass: float = gain(100.0)
    notches: tuple[Notch, ...] = setting((), unsaid=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.notches) > MOST_NOTCHES:
            raise InputError(f"{len(self.notches)} notches, and at most {MOST_NOTCHES} fly")

    @classmethod
    def of(cls, vehicle: "Vehicle") -> Self:
        """Return the firmware's default gains on a vehicle's rotor and blade pitch."""
        par = vehicle.model.actuator_user[addresses(vehicle.model).rotor]

        def at(name: str) -> float:
            return float(par[getattr(PARAM, name)])

        roll, pitch = (
            CyclicRotorflight(range=math.hypot(at(f"cyclic_a_{one}"), at(f"cyclic_b_{one}")))
            for one in ("lat", "lon")
        )
        collective = CollectiveRotorflight(
            range=at("main_pitch_range"),
            centre=at("main_pitch_trim"),
            rate=math.degrees(0.5 * at("gyro_collective") * at("main_pitch_range")),
        )
        return cls(
            roll=roll,
            pitch=replace(pitch, d=40.0),
            yaw=YawRotorflight(range=at("tail_pitch_range"), centre=at("tail_pitch_trim")),
            collective=collective,
            rotor="cw" if at("main_direction") > 0.0 else "ccw",
        )

    def linear(self, period: float) -> LinearSystem:
        """Return the law about sticks and servos in their middle, ticks a period (s) apart.

        There cyclic precompensation, an offset and what fades with collective have no slope.
        """
        settings, rest = self.numbers(period), np.zeros(COUNT)
        COMPILED.reset(Seen(*np.zeros(len(Seen._fields)).tolist()), rest, settings)

        def odd(seen: Seen, state: NDArray[np.float64], settings: NDArray[np.float64]) -> object:
            ends = []
            for sign in (0.5, -0.5):
                moved = rest + 2.0 * sign * state
                near = Seen(*(2.0 * sign * one for one in seen))
                ends.append(sign * np.array([*COMPILED(near, moved, settings), *moved]))
            middle = ends[0] + ends[1]
            state[:] = middle[4:]
            return middle[:4]

        return probed(odd, settings, COUNT, period, (*RATES, *IN2))

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle."""
        settings = self.numbers(vehicle.parameters["gyro.period"])
        settings[GENERAL.plate : ROLL] = vehicle.swashplate.numbers
        return self._flown(COMPILED, COUNT, settings)

    def numbers(self, period: float) -> NDArray[np.float64]:
        """Return the compiled law's settings at a period (s), (n_settings,)."""
        settings, sign, phase = (
            np.zeros(SETTINGS),
            _SIGNS[self.rotor],
            math.radians(self.swash_phase),
        )
        cross = -sign * CROSS_SCALE * self.cyclic_cross_coupling_gain
        ring = (math.sqrt(2.0) - (math.sqrt(2.0) - 1.0) * 0.01 * self.swash_ring) * self.roll.limit
        _write(
            settings,
            {
                GENERAL.period: [period, math.cos(phase), math.sin(phase)],
                GENERAL.ring: [1e3 / ring if self.swash_ring else 0.0],
                GENERAL.cross: [cross, *highpass(0.1 * self.cyclic_cross_coupling_cutoff, period)],
                GENERAL.sign: [
                    sign,
                    PRECOMP_SCALE * self.yaw.collective_ff_gain,
                    PRECOMP_SCALE * self.yaw.cyclic_ff_gain,
                    *lowpass(self.yaw.precomp_cutoff, period),
                ],
                GENERAL.charge: 0.01 * np.array(_CHARGE),
                GENERAL.fade: 0.04 * np.array(_OFFSET_FADE),
                GENERAL.fade_limit: _OFFSET_LIMIT,
                GENERAL.notches: [len(self.notches), *self._notches(period)],
                GENERAL.plate: as_it_is().numbers,
            },
        )
        for k, (name, block) in enumerate(_BLOCKS.items()):
            places = _axis(name, getattr(self, name), period)
            settings[block + AXIS.state] = FIRST + k * OF_AXIS
            smoothed = pt1(self.smoothing * math.sqrt(1.0 / (2.0 ** (1.0 / 3.0) - 1.0)), period)
            if name != "collective":
                places[AXIS.lowpass] = lowpass(self.gyro_lowpass, period)
            _write(settings[block : block + BLOCK], {**places, AXIS.smooth: smoothed})
        return settings

    def _notches(self, period: float) -> list[float]:
        found = []
        for one in self.notches:
            if not one.frequency < 0.5 / period:
                raise InputError(
                    f"a notch at {one.frequency:g} Hz can't be: the law ticks at {1.0 / period:g} "
                    "Hz, and a notch must be below half of that (gyro.period)"
                )
            turn = 2.0 * math.pi * one.frequency * period
            wide = 0.5 * math.sin(turn) / one.q
            middle = -2.0 * math.cos(turn) / (1.0 + wide)
            end = 1.0 / (1.0 + wide)
            found += [end, middle, end, middle, (1.0 - wide) / (1.0 + wide)]
        return found


def _write(settings: NDArray[np.float64], places: Mapping[int, Numbers]) -> None:
    for first, values in places.items():
        settings[first : first + len(values)] = values


def _axis(
    name: str, axis: RotorflightAxis | CollectiveRotorflight, period: float
) -> dict[int, Numbers]:
    """Return an axis's numbers by their place in its block."""
    pitch = TAIL_PITCH if name == "yaw" else CYCLIC_PITCH
    of_full = 1.0 if isinstance(axis, RotorflightAxis) else 1.0 / math.degrees(pitch)
    places: dict[int, Numbers] = {
        AXIS.scale: [pitch / axis.range, getattr(axis, "centre", 0.0) / pitch],
        AXIS.rate: [of_full * axis.rate, axis.expo],
        AXIS.most: [1e-3 * axis.limit],
        AXIS.response: pt1(_SHARE / axis.response_time if axis.response_time else 0.0, period),
    }
    if not isinstance(axis, RotorflightAxis):
        return places
    curve, share = ([1.0] * POINTS, 1.0) if name == "yaw" else (0.08 * np.array(_FADE), 0.96)
    places[AXIS.p] = [SCALES[name][one] * getattr(axis, one, 0.0) for one in "pidfbo"]
    places[AXIS.falling] = [
        0.01 * getattr(axis, f"{one}_stop_gain", 100.0) for one in ("ccw", "cw")
    ]
    places[AXIS.relax] = [1.0 / axis.relax_level if axis.relax_level else 0.0, axis.error_limit]
    places[AXIS.decay] = [
        10.0 / axis.error_decay_time if axis.error_decay_time else 0.0,
        share * (axis.error_decay_limit or 3600.0),
        *curve,
        getattr(axis, "offset_limit", 0.0),
    ]
    places[AXIS.gyro] = lowpass(axis.gyro_cutoff, period)
    places[AXIS.derivative] = slope(axis.d_cutoff, period)
    places[AXIS.boost] = slope(axis.b_cutoff, period)
    places[AXIS.relax_filter] = pt1(axis.relax_cutoff, period)
    return places


Filter = tuple[float, float, float]


def pt1(cutoff: float, period: float) -> Filter:
    """Return b0, b1, a1 of a low-pass by backward differences; at 0 Hz it passes all."""
    share = min(cutoff, _SLOW / period) * 2.0 * math.pi * period
    return (share / (1.0 + share), 0.0, -1.0 / (1.0 + share)) if cutoff else (1.0, 0.0, 0.0)


def lowpass(cutoff: float, period: float) -> Filter:
    """Return b0, b1, a1 of a low-pass by the bilinear rule; at 0 Hz it passes all."""
    w = math.tan(math.pi * min(cutoff * period, _SLOW))
    return (w / (w + 1.0), w / (w + 1.0), (w - 1.0) / (w + 1.0)) if cutoff else (1.0, 0.0, 0.0)


def highpass(cutoff: float, period: float) -> Filter:
    """Return b0, b1, a1 of a high-pass by the bilinear rule."""
    w = math.tan(math.pi * min(cutoff * period, 0.5 * _SLOW))
    return 1.0 / (w + 1.0), -1.0 / (w + 1.0), (w - 1.0) / (w + 1.0)


def slope(cutoff: float, period: float) -> Filter:
    """Return b0, b1, a1 of a derivative behind a low-pass, by the bilinear rule; 0 Hz: none."""
    w = math.tan(math.pi * min(cutoff * period, 0.5 * _SLOW))
    b = 2.0 / period * w / (w + 1.0)
    return b, -b, (w - 1.0) / (w + 1.0)
