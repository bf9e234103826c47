"""How often the search finds the delay and the poles of random systems.

Each system is drawn from its seed: poles and zeros log-uniform over the band, damping 0.1 to 1,
one numerator in five in the right half plane, either sign, a delay uniform up to the given one.
Its response with complex white noise of 1 % is fitted with default options. It counts as found
when the delay and every pole are within five standard errors of the truth's, and a share of the
true pole's size for rounding. Draws whose poles no method can tell, by a zero that nearly cancels
one or two that coincide, are replaced: where the errors by the noise of a fit from the truth
(Gauss' law) exceed 5 % of a pole, or the time in which the band's top turns by a tenth of a radian.
"above" counts the search's own misses: fits whose cost is above that of a descent from the truth.

    python scripts/proof/delay_study.py                  every case of the list below, three seeds
    python scripts/proof/delay_study.py --case 1/2 --delay 0.28 --seed 7
    python scripts/proof/delay_study.py --case lynx --delay 0.5 --flipped 0.2

`rollpitch` is Wu and Chen's model, its starts the built-in structure's; aircraft of tests/recovery
are the published ones, their starts powers of ten of the right sign. `--flipped` gives a share of
those starts the wrong sign.
"""

import itertools
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import common
import numpy as np
from scipy.optimize import linear_sum_assignment

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "recovery"))
from fleet import FLEET

import helisim as hs
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import linear, response
from helisim.ident.search import Start, descend
from helisim.study.paper import published

POINTS, NOISE = 100, 0.01
# A value counts as found within so many standard errors (which are estimated themselves, from the
# residuals of 20 points, and 60 systems have several hundred of them) and such a share of a pole's
# size, and of a radian at the band's top.
ERRORS, SHARE = 5.0, 0.01
BAND, ROTOR_BAND = (0.1, 10.0), (1.5, 40.0)
_TRANSFER = ("0/1", "1/2", "0/3", "2/3", "2/4", "3/4", "4/6")
CASES = (("1/2", 0.28), ("rollpitch", 0.28))
CASES += tuple((name, 0.5) for name in (*_TRANSFER, "rollpitch", *FLEET))


@dataclass(frozen=True, eq=False)
class Case:
    """A random system: the structure to fit, its true parameters, its delays, its response."""

    structure: hs.Structure
    truth: dict[str, float]
    delays: tuple[str, ...]
    data: hs.FrequencyResponse

    @classmethod
    def of(
        cls,
        random: np.random.Generator,
        structure: hs.Structure,
        truth: dict[str, float],
        delays: tuple[str, ...],
        band: tuple[float, float],
    ) -> "Case":
        """Return the case with the noise of its response over a band, rad/s."""
        frequency = np.geomspace(*band, POINTS)
        exact = response(structure, truth, frequency)
        size = np.max(np.abs(exact), axis=2, keepdims=True)
        exact[np.broadcast_to(size < 1e-9 * np.max(size), exact.shape)] = 0.0
        wobble = random.standard_normal(exact.shape) + 1j * random.standard_normal(exact.shape)
        names = {"inputs": structure.inputs, "outputs": structure.outputs}
        data = hs.FrequencyResponse.exact(frequency, exact * (1.0 + NOISE * wobble), **names)
        return cls(structure, {one.name: truth[one.name] for one in structure.free}, delays, data)

    @property
    def cost(self) -> Cost:
        points = select(self.data, self.structure, band=None, responses=None, count=20)
        return Cost(self.structure, points)

    def told(self, values: dict[str, float]) -> np.ndarray:
        delays = [values[name] for name in self.delays]
        return np.array([*delays, *linear(self.structure, values).poles])

    def sizes(self) -> np.ndarray:
        told = np.abs(self.told(self.truth))
        told[: len(self.delays)] = 1.0 / self.data.frequency[-1]
        return told

    def errors(self, values: dict[str, float], covariance: np.ndarray) -> np.ndarray:
        here, rows = self.told(values), []
        for name in self.truth:
            step = 1e-6 * max(abs(values[name]), 1e-3)
            moved = self.told({**values, name: values[name] + step})
            rows.append((matched(moved, here) - here) / step)
        slope = np.array(rows)
        parts = [np.einsum("ik,ij,jk->k", one, covariance, one) for one in (slope.real, slope.imag)]
        return np.sqrt(np.max(parts, axis=0))

    def can_be_told(self) -> bool:
        ratio, jacobian = self.cost.ratio(np.array(list(self.truth.values())))
        step = np.concatenate([(jacobian / ratio).real, (jacobian / ratio).imag], axis=1) / NOISE
        size = np.linalg.norm(step, axis=1)
        scaled = np.linalg.pinv((step / size[:, None]) @ (step / size[:, None]).T, hermitian=True)
        limit = np.full(self.sizes().size, 0.05)
        limit[: len(self.delays)] = 0.1
        found = self.errors(self.truth, scaled / np.outer(size, size))
        return bool(np.all(found <= limit * self.sizes()))

    def found(self, fit: hs.Fit) -> bool:
        told = self.told(fit.values)
        stated = np.array([fit[name].standard_error for name in self.truth])
        covariance = fit.correlation * np.outer(stated, stated)
        allowed = ERRORS * self.errors(fit.values, covariance) + SHARE * self.sizes()
        return bool(np.all(np.abs(told - matched(self.told(self.truth), told)) <= allowed))

    def above(self, fit: hs.Fit) -> bool:
        truth = np.array(list(self.truth.values()))
        near = descend(self.cost, Start(truth, truth[:0]))
        return fit.cost * len(fit.costs) > 1.001 * near.cost + 1e-6


