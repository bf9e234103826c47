"""The linear model of a control law about a steady flight: the law itself, differentiated."""

from collections.abc import Callable

import control
import numpy as np
from numpy.typing import NDArray

from helisim.physics.gyro import Seen
from helisim.records.channels import IN1, IN2, RATES
from helisim.vehicle.sampled import SampledGyro
from helisim.vehicle.swashplate import Swashplate

Law = Callable[[Seen, NDArray[np.float64]], tuple[float, float, float, float]]
"""A control law whose settings are in place: commands of the servos, and the state moved on."""

_STEP = 1e-5
"""Central difference, unitised or SI, as of the base helicopter."""


def linearize_law(
    law: Law,
    seen: Seen,
    state: NDArray[np.float64],
    names: list[str],
    *,
    swashplate: Swashplate,
    period: float,
    latency: float,
) -> SampledGyro:
    """Return the linear model of a law about what it sees, and its state, in a steady flight.

    Args:
        law: with its settings in place.
        seen: in the steady flight.
        state: of the law there, (n_state,).
        names: of its states, n_state of them.
        swashplate: that its servos move.
        period: between two ticks, s.
        latency: of the rates that it reads, s.
    """
    inputs = [name for name in Seen._fields if name != "time"]
    point = np.array([*state, *(getattr(seen, name) for name in inputs)])
    n = state.size

    def acted(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        *swash, tail = law(seen._replace(**dict(zip(inputs, at[n:].tolist()))), after)
        return np.array([*after, *swashplate.unmix(*swash), tail])

    jacobian = np.column_stack(
        [
            (acted(point + _STEP * unit) - acted(point - _STEP * unit)) / (2.0 * _STEP)
            for unit in np.eye(point.size)
        ]
    )
    always = (*RATES, *IN2)
    kept = [k for k, name in enumerate(inputs) if name in always or jacobian[:, n + k].any()]
    columns = [*range(n), *(n + k for k in kept)]
    jacobian = jacobian[:, columns]
    system = control.StateSpace(
        jacobian[:n, :n],
        jacobian[:n, n:],
        jacobian[n:, :n],
        jacobian[n:, n:],
        period,
        states=names,
        inputs=[inputs[k] for k in kept],
        outputs=list(IN1),
        name="gyro",
    )
    return SampledGyro(system, period, latency)
