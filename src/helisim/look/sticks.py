"""What an ArduCopter-heli's flight without sweeps tells of it: rates over the mixer's commands.

The targets of attitude, which the pilot's sticks or AutoTune move, are the references of the joint
input-output method, so neither the loops nor gusts bias the responses (M. B. Tischler and R. K.
Remple, Aircraft and Rotorcraft System Identification, 2nd ed., 2012, section 8.5).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from helisim.base.arrays import Complex, Real
from helisim.base.errors import LogError
from helisim.handling.arducopter import COMMANDS
from helisim.ident import USABLE_COHERENCE
from helisim.ident.frf import estimated
from helisim.logs.dataflash import DataFlash
from helisim.look.loops import LOGGED, line
from helisim.look.sweeps import told_states
from helisim.records.missing import in_gaps
from helisim.records.quality import stretches
from helisim.records.record import ATTITUDES, RATES, STICKS, Channel, FlightRecord

_STEP = 0.02  # s of a sample, an average of what was logged meanwhile
# _SLOWEST: s between messages of RATE, beyond which nothing of this is seen
# _BAND: rad/s
_SLOWEST, _BAND = 0.15, (1.5, 40.0)
_FLOWN = 0.01  # standard deviation of a response in flight from that at trim, as a share
_A_PERIOD = 5.0  # samples at the highest frequency, at least
_AROUND = 3.0  # s before and after what moves a target, and after lift-off, before landing
_MOVES, _SHORTEST = 0.1, 10.0  # of the fastest move of the same target, from which it moves; s
_WHOLE = 10.0 * np.pi / _BAND[0]  # s: five windows, each of a period of the lowest frequency
_SET = "set LOG_BITMASK's bits 0 and 1"


@dataclass(frozen=True, eq=False)
class StickResponse:
    """A vehicle's rates and attitudes over its mixer's commands as a flight shows them; `Linear`.

    `rates` are p, q, r, rad/s, over commands of roll, pitch and yaw, 1 being full, (3, 3, n_freq),
    `errors` their standard deviations; `coherence` is that of each rate with all commands, (3,
    n_freq). Attitudes are integrals of rates. Beyond `frequency`, (n_freq,) rad/s, its ends hold.
    `start`, s since power-on of the first log, is ahead of what moved.
    """

    start: float
    frequency: Real
    rates: Complex
    errors: Real
    coherence: Real

    inputs = COMMANDS
    outputs = (*RATES, *ATTITUDES)

    def response(self, frequency: Real) -> Complex:
        """Return the response, (6, 3, n_freq), at frequencies, (n_freq,) rad/s."""
        known, flat = np.log(self.frequency), self.rates.reshape(9, -1)
        rates = np.array([np.interp(np.log(frequency), known, one) for one in flat])
        rates = rates.reshape(3, 3, -1)
        return np.concatenate([rates, rates / (1j * np.asarray(frequency))])

    def draws(self, count: int, *, seed: int = 1) -> list[Self]:
        """Return responses as likely as this one, whose errors are alike over the band."""
        real, imaginary = np.random.default_rng(seed).standard_normal((2, count, 3, 3, 1))
        return [
            replace(self, rates=self.rates + self.errors * one) for one in real + 1j * imaginary
        ]

    def seen(self, axis: str) -> Real:
        """Return the frequencies, (n_freq,) rad/s, of the widest band with an axis coherent."""
        coherent = self.coherence[COMMANDS.index(axis)] >= USABLE_COHERENCE
        parts = [self.frequency[a:b] for a, b in stretches(coherent)]
        return max(parts, key=len, default=np.zeros(0))


def stick_response(logs: Sequence[DataFlash]) -> StickResponse:
    """Return what flights without sweeps tell of their vehicle.

    Raises LogError if messages are missing or no target of attitude moves in flight, and
    IdentificationError if the parts of the flights are too short or commands moved as one.
    """
    parts = [one for log in logs for one in _records(log)]
    if (flown := sum(one.duration for _, one in parts)) < _WHOLE:
        raise LogError(
            f"{logs[0].named}a target of attitude moves in flight for {flown:.3g} s, in parts of "
            f"{_SHORTEST:g} s or more; expected {_WHOLE:.3g} s or more"
        )
    starts, records = zip(*parts)
    slowest = _A_PERIOD * max(one.sample_time for one in records)
    found = estimated(
        records,
        inputs=COMMANDS,
        outputs=RATES,
        reference=[STICKS[one] for one in COMMANDS],
        band=(_BAND[0], min(_BAND[1], 2.0 * np.pi / slowest)),
    )
    return StickResponse(
        starts[0],
        found.frequency,
        found.response,
        np.abs(found.response) * np.hypot(found.random_error, _FLOWN),
        found.multiple_coherence,
    )


def _records(log: DataFlash) -> list[tuple[float, FlightRecord]]:
    """Return the parts of a flight in which a target of attitude moves, and when they begin, s."""
    angles = "ANG" if "ANG" in log else "ATT"
    if lost := [name for name in ("RATE", angles) if name not in log]:
        raise LogError(f"{log.path}: no messages {' and '.join(lost)} in it: {_SET}")
    rate, aim = log.table("RATE"), log.table(angles)
    usual = float(np.median(np.diff(np.unique(rate.time)))) if len(rate) > 2 else np.inf
    if not usual < _SLOWEST:
        raise LogError(
            f"{log.path}: RATE is logged each {usual:.3g} s; expected {_SLOWEST:g} s or less: "
            f"{_SET}"
        )
    period = float(max(_STEP, usual))
    edges = np.arange(max(rate.time[0], aim.time[0]), min(rate.time[-1], aim.time[-1]), period)
    time = edges[:-1] + 0.5 * period
    sent, turned, aims = [], [], []
    for output, _, angle in LOGGED.values():
        sent.append(_mean(*line(rate.time, rate[output]), edges))
        turned.append(_mean(*line(rate.time, np.radians(rate[output[0]])), edges))
        asked = np.unwrap(np.asarray(aim[angle], np.float64), period=360.0)
        aims.append(np.gradient(_mean(*line(aim.time, np.radians(asked)), edges), period))
    moves = np.any([np.abs(one) > _MOVES * np.abs(one).max(initial=1e-9) for one in aims], axis=0)
    near = np.convolve(moves, np.ones(2 * round(_AROUND / period) + 1), "same") > 0.5
    used = near & flies(log, time) & ~in_gaps(np.unique(rate.time), time, period)
    names = (*COMMANDS, *RATES, *(STICKS[one] for one in COMMANDS))
    channels = tuple(Channel(name, "1", "OTHER") for name in names)
    columns = np.column_stack([*sent, *turned, *aims])
    made, steps = {"made_by": "ArduCopter"}, np.arange(time.size, dtype=np.float64) * period
    return [
        (float(time[a]), FlightRecord(steps[: b - a], columns[a:b], channels, made))
        for a, b in stretches(used)
        if (b - a) * period >= _SHORTEST
    ]


def _mean(stamps: Real, values: Real, edges: Real) -> Real:
    """Return means of a signal between edges, (n_edge - 1,)."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(stamps)
    return np.diff(np.interp(edges, stamps, np.append(0.0, np.cumsum(steps)))) / np.diff(edges)


def flies(log: DataFlash, time: Real) -> NDArray[np.bool_]:
    """Return whether it flew at times, (n_time,) s since power-on, by what the autopilot said."""
    states = told_states(log)
    if not states:
        return np.ones(time.size, np.bool_)
    lies = np.array([not states[0][1], *(bool(word) for _, word in states)])
    at = [one for one, _ in states]
    sides = (np.searchsorted(at, time + late, side="right") for late in (-_AROUND, _AROUND))
    return ~np.logical_or(*(lies[one] for one in sides))
