"""The identified aircraft as a control law sees it, without the records' latencies."""

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from helisim.base.arrays import Real
from helisim.base.errors import IdentificationError, InputError
from helisim.base.linear import LinearSystem, Response, beside
from helisim.base.settings import Value, check, setting
from helisim.handling.loop import BY_NAME, NoResponse
from helisim.ident import evaluate
from helisim.ident.result import Fit
from helisim.records.record import ATTITUDES as ANGLES
from helisim.records.record import IN1, RATES, one_blas_thread

_INTEGRALS = tuple(f"integral of {rate}" for rate in RATES)


@dataclass(frozen=True, eq=False, repr=False)
class Plant(Value):
    """Identified models from a law's commands to what it senses; `Linear`.

    What no model has is 0; InputError if two have the same output and input. Channels are recorded
    `late` by s, the law sees sticks late by `stick_latency`, s, and uses rates `latency`, s, after
    sensing; half the `period`, s, of the gyro's ticks is among a fit's delays already. `tilt` is
    the steady roll and pitch angle, rad; `values` are parameters of each fit, by default those
    found. Rates and angles that are `still` are sensed and don't move.
    """

    fits: tuple[Fit, ...]
    late: Mapping[str, float] = field(default_factory=dict)
    period: float = setting(0.002, unit="s", above=0.0)
    latency: float = setting(0.0, unit="s", low=0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    stick_latency: Mapping[str, float] = field(default_factory=dict)
    values: tuple[Mapping[str, float], ...] = ()
    still: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.values:
            object.__setattr__(self, "values", tuple(fit.values for fit in self.fits))
        check(self, "the plant")
        if not self.fits or len(self.values) != len(self.fits):
            raise InputError(
                "a plant needs a fit, and values of each: got "
                f"{len(self.fits)} and {len(self.values)}"
            )
        if not self.inputs:
            raise InputError(
                f"no fit begins at a servo command ({', '.join(IN1)}): their inputs are "
                f"{', '.join(name for fit in self.fits for name in fit.structure.inputs)}"
            )

        told = Counter(pair for fit in self.fits for pair in itertools.product(*self._told(fit)))
        twice = [f"{output}/{name}" for (name, output), count in told.items() if count > 1]
        if twice:
            raise InputError(f"two fits tell {', '.join(twice)}: leave one of them out")

    def __repr__(self) -> str:
        fits = ", ".join(fit.structure.name for fit in self.fits)
        return f"Plant({fits}: {', '.join(self.inputs)} -> {', '.join(self.outputs)})"

    @property
    def inputs(self) -> tuple[str, ...]:
        """Commands that some model has."""
        return _in_order(IN1, (fit.structure.inputs for fit in self.fits))

    @property
    def sensed(self) -> tuple[str, ...]:
        """Outputs of the models themselves: rates, and the velocity down."""
        return _in_order((*RATES, "w"), (fit.structure.outputs for fit in self.fits))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Rates, their angles, velocity down and acceleration along it."""
        known = self.sensed
        angles = tuple(angle for rate, angle in zip(RATES, ANGLES) if rate in known)
        return (*known, *angles, *(("az",) if "w" in known else ()), *self.still)

    @property
    def axes(self) -> tuple[str, ...]:
        """Commands whose own angle or velocity is sensed too."""
        return tuple(name for name in self.inputs if BY_NAME[name].angle in self.outputs)

    def response(self, frequency: Real) -> Response:
        """Return sensed outputs over the commands, (n_out, n_in, n_freq), at (n_freq,) rad/s."""
        omega = np.asarray(frequency, dtype=np.float64)
        held = np.exp(-0.5j * omega * self.period)  # on average
        found = np.zeros((len(self.outputs), len(self.inputs), omega.size), dtype=np.complex128)
        for part in self._parts:
            columns = [self.inputs.index(name) for name in part.inputs]
            moved = np.einsum("or,rif->oif", self._taken(part), part.response(omega) * held)
            found[:, columns] += moved
        return found

    @cached_property
    def sampled(self) -> LinearSystem:
        """The plant at the gyro's ticks, delays exact. Raises NoResponse if something leads."""
        try:
            with one_blas_thread():  # matrices are small: a hundred times as fast
                whole = beside([one.discretise(self.period) for one in self._parts], self.inputs)
        except InputError as error:
            raise NoResponse(str(error)) from None
        taken = self._taken(whole)
        return replace(
            whole, c=taken @ whole.c, d=taken @ whole.d, outputs=self.outputs, name="plant"
        )

    def _taken(self, system: LinearSystem) -> Real:
        """Return the plant's outputs over those of a part or of all parts."""
        turning = turned(self.tilt)

        def share(name: str, row: str) -> float:
            return (
                dict(zip(_INTEGRALS, turning[ANGLES.index(name)].tolist())).get(row, 0.0)
                if name in ANGLES
                else float(name == row)
            )

        return np.array([[share(name, row) for row in system.outputs] for name in self.outputs])

    @cached_property
    def _parts(self) -> list[LinearSystem]:
        """The fits, continuous. Raises NoResponse."""
        return [
            self._part(fit, values)
            for fit, values in zip(self.fits, self.values)
            if all(self._told(fit))
        ]

    def _told(self, fit: Fit) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return a fit's inputs and outputs that are the plant's."""
        inputs = tuple(name for name in fit.structure.inputs if name in IN1)
        return inputs, tuple(name for name in fit.structure.outputs if name in self.sensed)

    def _part(self, fit: Fit, values: Mapping[str, float]) -> LinearSystem:
        structure, (inputs, outputs) = fit.structure, self._told(fit)
        try:
            model = evaluate.linear(structure, values).select(inputs, outputs)
        except IdentificationError:
            raise NoResponse(f"the model {structure.name!r} has no state space") from None
        a, b, c, d, n = model.a, model.b, model.c, model.d, len(model.a)
        # a model may have a rate's integral already, as an attitude: another would be a second one
        # that nothing holds
        own = np.all(a[:, None] == c, axis=2) & np.all(b[:, None] == d, axis=2)
        lacking = [k for k, name in enumerate(outputs) if name in RATES and not own[:, k].any()]
        a, c = np.vstack([a, c[lacking]]), np.pad(c, ((0, 0), (0, len(lacking))))
        a, b = np.pad(a, ((0, 0), (0, len(lacking)))), np.vstack([b, d[lacking]])
        integrals = {name: f"integral of {name}" for name in outputs if name in RATES}
        seen: dict[str, tuple[Real, Real, float]] = {}
        for k, name in enumerate(outputs):
            late = model.output_delays[name] - self.late.get(name, 0.0)
            seen[name] = c[k], d[k], late + (self.latency if name in RATES else 0.0)
            if name in RATES:
                place = n + lacking.index(k) if k in lacking else int(np.argmax(own[:, k]))
                seen[integrals[name]] = np.eye(len(a))[place], np.zeros(len(inputs)), late
            elif name == "w":
                if np.any(d[k]):
                    raise NoResponse(f"w of {structure.name!r} jumps: it has no acceleration")
                seen["az"] = c[k] @ a, c[k] @ b, late
        shown, direct, late = zip(*seen.values())
        waits = {
            name: model.delays[name] + (self.late.get(name, 0.0) - 0.5 * self.period)
            for name in inputs
        }
        return LinearSystem(
            a,
            b,
            np.array(shown),
            np.array(direct),
            None,
            inputs,
            tuple(seen),
            (*structure.states, *(integrals[outputs[k]] for k in lacking)),
            waits,
            dict(zip(seen, late)),
        )

    def draws(self, count: int, *, seed: int = 1) -> "tuple[Plant, ...]":
        """Return plants sampled by the fits' covariances. Raises InputError without covariance."""
        rng = np.random.default_rng(seed)
        return tuple(replace(self, values=sample_parameters(self.fits, rng)) for _ in range(count))


def sample_parameters(
    fits: Sequence[Fit], rng: np.random.Generator
) -> tuple[Mapping[str, float], ...]:
    """Return every parameter of each fit, sampled once as the fits' covariances say, or InputError.

    Known parameters err by their stated error, alike in all fits of the same value. Those that are
    left at 0, as what fuselage and tail do with speeds, stay there: they act below the sweeps'
    bands, where no law without speeds can hold what a draw would make grow.
    """
    shared: dict[tuple[str, float], float] = {}
    found: list[Mapping[str, float]] = []
    for fit in fits:
        free = [one.name for one in fit.structure.free]
        stated = [one for one in fit.structure.parameters if one.error > 0.0]
        known = [one for one in stated if one.start]
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
        carried = fit.carried[:, [one.start != 0.0 for one in stated]]
        moved = carried @ off + root @ rng.standard_normal(len(free))
        values = dict(fit.values)
        values |= {name: values[name] + float(by) for name, by in zip(free, moved)}
        found.append(values | {one.name: one.start + one.error * x for one, x in zip(known, off)})
    return tuple(found)


def turned(tilt: tuple[float, float]) -> Real:
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
