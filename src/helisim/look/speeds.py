"""At which airspeed and rotor speed flights were flown, as far as ordinary logs tell."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from helisim.base.arrays import Real
from helisim.base.units import RAD_S_PER_RPM, STANDARD_GRAVITY
from helisim.records.quality import stretches
from helisim.records.record import FlightRecord

# What one model holds for: m/s; of the rotor's median speed, with whose square derivatives go
_FAST, _SPEEDS = 8.0, 0.05
# s, within which air brakes; over which the rotor's speed is averaged; of the shortest stretch
_BRAKES, _AVERAGED, _SHORT = 20.0, 2.0, 10.0


def most_flown(records: Sequence[FlightRecord]) -> tuple[list[FlightRecord], list[str]]:
    """Return the stretches at the airspeed and rotor speed most flown, and a sentence on the rest.

    One model holds for one of each. All records, and no sentence, if they don't change.
    """
    turning = [_turning(one) for one in records]
    every = np.concatenate(turning)
    middle = np.median(every[every > 0.5 * every.max()])  # not of a rotor that hardly turns
    bins = [
        np.array([_speed(one) // _FAST, np.rint((turns / middle - 1.0) / _SPEEDS)])
        for one, turns in zip(records, turning)
    ]
    kinds, counts = np.unique(np.hstack(bins), axis=1, return_counts=True)
    if counts.size == 1:
        return [*records], []
    fast, turns = most = kinds[:, np.argmax(counts * (kinds[1] * _SPEEDS > -0.5))]
    found = [
        one.slice(float(one.time[first]), float(one.time[last - 1]))
        for one, own in zip(records, bins)
        for first, last in stretches(np.all(own == most[:, None], axis=0))
        if (last - first) * one.sample_time > _SHORT
    ]
    low, high = (middle / RAD_S_PER_RPM * (1.0 + _SPEEDS * (turns + side)) for side in (-0.5, 0.5))
    return found, [
        "one model doesn't hold for all speeds of these flights. "
        + (
            f"Those here are of {sum(one.duration for one in found):.0f} s of "
            f"{sum(one.duration for one in records):.0f}: {_FAST * fast:.0f} to "
            f"{_FAST * (fast + 1.0):.0f} m/s by attitude"
            + f", {low:.0f} to {high:.0f} rpm" * bool(middle > 1.0)
            + "; tune flights at other speeds by themselves"
            if found
            else f"None lasts for {_SHORT:g} s, so there is no model: stay at each speed for longer"
        )
    ]


def droop(records: Sequence[FlightRecord]) -> Iterator[str]:
    """Yield how the rotor's speed falls while the collective is high, by their extreme tenths."""
    if told := [
        one.select(("col", "rotor_speed"))
        for one in records
        if "rotor_speed" in one and np.any(one["rotor_speed"]) and np.ptp(one["col"])
    ]:
        col, speed = np.concatenate(told).T / [[1.0], [RAD_S_PER_RPM]]
        before, after = (
            np.mean(speed[some])
            for some in (col <= np.quantile(col, 0.1), col >= np.quantile(col, 0.9))
        )
        yield (
            f"rotor speed: {np.mean(speed):.0f} rpm, {np.min(speed):.0f} to {np.max(speed):.0f}; "
            f"{before:.0f} in the lowest tenth of the collective, {after:.0f} in the highest: the "
            f"governor lets it droop by {round(100.0 * (1.0 - after / before), 1) + 0.0:g} %"
        )


def _speed(one: FlightRecord) -> Real:
    """Return the speed, m/s, (n_time,), to which thrust leads that is tilted off its median."""
    phi, theta, psi = (
        one[name] if name in one else np.zeros(len(one)) for name in ("phi", "theta", "psi")
    )
    right, up = (np.tan(np.clip(one - np.median(one), -1.0, 1.0)) for one in (phi, theta))
    pushed = STANDARD_GRAVITY * (1j * right - up) * np.exp(1j * psi)
    return np.abs(lfilter([one.sample_time], [1.0, -math.exp(-one.sample_time / _BRAKES)], pushed))


def _turning(one: FlightRecord) -> Real:
    """Return the rotor's mean speed over a while, rad/s, (n_time,), ones if nothing told it."""
    return (
        uniform_filter1d(one["rotor_speed"], round(_AVERAGED / one.sample_time), mode="nearest")
        if "rotor_speed" in one and np.any(one["rotor_speed"])
        else np.ones(len(one))
    )
