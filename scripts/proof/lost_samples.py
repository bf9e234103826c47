"""Logs of ArduPilot's mode SystemID that lost messages, beside the whole ones.

In bursts of 20 to 250 ms, one by one, or as a full buffer loses them, four of five in bursts of 5
to 80 ms: what `helisim identify` and `helisim margins` tell of the rest stands beside what they
tell of the whole log. Truths without samples: `python scripts/proof/verdicts.py --only lost`.

    python scripts/proof/lost_samples.py LOG [LOG ...] [--seeds 2] [--only bursts]

A bound is the Cramer-Rao bound that is printed beside a value. The exit status is 1 if a value lies
outside its bound or a figure's interval doesn't hold that of the whole log.
"""

import tempfile
from pathlib import Path

import common
import numpy as np
from verdicts import lost

import helisim as hs
from helisim.handling.measured.interval import Interval
from helisim.look.loops import flown_loops
from helisim.look.systemid import estimate_fits, infer

CASES = (("bursts", 0.16), ("single", 0.08), ("single", 0.28), ("buffer", 0.18), ("buffer", 0.28))
KEPT = {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "MODE", "SIDS", "VER", "DSF"}


def cut(source: Path, target: Path, kind: str, share: float, seed: int) -> None:
    """Write a DataFlash log without some of its messages; those that are written once stay."""
    log, dice = hs.DataFlash(source), np.random.default_rng(seed)
    found = [
        (places, np.full(places.size, layout.length), log.time(name, places))
        for name, (layout, places) in log._types.items()
        if layout.clock and name not in KEPT
    ]
    place, length, time = map(np.concatenate, zip(*found))
    order = np.argsort(place)
    gone = lost(time[order], kind, share, dice)
    data = np.fromfile(source, np.uint8)
    away = np.zeros(data.size + 1, np.int8)
    away[place[order][gone]] += 1
    np.add.at(away, (place + length)[order][gone], -1)
    data[np.cumsum(away[:-1], dtype=np.int8) == 0].tofile(target)


def fits(log: Path) -> dict[str, hs.Fit]:
    """Return what a log identifies, by structure."""
    found = infer(log)
    records = [record for one in found.read() for record in one.records]
    return {
        fit.structure: hs.identify(frf, hs.structures.named(fit.structure), band=fit.band)
        for fit, frf in zip(found.fits, estimate_fits(records, found.fits))
        if not fit.structure.startswith("tf:")  # of other parameters than a vehicle's
    }


def figures(log: Path) -> dict[tuple[str, str], Interval]:
    found = flown_loops(log).margins().figures
    return {(one.axis, one.name): one.interval for one in found}


def of_log(source: Path, target: Path, whole: dict[str, hs.Fit], loops: dict) -> tuple[str, bool]:
    """Return what a log tells beside the whole one's fits and figures, and whether all is held."""
    worst, within, words = 0.0, [], []
    for name, fit in fits(target).items():
        words.append(fit.verdict.word)
        for one in fit.parameters.values():
            if one.definition.fixed:
                continue
            true = whole[name][one.name]
            off = abs(one.value - true.value)
            errors = off / float(np.hypot(one.standard_error, true.standard_error))
            within.append((off <= one.cramer_rao, errors <= 2.0))
            worst = max(worst, errors)
    inside, near = map(sum, zip(*within))
    seen = [(loops[key].value, one) for key, one in figures(target).items() if key in loops]
    held = sum(one.low <= value <= one.high for value, one in seen)
    text = (
        f"{inside} of {len(within)} inside their bounds, {near} within two errors, the worst at "
        f"{worst:.1f}; {held} of {len(seen)} figures inside ({len(loops)} of {source.name}); "
        f"{', '.join(words)}"
    )
    return text, inside == len(within) and held == len(seen)


def main(*logs: Path, seeds: int = 2, only: str = "") -> int:
    missed, cases = 0, [one for one in CASES if common.wanted(only, one[0])]
    for log in logs:
        with common.quiet(), tempfile.TemporaryDirectory() as folder:
            whole, loops, target = fits(log), figures(log), Path(folder, log.name)
            for kind, share, seed in ((*case, seed) for case in cases for seed in range(seeds)):
                cut(log, target, kind, share, seed)
                text, held = of_log(log, target, whole, loops)
                missed += not held
                print(f"{log.name:18s}{kind:8s}{share:5.0%} seed {seed}  {text}", flush=True)
    print(f"not held: {missed}")
    return int(missed > 0)


if __name__ == "__main__":
    common.run(main)
