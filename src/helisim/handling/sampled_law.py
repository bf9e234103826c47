"""The linear form of a control law: at its ticks, from what it sees to its commands."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from helisim.base.value import Value

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]
_FIELDS = ("a", "b", "c", "d")


class LinearLaw(Protocol):
    """Responses of a law about a trim, and its matrices."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """What it sees, by the names of `Seen`."""
        ...

    @property
    def outputs(self) -> tuple[str, ...]:
        """Its commands: col, lon, lat, ped."""
        ...

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        ...

    @property
    def sampled(self) -> "SampledLaw":
        """Its matrices at its ticks."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class SampledLaw(Value):
    """A linear law at its ticks: x+ = A x + B seen, commands = C x + D seen.

    Attributes:
        a: (n_state, n_state).
        b: (n_state, n_in).
        c: (n_out, n_state).
        d: (n_out, n_in).
        period: s.
        inputs: by the names of `Seen`.
        outputs: col, lon, lat, ped.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    period: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in _FIELDS:
            array = np.array(getattr(self, name), dtype=np.float64)
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __repr__(self) -> str:
        seen, given = ", ".join(self.inputs), ", ".join(self.outputs)
        return f"SampledLaw({len(self.a)} states, each {self.period:g} s: {seen} -> {given})"

    @property
    def sampled(self) -> "SampledLaw":
        """Itself."""
        return self

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        point = np.exp(1j * np.asarray(frequency) * self.period)[:, None, None]
        states = np.linalg.solve(point * np.eye(len(self.a)) - self.a, self.b[None])
        whole = np.asarray(self.c @ states + self.d, dtype=np.complex128)
        return np.moveaxis(whole, 0, -1)

    @property
    def system(self) -> "control.StateSpace":
        """It as python-control's discrete StateSpace."""
        import control  # which brings pyplot

        matrices = [getattr(self, name) for name in _FIELDS]
        names = {"inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.StateSpace(*matrices, self.period, **names)
