"""Verdicts beside truths: clean flights are to be "sound", damaged ones are not, or unharmed.

Seven truths that the package has no part in are simulated at 1 kHz by SciPy's matrix exponential
and recorded at 100 Hz with noise; 28 kinds of damage are done to the first, and all lose samples,
in bursts of 20 to 250 ms or one by one. A wrong number said with confidence is a main parameter
more than three stated errors (and 1 %) off in a fit that is "sound", unless the record can't show
the damage: a fit that has the missing part finds it within three errors of nothing; counted apart.

    python scripts/proof/verdicts.py [--seeds 10] [--clean 34] [--only saturates,clock]

The exit status is 1 if a fit is sound and wrong, or 2 % of the clean ones are not sound.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import common
import numpy as np

import helisim as hs
from helisim.base.errors import HelisimError
from helisim.base.linear import zero_order_hold
from helisim.ident.evaluate import linear
from helisim.ident.structure import with_blocks

FINE, EVERY = 1e-3, 10  # s of the simulation's step; samples of it between those recorded
ERRORS, SHARE = 3.0, 0.01  # stated errors, and share of the value, from which a parameter is wrong
LENGTHS, SPILT = {"bursts": (0.02, 0.25), "buffer": (0.005, 0.08)}, 0.8  # s; share of a buffer's
ALLOWED = 0.02  # share of clean flights that may not be sound
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Truth:
    """A structure with values and what verdicts.toml says of it; sweeps of `length` s."""

    structure: hs.Structure
    values: Mapping[str, float]
    main: tuple[str, ...]
    noise: float
    size: float = 0.1
    band: tuple[float, float] = (0.5, 40.0)
    length: float = 60.0
    law: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


TRUTHS = common.truths(Path(__file__).with_suffix(".toml"), Truth)


def sweep(length: float, band: tuple[float, float], size: float, seed: int) -> np.ndarray:
    """Return an exponential sweep with the hand's noise and a rest of 3 s at both ends."""
    time = np.arange(0.0, length, FINE)
    phase, fade = common.swept(time, length, 0.6 * band[0], 1.2 * band[1])
    hand = np.cumsum(np.random.default_rng(seed).normal(size=time.size)) * FINE**0.5
    hand -= np.convolve(hand, np.ones(4001) / 4001, "same")
    return size * fade * np.sin(phase) + 0.05 * size * fade * hand


def fly(
    truth: Truth,
    axis: str,
    seed: int,
    actuator: Callable[[np.ndarray], np.ndarray] = np.copy,
    values: Mapping[str, float] | None = None,
    noise: float | None = None,
) -> Columns:
    """Return what a flight computer records of a sweep of one axis, inputs at the command."""
    structure, size = truth.structure, truth.noise if noise is None else noise
    dice = np.random.default_rng([seed, structure.inputs.index(axis)])
    model = linear(structure, structure.starts | dict(truth.values if values is None else values))
    late, law = list(model.delays.values()), common.law_of(truth, structure.states)
    asked = np.stack([
        sweep(truth.length, truth.band, truth.size * (1.0 if name == axis else 0.1), k)
        for name, k in zip(structure.inputs, dice.integers(1 << 30, size=len(structure.inputs)))
    ])  # fmt: skip
    driven = np.stack([_late(actuator(u), s) for u, s in zip(asked, late)])
    ad, bd = zero_order_hold(model.a, model.b, FINE)
    path, state = np.empty((asked.shape[1], len(ad))), np.zeros(len(ad))
    steps = [round(one / FINE) for one in late]
    for k, push in enumerate((bd @ driven).T):
        path[k], state = state, ad @ state + push
        if truth.law:
            state += bd @ [own @ path[max(k - n, 0)] for own, n in zip(law, steps)]
    back = law @ path.T
    driven += [_late(u, n * FINE) for u, n in zip(back, steps)]
    out = path @ model.c.T + driven.T @ model.d.T
    columns = {name: u[::EVERY].copy() for name, u in zip(structure.inputs, asked + back)}
    for (name, s), y in zip(model.output_delays.items(), out.T):
        columns[name] = _late(y, s)[::EVERY] + dice.normal(0.0, size, out[::EVERY].shape[0])
    for rate, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if rate in structure.outputs:
            exact = np.cumsum(out[:, structure.outputs.index(rate)]) * FINE
            columns[angle] = exact[::EVERY] + dice.normal(0.0, 0.1 * size, columns[rate].size)
    return columns