def matched(found: np.ndarray, to: np.ndarray) -> np.ndarray:
    _, columns = linear_sum_assignment(np.abs(found[None, :] - to[:, None]))
    return found[columns]


def roots(random: np.random.Generator, number: int, band: tuple[float, float]) -> np.ndarray:
    drawn: list[complex] = []
    while len(drawn) < number:
        size = np.exp(random.uniform(*np.log(band)))
        if number - len(drawn) >= 2 and random.random() < 0.6:
            damping = random.uniform(0.1, 1.0)
            root = size * complex(-damping, np.sqrt(1.0 - damping**2))
            drawn += [root, root.conjugate()]
        else:
            drawn.append(complex(-size))
    return np.array(drawn)


def transfer_case(name: str, delay: float, seed: int, _flipped: float) -> Case:
    zeros, poles = map(int, name.split("/"))
    random = np.random.default_rng([zeros, poles, seed])
    inner = (1.5 * BAND[0], BAND[1] / 1.5)
    den = np.real(np.poly(roots(random, poles, inner)))
    over = roots(random, zeros, inner) * (-1.0 if random.random() < 0.2 else 1.0)
    gain = np.exp(random.normal()) * random.choice([-1.0, 1.0])
    num = gain * np.atleast_1d(np.real(np.poly(over)))
    truth = {f"b{k}": float(b) for k, b in enumerate(num[::-1])}
    truth |= {f"a{k}": float(a) for k, a in enumerate(den[::-1][:poles])}
    truth["tau"] = random.uniform(0.0, delay)
    structure = hs.structures.transfer_function(zeros=zeros, poles=poles, input="u", output="y")
    return Case.of(random, structure, truth, ("tau",), BAND)


def rotor_case(_name: str, delay: float, seed: int, _flipped: float) -> Case:
    random = np.random.default_rng([99, seed])
    structure, delays = hs.structures.rollpitch, ("tau_lat", "tau_lon")
    paper = published("jr700")["rollpitch_in1"]
    truth = {name: paper[name].value * np.exp(0.3 * random.normal()) for name in structure.names}
    truth |= {name: random.uniform(0.0, delay) for name in delays}
    return Case.of(random, structure, truth, delays, ROTOR_BAND)


def aircraft_case(name: str, delay: float, seed: int, flipped: float) -> Case:
    random = np.random.default_rng([98, seed, *name.encode()])
    aircraft = FLEET[name]()
    free = aircraft.structure.free
    delays = tuple(p.name for p in free if p.name.startswith("tau") and p.limits[0] < 0.0)
    structure = aircraft.structure.with_bounds(dict.fromkeys(delays, (-0.3, 5.0)))
    truth = dict(aircraft.truth)
    truth |= {p.name: truth[p.name] * np.exp(0.15 * random.normal()) for p in free}
    truth |= {n: random.uniform(0.0, delay) for n in delays}
    wrong = [p for p in structure.free if p.bounds is None and random.random() < flipped]
    structure = structure.with_starts({p.name: -p.start for p in wrong})
    low, high = zip(*(sweep.band for sweep in aircraft.sweeps))
    return Case.of(random, structure, truth, delays, (2.0 * min(low), max(high) / 1.5))


def study(name: str, delay: float, seed: int, number: int, flipped: float = 0.0) -> int:
    own = dict.fromkeys(FLEET, aircraft_case) | {"rollpitch": rotor_case}
    make = own.get(name, transfer_case)
    cases = (make(name, delay, each, flipped) for each in itertools.count(100_000 * seed))
    told = (case for case in cases if case.can_be_told())
    hits, high, unwarned, used = 0, 0, 0, 0.0
    for case in itertools.islice(told, number):
        begun = time.process_time()
        fit = hs.identify(case.data, case.structure)
        used += time.process_time() - begun
        missed = not case.found(fit)
        hits += not missed
        high += case.above(fit)
        unwarned += missed and fit.searches_agreeing >= 2
    print(
        f"{name:<12}delays to {delay:<6g}seed {seed:<4d}{hits:5d} of {number} found, "
        f"{high} above, {unwarned} missed without a warning, {used / number:.3f} s each",
        flush=True,
    )
    return hits


def main(
    *, case: str = "", delay: float = 0.28, count: int = 60, seed: int = 0, flipped: float = 0.0
) -> None:
    for name, late in [(case, delay)] if case else CASES:
        for one in [seed] if seed else range(1, 4):
            study(name, late, one, count, flipped)


if __name__ == "__main__":
    common.run(main)
