"""A linear system whose response is computed once: a design asks for it again and again."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import Linear, Response


@dataclass(frozen=True, eq=False)
class Kept:
    """A `Linear` that remembers its responses, by the frequencies that were asked for.

    What else the system has, such as its sampled matrices, it has too.

    Attributes:
        source: the system.
    """

    source: Linear
    _known: dict[bytes, Response] = field(default_factory=dict, init=False, repr=False)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.source.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.source.outputs

    def response(self, frequency: NDArray[np.float64]) -> Response:
        """Return the response, (n_out, n_in, n_freq), at frequencies, (n_freq,) rad/s."""
        key = np.ascontiguousarray(frequency).tobytes()
        if key not in self._known:
            found = np.array(self.source.response(frequency))
            found.flags.writeable = False
            self._known[key] = found
        return self._known[key]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.source, name)