def _late(values: np.ndarray, delay: float) -> np.ndarray:
    time = np.arange(values.size) * FINE
    return np.interp(time - delay, time, values)


def record(columns: Columns, step: float = FINE * EVERY) -> hs.FlightRecord:
    return common.record(np.arange(len(next(iter(columns.values())))) * step, columns)


def each(truth: Truth) -> list[tuple[str, int]]:
    """Return the axis and number of two sweeps of each axis."""
    return [(axis, k) for axis in truth.structure.inputs for k in (0, 1)]


def flights(truth: Truth, seed: int, **how) -> list[hs.FlightRecord]:
    return [record(fly(truth, axis, 10 * seed + k, **how)) for axis, k in each(truth)]


def changed(change: Callable[..., Columns], without: tuple[str, ...] = (), step=0.01):
    """Return a damage that changes recorded columns, by seed and number of the flight."""

    def damage(truth: Truth, seed: int) -> list[hs.FlightRecord]:
        flown = (fly(truth, axis, 10 * seed + k) for axis, k in each(truth))
        found = (change(one, seed, n) for n, one in enumerate(flown))
        return [record({n: v for n, v in c.items() if n not in without}, step) for c in found]

    return damage


def mapped(change: Callable[[np.ndarray], np.ndarray], names: tuple[str, ...], **how):
    """Return a damage that changes each of some columns."""
    return changed(lambda c, *_: {n: change(v) if n in names else v for n, v in c.items()}, **how)


def within(change: Callable[[np.ndarray], np.ndarray]):
    """Return a damage between the command and the vehicle."""
    return lambda truth, seed: flights(truth, seed, actuator=change)


def exchanged(one: str, other: str):
    swap = {one: other, other: one}
    return changed(lambda c, *_: {swap.get(n, n): v for n, v in c.items()})


def two_trims(truth: Truth, seed: int) -> list[hs.FlightRecord]:
    trims = truth.values, dict(truth.values) | {"L_b": 110.0}
    return [record(fly(truth, axis, 10 * seed + k, values=trims[k])) for axis, k in each(truth)]


def walked(u: np.ndarray, move: Callable[[float, float], float]) -> np.ndarray:
    """Return what follows u, each value made of the one before and of u."""
    out, at = np.empty_like(u), 0.0
    for k, x in enumerate(u):
        out[k] = at = move(at, x)
    return out


def lag(u: np.ndarray, tau: float = 0.03) -> np.ndarray:
    share = 1.0 - np.exp(-FINE / tau)
    return walked(u, lambda at, x: at + share * (x - at))


def dropped(c: Columns, seed: int, n: int) -> Columns:
    keep = np.random.default_rng(100 * seed + n % 2).random(c["p"].size) > 0.02
    return {n: v[keep] for n, v in c.items()}


def bursts(c: Columns, seed: int, n: int, share: float = 0.16) -> Columns:
    """Lose bursts of 20 to 250 ms, all columns at once, filled by straight lines."""
    dice, k = np.random.default_rng(100 * seed + n % 2), np.arange(c["p"].size)
    known = np.ones(k.size, bool)
    while known.mean() > 1.0 - share:
        at = dice.integers(1, k.size - 30)
        known[at : at + dice.integers(2, 26)] = False
    return {name: np.interp(k, k[known], v[known]) for name, v in c.items()}


