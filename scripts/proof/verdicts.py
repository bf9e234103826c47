"""Verdicts beside truths: clean flights are to be "sound", damaged ones are not, or unharmed.

Six truths that the package has no part in are simulated at 1 kHz by SciPy's matrix exponential and
recorded at 100 Hz with noise; 22 kinds of damage are done to the first. A wrong number said with
confidence is a main parameter more than three stated errors (and 1 %) off in a fit that is "sound",
unless the record can't show the damage: a fit that has the missing part, where it belongs, finds it
within three errors of nothing. Such fits are counted apart.

    python scripts/proof/verdicts.py [--seeds 10] [--clean 34] [--only saturates,clock]

The exit status is 1 if a fit is sound and wrong, or 2 % of the clean ones are not sound.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import common
import numpy as np
from scipy.signal import cont2discrete

from helisim.base.errors import HelisimError
from helisim.ident import Structure, frequency_response, identify
from helisim.ident.structure import with_blocks
from helisim.records.record import FlightRecord

FINE, EVERY = 1e-3, 10  # s of the simulation's step; samples of it between those recorded
ERRORS, SHARE = 3.0, 0.01  # stated errors, and share of the value, from which a parameter is wrong
ALLOWED = 0.02  # share of clean flights that may not be sound
Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class Truth:
    """A structure with values and what verdicts.toml says of it; sweeps of `length` s."""

    structure: Structure
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
    dice = np.random.default_rng(seed)
    low, high = 0.6 * band[0], 1.2 * band[1]
    span = length - 6.0
    there = np.clip((time - 3.0) / span, 0.0, 1.0)
    share = 0.0187 * (np.exp(4.0 * there) - 1.0)
    phase = np.cumsum(low + share * (high - low)) * FINE
    fade = np.clip(np.minimum(time - 3.0, length - 3.0 - time) / 2.0, 0.0, 1.0)
    hand = np.cumsum(dice.normal(size=time.size)) * FINE**0.5
    hand -= np.convolve(hand, np.ones(4001) / 4001, "same")
    return size * fade * np.sin(phase) + 0.05 * size * fade * hand


def fly(
    truth: Truth,
    axis: str,
    seed: int,
    actuator: Callable[[np.ndarray], np.ndarray] | None = None,
    values: Mapping[str, float] | None = None,
    noise: float | None = None,
) -> Columns:
    """Return what a flight computer records of a sweep of one axis, inputs at the command."""
    structure = truth.structure
    numbers = structure.starts | dict(truth.values if values is None else values)
    dice = np.random.default_rng([seed, structure.inputs.index(axis)])
    matrices = structure.matrices(numbers)
    m, f, g = (matrices[key] for key in "MFG")
    a, b = np.linalg.solve(m, f), np.linalg.solve(m, g)
    c = matrices["H0"] + matrices["H1"] @ a
    d = matrices["D"] + matrices["H1"] @ b
    command = {
        name: sweep(truth.length, truth.band, truth.size * (1.0 if name == axis else 0.1), k)
        for name, k in zip(structure.inputs, dice.integers(1 << 30, size=len(structure.inputs)))
    }
    ad, bd, *_ = cont2discrete((a, b, c, d), FINE, "zoh")
    law = common.law_of(truth, structure.states)
    state, asked = np.zeros(len(a)), np.stack(list(command.values()))
    path = np.empty((asked.shape[1], len(a)))
    if truth.law:  # without delay inside: what it commands is known as it goes
        assert actuator is None
        steps = np.rint(matrices["input_delays"].ravel() / FINE).astype(int)
        for k in range(asked.shape[1]):
            path[k] = state
            asked[:, k] += law @ state
            state = ad @ state + bd @ [asked[n, max(k - m, 0)] for n, m in enumerate(steps)]
        driven = np.stack([_late(u, m * FINE) for u, m in zip(asked, steps)])
        command = dict(zip(command, asked))
    else:
        late = matrices["input_delays"].ravel()
        act = actuator or (lambda u: u)
        driven = np.stack([_late(act(u), s) for u, s in zip(asked, late)])
        for k, u in enumerate((bd @ driven).T):
            path[k] = state
            state = ad @ state + u
    out = path @ c.T + driven.T @ d.T
    size = truth.noise if noise is None else noise
    late = matrices["output_delays"].ravel()
    columns = {name: u[::EVERY].copy() for name, u in command.items()}
    for name, y, s in zip(structure.outputs, out.T, late):
        columns[name] = _late(y, s)[::EVERY] + dice.normal(0.0, size, out[::EVERY].shape[0])
    for rate, angle in (("p", "phi"), ("q", "theta"), ("r", "psi")):
        if rate in structure.outputs:
            exact = np.cumsum(_late(out[:, structure.outputs.index(rate)], 0.0)) * FINE
            columns[angle] = exact[::EVERY] + dice.normal(0.0, 0.1 * size, columns[rate].size)
    return columns


def _late(values: np.ndarray, delay: float) -> np.ndarray:
    time = np.arange(values.size) * FINE
    return np.interp(time - delay, time, values)


def record(columns: Columns, step: float = FINE * EVERY) -> FlightRecord:
    names = list(columns)
    time = np.arange(columns[names[0]].size) * step
    channels = tuple(map(common.channel_of, names))
    return FlightRecord(time, np.column_stack([columns[name] for name in names]), channels)


def each(truth: Truth) -> list[tuple[str, int]]:
    """Return the axis and number of two sweeps of each axis."""
    return [(axis, k) for axis in truth.structure.inputs for k in (0, 1)]


def flights(truth: Truth, seed: int, **how) -> list[FlightRecord]:
    return [record(fly(truth, axis, 10 * seed + k, **how)) for axis, k in each(truth)]


def changed(change: Callable[[Columns, int], Columns], without: tuple[str, ...] = (), step=0.01):
    """Return a damage that changes recorded columns."""

    def damage(truth: Truth, seed: int) -> list[FlightRecord]:
        flown = (change(fly(truth, axis, 10 * seed + k), 100 * seed + k) for axis, k in each(truth))
        return [record({n: v for n, v in c.items() if n not in without}, step) for c in flown]

    return damage


def mapped(change: Callable[[np.ndarray], np.ndarray], names: tuple[str, ...], **how):
    """Return a damage that changes each of some columns."""
    return changed(lambda c, _: {n: change(v) if n in names else v for n, v in c.items()}, **how)


def within(change: Callable[[np.ndarray], np.ndarray]):
    """Return a damage between the command and the vehicle."""
    return lambda truth, seed: flights(truth, seed, actuator=change)


def exchanged(one: str, other: str):
    swap = {one: other, other: one}
    return changed(lambda c, _: {swap.get(n, n): v for n, v in c.items()})


def two_trims(truth: Truth, seed: int) -> list[FlightRecord]:
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


def hysteresis(u: np.ndarray) -> np.ndarray:
    return walked(u, lambda at, x: min(max(at, x - 0.02), x + 0.02))


def rate_limit(u: np.ndarray) -> np.ndarray:
    return walked(u, lambda at, x: at + min(max(x - at, -0.8 * FINE), 0.8 * FINE))


def dropped(c: Columns, seed: int) -> Columns:
    keep = np.random.default_rng(seed).random(c["p"].size) > 0.02
    return {n: v[keep] for n, v in c.items()}


def bursts(c: Columns, seed: int, share: float = 0.16) -> Columns:
    """Lose bursts of 20 to 250 ms, all columns at once, filled by straight lines."""
    dice, n = np.random.default_rng(seed), c["p"].size
    known = np.ones(n, bool)
    while known.mean() > 1.0 - share:
        at = dice.integers(1, n - 30)
        known[at : at + dice.integers(2, 26)] = False
    k = np.arange(n)
    return {name: np.interp(k, k[known], v[known]) for name, v in c.items()}


def gusts(truth: Truth, seed: int) -> list[FlightRecord]:
    found = []
    for n, one in enumerate(flights(truth, seed)):
        dice = np.random.default_rng([seed, n])
        values = one.values.copy()
        for name in ("p", "q"):
            push = dice.normal(size=len(one))
            for _ in range(2):
                push = np.convolve(push, np.exp(-np.arange(200) / 50.0), "same")
            values[:, one.names.index(name)] += 0.3 * push / push.std()
        found.append(FlightRecord(one.time, values, one.channels))
    return found


RATES, ANGLES = ("p", "q"), ("phi", "theta")
DAMAGES = {
    "saturates at half": within(lambda u: np.clip(u, -0.05, 0.05)),
    "softens with size": within(lambda u: 0.1 * np.tanh(u / 0.1) * 0.9),
    "hysteresis": within(hysteresis),
    "rate limit": within(rate_limit),
    "p and q swapped": exchanged("p", "q"),
    "lat and lon swapped": exchanged("lat", "lon"),
    "servo lag missing": lambda t, s: flights(t, s, actuator=lag, noise=0.052),
    "servo lag, quiet": within(lag),
    "two trims": two_trims,
    "clock 10 % fast": changed(lambda c, _: c, step=0.009),
    "clock 20 % fast": changed(lambda c, _: c, step=0.008),
    "rates in deg/s": mapped(np.degrees, RATES),
    "rates in deg/s, no attitude": mapped(np.degrees, RATES, without=(*ANGLES, "psi")),
    "2 % dropped, restamped": changed(dropped),
    "16 % lost in bursts, filled": changed(bursts),
    "p of the wrong sign": mapped(np.negative, ("p",)),
    "attitude in degrees": mapped(np.degrees, ANGLES),
    "gusts": gusts,
    "rate 20 % off": mapped(lambda v: 1.2 * v, ("p",)),
    "output filter of 40 ms": mapped(lambda v: lag(np.repeat(v, EVERY), 0.04)[::EVERY], RATES),
    "motion clipped": mapped(lambda v: v.clip(-(most := 0.4 * abs(v).max()), most), RATES),
    "time shift of outputs": mapped(lambda v: np.roll(v, -6), (*RATES, *ANGLES, "psi")),
}
MISSING = {
    name: {"lat,lon": "first_order:name=missing"}
    for name in ("servo lag missing", "servo lag, quiet")
}
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
    truth: Truth, records: list[FlightRecord], missing: Mapping[str, str] | None = None
) -> Judged:
    """Identify the records, and return the verdict beside the truth."""
    inputs, outputs = truth.structure.inputs, truth.structure.outputs
    try:
        with common.quiet():
            frf = frequency_response(records, inputs=inputs, outputs=outputs, band=truth.band)
            fit = identify(frf, truth.structure)
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
            lag = identify(frf, with_blocks(truth.structure, missing))["missing_tau"]
        found = found._replace(shown=abs(lag.value) / lag.standard_error)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10, help="of each damage")
    parser.add_argument("--clean", type=int, default=34, help="flights of each truth")
    parser.add_argument("--only", default="", help="parts of names, with commas between")
    o = parser.parse_args()
    cases = [(name, "rollpitch", damage, o.seeds) for name, damage in DAMAGES.items()]
    cases += [(f"clean {name}", name, flights, o.clean) for name in TRUTHS]
    wrong = hidden = clean = unsound = 0
    print(f"{'damage':28s}  verdicts; sound yet wrong; worst error, stated errors and share")
    for name, truth, damage, count in cases:
        if not common.wanted(o.only, name) or not count:
            continue
        missing = MISSING.get(name)
        seeds = (damage(TRUTHS[truth], seed) for seed in range(count))
        found = [judged(TRUTHS[truth], flown, missing) for flown in seeds]
        words = [one.word for one in found]
        bad = sum(one.misled and one.shown > ERRORS for one in found)
        unseen = sum(one.misled for one in found) - bad
        wrong, hidden = wrong + bad, hidden + unseen
        if damage is flights:
            clean, unsound = clean + count, unsound + count - words.count("sound")
        worst = max(found, key=lambda one: one.errors)
        print(
            f"{name:28s}  {common.counted(words)}; {bad}; {worst.errors:.1f}, "
            f"{100 * worst.share:.1f} %"
            + (f"; {unseen} more that the record can't show" if unseen else ""),
            *(f"\n    {one}" for one in found[0].reasons[:1]),
            flush=True,
        )
    print(f"sound yet wrong: {wrong}, and {hidden} by what records can't show")
    print(f"clean and not sound: {unsound} of {clean}")
    return int(wrong > 0 or unsound > ALLOWED * clean)


if __name__ == "__main__":
    sys.exit(main())
