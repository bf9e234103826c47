"""The identified aircraft as a control law sees it: from its servo commands to what it senses.

A fit describes records: late channels are late in it, and a command that a gyro holds between its
ticks acts half a period later than the record says. Here the recorder's latencies are taken out,
the gyro's put in, and the angles follow from the rates.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.linear import LinearSystem, Response, beside
from helisim.base.settings import FrozenMap, Value
from helisim.handling.loop import BY_NAME, NoResponse
from helisim.ident import evaluate
from helisim.ident.result import Fit
from helisim.records.record import ATTITUDES as ANGLES
from helisim.records.record import IN1, RATES, one_blas_thread

Array = NDArray[np.float64]
_INTEGRALS = tuple(f"integral of {rate}" for rate in RATES)


@dataclass(frozen=True, eq=False, repr=False)
class Plant(Value):
    """What identified models say of what a law senses over what it commands; it is `Linear`.

    Of two models with the same output and input the first tells; what none has is 0.

    Attributes:
        fits: identified models, from servo commands ("lat", ...) to rates and the velocity down.
        late: by how much a channel is recorded late, s, by name; 0 where none is given.
        period: s, between the gyro's ticks. Records have the commands as they are given at the
            ticks, so half of it is among a fit's delays already.
        latency: s, from sensing the rates to their use.
        tilt: steady roll and pitch angle, rad, by which body rates turn the angles.
        stick_latency: by how much the law sees a stick late, s, by name; 0 where none is given.
        values: parameters of each fit, where not those that were found, such as drawn ones.
    """

    fits: tuple[Fit, ...]
    late: Mapping[str, float] = field(default_factory=dict)
    period: float = 0.002
    latency: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    stick_latency: Mapping[str, float] = field(default_factory=dict)
    values: tuple[Mapping[str, float], ...] = ()

    def __post_init__(self) -> None:
        fits = tuple(self.fits)
        object.__setattr__(self, "fits", fits)
        object.__setattr__(self, "late", FrozenMap(self.late))
        object.__setattr__(self, "stick_latency", FrozenMap(self.stick_latency))
        values = self.values or tuple(fit.values for fit in fits)
        object.__setattr__(self, "values", tuple(map(FrozenMap, values)))
        if not fits or len(self.values) != len(fits):
            raise InputError(
                f"a plant needs a fit, and values of each: got {len(fits)} and {len(self.values)}"
            )
        if not (self.period > 0.0 and math.isfinite(self.period) and self.latency >= 0.0):
            raise InputError(
                f"the gyro's period must be positive and its latency 0 or more, got "
                f"{self.period:g} and {self.latency:g} s"
            )
        if not self.inputs:
            raise InputError(
                f"no fit begins at a servo command ({', '.join(IN1)}): their inputs are "
                f"{', '.join(name for fit in fits for name in fit.structure.inputs)}"
            )

    def __repr__(self) -> str:
        fits = ", ".join(fit.structure.name for fit in self.fits)
        return f"Plant({fits}: {', '.join(self.inputs)} -> {', '.join(self.outputs)})"

    @property
    def inputs(self) -> tuple[str, ...]:
        """The commands that some model has."""
        return _in_order(IN1, (fit.structure.inputs for fit in self.fits))

    @property
    def sensed(self) -> tuple[str, ...]:
        """What the models themselves tell: rates, and the velocity down."""
        return _in_order((*RATES, "w"), (fit.structure.outputs for fit in self.fits))

    @property
    def outputs(self) -> tuple[str, ...]:
        """What is sensed: rates, their angles, velocity down and acceleration along it."""
        known = self.sensed
        angles = tuple(angle for rate, angle in zip(RATES, ANGLES) if rate in known)
        return (*known, *angles, *(("az",) if "w" in known else ()))

    @property
    def axes(self) -> tuple[str, ...]:
        """The commands whose own angle or velocity is sensed too."""
        return tuple(name for name in self.inputs if BY_NAME[name].angle in self.outputs)

    def response(self, frequency: Array) -> Response:
        """Return what is sensed over the commands, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
        omega = np.asarray(frequency, dtype=np.float64)
        known = dict(zip(self.sensed, self._recorded(omega)))
        still = np.zeros((len(self.inputs), omega.size), dtype=np.complex128)
        turning = turned(self.tilt)
        rates = np.stack([known.get(name, still) for name in RATES])
        angles = np.einsum("ar,rif->aif", turning, rates) / (1j * omega)
        late = np.exp(-1j * omega * self.latency)
        known |= {name: known[name] * late for name in RATES if name in known}
        known |= dict(zip(ANGLES, angles))
        if "w" in known:
            known["az"] = 1j * omega * known["w"]
        return np.stack([known[name] for name in self.outputs])

    def _recorded(self, omega: Array) -> Response:
        """Return what the models tell, their records' latencies taken out, in order of `sensed`."""
        rows, columns = self.sensed, self.inputs
        found = np.zeros((len(rows), len(columns), omega.size), dtype=np.complex128)
        for fit, values, told in zip(self.fits, self.values, self._told):
            if not told:
                continue
            one = evaluate.response(fit.structure, values, omega)
            for output, name in told:
                early = self.late.get(output, 0.0) - self.late.get(name, 0.0)
                j, k = fit.structure.outputs.index(output), fit.structure.inputs.index(name)
                shifted = one[j, k] * np.exp(1j * omega * early)
                found[rows.index(output), columns.index(name)] = shifted
        return found

    @cached_property
    def _told(self) -> tuple[tuple[tuple[str, str], ...], ...]:
        """The outputs and inputs that each fit tells of."""
        known: set[tuple[str, str]] = set()
        shares = []
        for fit in self.fits:
            outputs = [name for name in fit.structure.outputs if name in self.sensed]
            inputs = [name for name in fit.structure.inputs if name in self.inputs]
            pairs = [(y, u) for y in outputs for u in inputs if (y, u) not in known]
            known |= set(pairs)
            shares.append(tuple(pairs))
        return tuple(shares)

    @cached_property
    def sampled(self) -> LinearSystem:
        """It at the gyro's ticks, delays exact. Raises NoResponse: it has no state space."""
        with one_blas_thread():  # matrices are small: a hundred times as fast
            shares = zip(self.fits, self.values, self._told)
            parts = [self._part(fit, values, told) for fit, values, told in shares if told]
            whole = beside(parts, self.inputs)
        turning = turned(self.tilt)

        def share(name: str, row: str) -> float:
            """Return how much of a row there is in an output: angles are integrals of all rates."""
            if name not in ANGLES:
                return float(name == row)
            turns = dict(zip(_INTEGRALS, turning[ANGLES.index(name)].tolist()))
            return turns.get(row, 0.0)

        taken = np.array([[share(name, row) for row in whole.outputs] for name in self.outputs])
        return replace(
            whole, c=taken @ whole.c, d=taken @ whole.d, outputs=self.outputs, name="plant"
        )

    def _part(
        self, fit: Fit, values: Mapping[str, float], told: Sequence[tuple[str, str]]
    ) -> LinearSystem:
        """Return what a fit tells at ticks: its outputs, integrals of rates, az."""
        structure, numbers = fit.structure, evaluate.matrices(fit.structure, values)
        outputs = tuple(dict.fromkeys(output for output, _ in told))
        inputs = tuple(dict.fromkeys(name for _, name in told))
        if len(told) != len(outputs) * len(inputs):
            raise NoResponse(
                f"the model {structure.name!r} tells {', '.join(map('/'.join, told))} only, the "
                "rest of it is told by others: no poles"
            )
        if structure.improper or (structure.states and np.linalg.cond(numbers.M) > 1e12):
            raise NoResponse(f"the model {structure.name!r} has no state space: no poles")
        rows = [structure.outputs.index(name) for name in outputs]
        columns = [structure.inputs.index(name) for name in inputs]
        if np.any(numbers.delays[np.ix_(rows, columns)]):
            raise NoResponse(
                f"the model {structure.name!r} has delays of single responses: no poles"
            )
        a = np.asarray(np.linalg.solve(numbers.M, numbers.F), dtype=np.float64)
        b = np.asarray(np.linalg.solve(numbers.M, numbers.G), dtype=np.float64)
        c, d = (numbers.H0 + numbers.H1 @ a)[rows], (numbers.D + numbers.H1 @ b)[rows][:, columns]
        b, states = b[:, columns], [*structure.states]
        late = {
            name: float(numbers.output_delays[k]) - self.late.get(name, 0.0)
            for name, k in zip(outputs, rows)
        }
        seen: dict[str, tuple[Array, Array, float]] = {}
        for name, row, direct in zip(outputs, c, d):
            row = np.append(row, np.zeros(len(a) - len(row)))
            seen[name] = row, direct, late[name] + (self.latency if name in RATES else 0.0)
            if name in RATES:
                # a model may have the integral already, as an attitude: another would be a second
                # one that nothing holds
                own = np.flatnonzero(np.all(a == row, axis=1) & np.all(b == direct, axis=1))
                if not own.size:
                    own, n = [len(a)], len(a)
                    a, b = np.pad(a, (0, 1)), np.vstack([b, direct])
                    a[n, :n] = row
                    states.append(_INTEGRALS[RATES.index(name)])
                unit = np.eye(len(a))[own[0]]
                seen[_INTEGRALS[RATES.index(name)]] = unit, np.zeros(len(columns)), late[name]
            elif name == "w":
                if np.any(direct):
                    raise NoResponse(f"w of {structure.name!r} jumps: it has no acceleration")
                seen["az"] = row @ a, row @ b, late[name]
        wide = [np.append(row, np.zeros(len(a) - len(row))) for row, _, _ in seen.values()]
        waits = {
            name: float(numbers.input_delays[k]) + (self.late.get(name, 0.0) - 0.5 * self.period)
            for name, k in zip(inputs, columns)
        }
        behind = {name: one for name, (_, _, one) in seen.items()}
        through = np.array([direct for _, direct, _ in seen.values()])
        try:
            return LinearSystem(
                a,
                b,
                np.array(wide),
                through,
                None,
                inputs,
                tuple(seen),
                tuple(states),
                waits,
                behind,
            ).discretise(self.period)
        except InputError as error:
            raise NoResponse(str(error)) from None

    def draws(self, count: int, *, seed: int = 1) -> "tuple[Plant, ...]":
        """Return plants as likely as this one, their parameters drawn by the fits' covariances.

        A value that several fits were given, such as of a servo, errs by the same in all of them.

        Args:
            count: how many.
            seed: of the random numbers.

        Raises:
            InputError: a fit doesn't state the covariance of its parameters.
        """
        rng = np.random.default_rng(seed)
        return tuple(replace(self, values=sample_parameters(self.fits, rng)) for _ in range(count))