def lost(time: np.ndarray, kind: str, share: float, dice: np.random.Generator) -> np.ndarray:
    """Return which of the samples at (n_time,) s are lost, about a share of them."""
    if kind == "single":
        return dice.random(time.size) < share
    spilt = SPILT if kind == "buffer" else 1.0
    first, last = float(time.min()), float(time.max())
    away = np.zeros(int(1e3 * (last - first)) + 2, bool)
    while away.mean() < share / spilt:
        at = int(dice.integers(away.size))
        away[at : at + round(1e3 * dice.uniform(*LENGTHS[kind]))] = True
    return away[(1e3 * (time - first)).astype(int)] & (dice.random(time.size) < spilt)


def losing(kind: str, share: float):
    """Return a damage that leaves samples out in all columns at once, as a log is read then."""

    def damage(truth: Truth, seed: int) -> list[hs.FlightRecord]:
        dice, found = np.random.default_rng([seed, round(100 * share)]), []
        for one in flights(truth, seed):
            keep = ~lost(one.time, kind, share, dice)
            keep[[0, -1]] = True
            left = hs.FlightRecord(one.time[keep], one.values[keep], one.channels)
            found += hs.screen(left, resample_hz=1.0 / one.sample_time, max_gap=1.0).records
        return found

    return damage


def gusts(c: Columns, seed: int, n: int) -> Columns:
    dice, found = np.random.default_rng([seed, n]), dict(c)
    for name in ("p", "q"):
        push = dice.normal(size=c[name].size)
        for _ in range(2):
            push = np.convolve(push, np.exp(-np.arange(200) / 50.0), "same")
        found[name] = c[name] + 0.3 * push / push.std()
    return found


def now_and_then(v: np.ndarray) -> np.ndarray:
    k = np.arange(v.size)
    return v[np.maximum.accumulate(np.where(np.isin(k % 9, (0, 2, 6)), k, 0))]


def walks(move: Callable[[float, float], float]):
    return within(lambda u: walked(u, move))


RATES, ANGLES = ("p", "q"), ("phi", "theta")
DAMAGES = {
    "saturates at half": within(lambda u: np.clip(u, -0.05, 0.05)),
    "softens with size": within(lambda u: 0.1 * np.tanh(u / 0.1) * 0.9),
    "one side weaker": within(lambda u: np.where(u > 0.0, u, 0.7 * u)),
    "dead zone": within(lambda u: u - np.clip(u, -0.02, 0.02)),
    "hysteresis": walks(lambda at, x: min(max(at, x - 0.02), x + 0.02)),
    "rate limit": walks(lambda at, x: at + min(max(x - at, -0.8 * FINE), 0.8 * FINE)),
    "p and q swapped": exchanged("p", "q"),
    "lat and lon swapped": exchanged("lat", "lon"),
    "servo lag missing": lambda t, s: flights(t, s, actuator=lag, noise=0.052),
    "servo lag, quiet": within(lag),
    "two trims": two_trims,
    "clock 10 % fast": changed(lambda c, *_: c, step=0.009),
    "clock 20 % fast": changed(lambda c, *_: c, step=0.008),
    "rates in deg/s": mapped(np.degrees, RATES),
    "rates in deg/s, no attitude": mapped(np.degrees, RATES, without=(*ANGLES, "psi")),
    "2 % dropped, restamped": changed(dropped),
    "16 % lost in bursts, filled": changed(bursts),
    "p of the wrong sign": mapped(np.negative, ("p",)),
    "attitude in degrees": mapped(np.degrees, ANGLES),
    "gusts": changed(gusts),
    "rate 20 % off": mapped(lambda v: 1.2 * v, ("p",)),
    "output filter of 40 ms": mapped(lambda v: lag(np.repeat(v, EVERY), 0.04)[::EVERY], RATES),
    "motion clipped": mapped(lambda v: v.clip(-(most := 0.4 * abs(v).max()), most), RATES),
    "logged at a fifth": mapped(lambda v: v[::5].repeat(5)[: v.size], RATES),
    "commands logged at a fifth": mapped(lambda v: v[::5].repeat(5)[: v.size], ("lat", "lon")),
    "logged now and then": mapped(now_and_then, RATES),
    "frozen at the end": mapped(lambda v: np.append(v[:-900], v[-900].repeat(900)), RATES),
    "time shift of outputs": mapped(lambda v: np.roll(v, -6), (*RATES, *ANGLES, "psi")),
}
_LAG = {"lat,lon": "first_order:name=missing"}
LOST = {
    f"{share:.0%} lost, {kind}": losing(kind, share)
    for kind, share in (("bursts", 0.16), ("single", 0.08), ("single", 0.28))
}
MISSING = {"servo lag missing": _LAG, "servo lag, quiet": _LAG}
"""What a structure lacks of a damaged vehicle, in series; the record decides whether it shows."""


