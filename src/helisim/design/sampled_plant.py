"""An identified plant at a law's ticks: rates, their integrals and the rest in one system."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from helisim.design.late import Array, Matrices, joined, late_system
from helisim.handling.loop import NoResponse
from helisim.ident.model import evaluate
from helisim.ident.model.structure import Structure
from helisim.records.channels import ATTITUDES as ANGLES
from helisim.records.channels import RATES

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class SampledPlant:
    """x+ = a x + b u, y = c x + d u at ticks.

    Attributes:
        a: (n_state, n_state).
        b: (n_state, n_in).
        c: (n_out, n_state).
        d: (n_out, n_in).
        period: s.
        inputs: their names.
        outputs: their names.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    period: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def system(self) -> "control.StateSpace":
        """It as python-control's discrete StateSpace."""
        import control  # which brings pyplot

        return control.StateSpace(
            self.a,
            self.b,
            self.c,
            self.d,
            self.period,
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            name="plant",
            remove_useless_states=False,
        )


@dataclass(frozen=True)
class Part:
    """What one model tells of a plant.

    Attributes:
        structure: of the model.
        values: its parameters.
        outputs: what it tells, of each of `inputs`.
        inputs: of the commands.
    """

    structure: Structure
    values: Mapping[str, float]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    def matrices(self) -> Matrices:
        """Return A, B, C and D without delays, C and D of `outputs`, B and D of `inputs`.

        Raises:
            NoResponse: it has no state space.
        """
        numbers = evaluate.matrices(self.structure, self.values)
        n = len(self.structure.states)
        if self.structure.improper or (n and np.linalg.cond(numbers.M) > 1e12):
            raise NoResponse(f"the model {self.structure.name!r} has no state space: no poles")
        rows, columns = self._places
        a = np.asarray(np.linalg.solve(numbers.M, numbers.F), dtype=np.float64)
        b = np.asarray(np.linalg.solve(numbers.M, numbers.G), dtype=np.float64)
        c, d = numbers.H0 + numbers.H1 @ a, numbers.D + numbers.H1 @ b
        return a, b[:, columns], c[rows], d[np.ix_(rows, columns)]

    def delays(self) -> tuple[Array, Array]:
        """Return the delays of `inputs` and of `outputs`, s.

        Raises:
            NoResponse: a response has a delay of its own.
        """
        numbers = evaluate.matrices(self.structure, self.values)
        rows, columns = self._places
        if np.any(numbers.delays[np.ix_(rows, columns)]):
            raise NoResponse(
                f"the model {self.structure.name!r} has delays of single responses: no poles"
            )
        return numbers.input_delays[columns], numbers.output_delays[rows]

    @property
    def _places(self) -> tuple[list[int], list[int]]:
        return (
            [self.structure.outputs.index(name) for name in self.outputs],
            [self.structure.inputs.index(name) for name in self.inputs],
        )


@dataclass(frozen=True)
class Ticks:
    """When a law acts, and how late it and a recorder are.

    Attributes:
        period: s, half of which is among the delays of models already.
        latency: s, from sensing rates to their use.
        late: by how much a channel is recorded late, s, by name.
    """

    period: float
    latency: float
    late: Mapping[str, float]


def sampled_plant(
    parts: Sequence[Part],
    ticks: Ticks,
    turning: Array,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
) -> SampledPlant:
    """Return what several models tell of one plant, at ticks.

    Args:
        parts: the models.
        ticks: when.
        turning: rates of the angles over the body rates, (3, 3).
        inputs: all commands.
        outputs: all that is sensed.

    Raises:
        NoResponse: a model can't be sampled.
    """
    systems = [_part(part, ticks) for part in parts]
    columns = [[inputs.index(name) for name in part.inputs] for part in parts]
    told = [row for _, rows in systems for row in rows]
    a, b, c, d = joined([(one, at) for (one, _), at in zip(systems, columns)], len(inputs))
    taken = np.array([[_share(name, row, turning) for row in told] for name in outputs])
    return SampledPlant(a, b, taken @ c, taken @ d, ticks.period, inputs, outputs)


def _share(name: str, row: str, turning: Array) -> float:
    """Return how much of a row there is in an output: angles are integrals of all rates."""
    if name in ANGLES:
        turned = [_integral(rate) for rate in RATES]
        return float(turning[ANGLES.index(name), turned.index(row)]) if row in turned else 0.0
    return float(name == row)


def _part(part: Part, ticks: Ticks) -> tuple[Matrices, list[str]]:
    """Return a model's matrices at ticks, and its rows: what it tells, integrals of rates, az."""
    a, b, c, d = part.matrices()
    waits, delays = part.delays()
    waits = waits + [ticks.late.get(name, 0.0) - 0.5 * ticks.period for name in part.inputs]
    names: list[str] = []
    rows: list[tuple[Array, Array, float]] = []
    for k, name in enumerate(part.outputs):
        late = float(delays[k]) - ticks.late.get(name, 0.0)
        sensed = late + ticks.latency if name in RATES else late
        names.append(name)
        rows.append((_wide(c[k], a), d[k], sensed))
        if name in RATES:
            a, b, place = _with_integral(a, b, _wide(c[k], a), d[k])
            names.append(_integral(name))
            rows.append((np.eye(len(a))[place], np.zeros(b.shape[1]), late))
        elif name == "w":
            if np.any(d[k]):
                raise NoResponse(f"w of {part.structure.name!r} jumps: it has no acceleration")
            names.append("az")
            rows.append((_wide(c[k], a) @ a, _wide(c[k], a) @ b, late))
    seen = np.stack([_wide(row, a) for row, _, _ in rows])
    whole = a, b, seen, np.stack([direct for _, direct, _ in rows])
    behind = np.array([one for _, _, one in rows])
    return late_system(whole, waits, behind, ticks.period, part.inputs).sampled(), names


def _with_integral(a: Array, b: Array, row: Array, direct: Array) -> tuple[Array, Array, int]:
    """Return A and B with the integral of an output among the states, and its place.

    A model may have it already, as an attitude: another would be a second one that nothing holds.
    """
    own = np.flatnonzero(np.all(a == row, axis=1) & np.all(b == direct, axis=1))
    if own.size:
        return a, b, int(own[0])
    n = len(a)
    wider = np.zeros((n + 1, n + 1))
    wider[:n, :n], wider[n, :n] = a, row
    return wider, np.vstack([b, direct]), n


def _wide(row: Array, a: Array) -> Array:
    """Return a row over the states that there were as one over those that there are."""
    return np.concatenate([row, np.zeros(len(a) - len(row))])


def _integral(rate: str) -> str:
    return f"integral of {rate}"