def sample_parameters(
    fits: Sequence[Fit], rng: np.random.Generator
) -> tuple[Mapping[str, float], ...]:
    """Return every parameter of each fit, sampled once as the fits' covariances say.

    A known parameter errs by its stated error, the same in all fits that were given the same
    value of it, and takes the free ones with it as each fit says.

    Raises:
        InputError: a fit doesn't state its covariance, or the data don't see a parameter.
    """
    shared: dict[tuple[str, float], float] = {}
    found: list[Mapping[str, float]] = []
    for fit in fits:
        free = [one.name for one in fit.structure.free]
        known = [one for one in fit.structure.parameters if one.error > 0.0]
        if fit.covariance is None or fit.carried is None:
            raise InputError(
                f"the fit {fit.structure.name!r} doesn't state its covariance: identify it again"
            )
        variance = np.diagonal(fit.covariance)
        blind = [name for name, own in zip(free, variance) if not np.isfinite(own)]
        if blind:
            raise InputError(
                f"the data don't see {', '.join(blind)} of the fit {fit.structure.name!r}: fix it"
            )
        keys = [(one.name, one.start) for one in known]
        off = np.array([shared.setdefault(key, rng.standard_normal()) for key in keys])
        own = fit.covariance - fit.carried @ fit.carried.T
        # a root of the covariance, rounding errors below zero apart
        scale = np.sqrt(np.maximum(np.diagonal(own), np.finfo(float).tiny))
        size, axes = np.linalg.eigh(own / np.outer(scale, scale))
        root = scale[:, None] * axes * np.sqrt(np.maximum(size, 0.0))
        moved = fit.carried @ off + root @ rng.standard_normal(len(free))
        values = dict(fit.values)
        values |= {name: values[name] + float(by) for name, by in zip(free, moved)}
        found.append(values | {one.name: one.start + one.error * x for one, x in zip(known, off)})
    return tuple(found)


def turned(tilt: tuple[float, float]) -> Array:
    """Return the rates of phi, theta and psi over p, q and r at a steady tilt, (3, 3)."""
    phi, theta = tilt
    sine, cosine, slope = math.sin(phi), math.cos(phi), math.tan(theta)
    return np.array(
        [
            [1.0, sine * slope, cosine * slope],
            [0.0, cosine, -sine],
            [0.0, sine / math.cos(theta), cosine / math.cos(theta)],
        ]
    )


def _in_order(names: Sequence[str], groups: Iterable[Sequence[str]]) -> tuple[str, ...]:
    known = {name for group in groups for name in group}
    return tuple(name for name in names if name in known)