class Judged(NamedTuple):
    """A fit's verdict, its reasons, and the worst main parameter in stated errors and as share.

    `shown` is the part that the structure lacks, found by a fit that has it, over its error.
    """

    word: str
    reasons: tuple[str, ...]
    errors: float = 0.0
    share: float = 0.0
    shown: float = np.inf

    @property
    def misled(self) -> bool:
        """Whether it is sound, and a main parameter is wrong."""
        return self.word == "sound" and self.errors > ERRORS


def judged(
    truth: Truth, records: list[hs.FlightRecord], missing: Mapping[str, str] | None = None
) -> Judged:
    """Identify the records, and return the verdict beside the truth."""
    try:
        frf, fit = common.identified(records, truth.structure, truth.band)
    except HelisimError as error:
        return Judged("refused", (str(error),))
    size = {name: abs(truth.values[name]) for name in truth.main}
    gap = {name: abs(fit[name].value - truth.values[name]) for name in truth.main}
    least = SHARE / ERRORS
    found = Judged(
        fit.verdict.word,
        tuple(note.text for note in fit.verdict.reasons),
        max(gap[name] / max(fit[name].standard_error, least * size[name]) for name in gap),
        max(gap[name] / size[name] for name in gap),
    )
    if missing and found.misled:
        with common.quiet():
            lag = hs.identify(frf, with_blocks(truth.structure, missing))["missing_tau"]
        found = found._replace(shown=abs(lag.value) / lag.standard_error)
    return found


def main(*, seeds: int = 10, clean: int = 34, only: str = "") -> int:
    cases = [(name, "rollpitch", damage, seeds) for name, damage in DAMAGES.items()]
    lossy = [(f"{how}, {name}", name, one) for how, one in LOST.items() for name in TRUTHS]
    cases += [(*one, min(seeds, 2)) for one in lossy]
    cases += [(f"clean {name}", name, flights, clean) for name in TRUTHS]
    cases = [one for one in cases if one[3] and common.wanted(only, one[0])]
    wrong = hidden = flown = unsound = 0
    print(f"{'damage':28s}  verdicts; sound yet wrong; worst error, stated errors and share")
    for name, truth, damage, count in cases:
        one, missing = TRUTHS[truth], MISSING.get(name)
        found = [judged(one, damage(one, seed), missing) for seed in range(count)]
        words = [one.word for one in found]
        bad = sum(one.misled and one.shown > ERRORS for one in found)
        unseen = sum(one.misled for one in found) - bad
        wrong, hidden = wrong + bad, hidden + unseen
        if damage is flights:
            flown, unsound = flown + count, unsound + count - words.count("sound")
        worst = max(found, key=lambda one: one.errors)
        off = f"{worst.errors:.1f}, {100 * worst.share:.1f} %"
        off += f"; {unseen} more that the record can't show" if unseen else ""
        print(f"{name:28s}  {common.counted(words)}; {bad}; {off}")
        print(*(f"    {one}\n" for one in found[0].reasons[:1]), sep="", end="", flush=True)
    print(f"sound yet wrong: {wrong}, and {hidden} by what records can't show")
    print(f"clean and not sound: {unsound} of {flown}")
    return int(wrong > 0 or unsound > ALLOWED * flown)


if __name__ == "__main__":
    common.run(main)
