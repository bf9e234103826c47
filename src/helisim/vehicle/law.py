"""The linear model of a control law about a steady flight: the law itself, differentiated."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.errors import ModelError
from helisim.physics.gyro import Seen
from helisim.records.channels import IN1, IN2, RATES
from helisim.vehicle.swashplate import Swashplate

if TYPE_CHECKING:
    import control

Law = Callable[[Seen, NDArray[np.float64]], Sequence[float]]
"""A control law whose settings are in place: commands of the servos, and the state moved on."""

_STEP = 1e-5
"""Central difference, unitised or SI, as of the base helicopter."""
_TRIES = 20
_SETTLED = 1e-9
"""By which commands may be off a trim's, unitised, and a state's step be more than rounding."""


def linearize_law(
    law: Law,
    seen: Seen,
    state: NDArray[np.float64],
    names: Sequence[str],
    *,
    swashplate: Swashplate,
    period: float,
) -> "control.StateSpace":
    """Return the linear model of a law about what it sees, and its state, in a steady flight.

    Args:
        law: with its settings in place.
        seen: in the steady flight.
        state: of the law there, (n_state,).
        names: of its states, n_state of them.
        swashplate: that its servos move.
        period: between two ticks, s.

    Returns:
        Discrete StateSpace from what the law sees to col, lon, lat and ped. What changes nothing
        is left out, but rates and sticks.
    """
    inputs = [name for name in Seen._fields if name != "time"]
    n = state.size

    def acted(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        *swash, tail = law(seen._replace(**dict(zip(inputs, at[n:].tolist()))), after)
        return np.array([*after, *swashplate.unmix(*swash), tail])

    jacobian = _jacobian(acted, np.array([*state, *(getattr(seen, name) for name in inputs)]))
    always = (*RATES, *IN2)
    kept = [k for k, name in enumerate(inputs) if name in always or jacobian[:, n + k].any()]
    jacobian = jacobian[:, [*range(n), *(n + k for k in kept)]]
    from control import StateSpace  # it brings pyplot: slow to import

    return StateSpace(
        jacobian[:n, :n],
        jacobian[:n, n:],
        jacobian[n:, :n],
        jacobian[n:, n:],
        period,
        states=list(names),
        inputs=[inputs[k] for k in kept],
        outputs=list(IN1),
        name="gyro",
    )


def settled(
    law: Law, seen: Seen, state: NDArray[np.float64], commands: Sequence[float], name: str
) -> tuple[Seen, NDArray[np.float64]]:
    """Return what a law sees in a steady flight that it commands, and its state, (n_state,).

    The sticks are what it needs to command the flight, as near the middle as may be.

    Args:
        law: with its settings in place.
        seen: in the steady flight, sticks where they may be.
        state: to begin with, (n_state,).
        commands: of the four servos in the flight, (4,).
        name: of the controller, for messages.

    Raises:
        ModelError: there is no such state and position of the sticks.
    """
    n = state.size
    at = np.array([*state, *(getattr(seen, stick) for stick in IN2)], dtype=np.float64)

    def off(at: NDArray[np.float64]) -> NDArray[np.float64]:
        after = at[:n].copy()
        given = law(seen._replace(**dict(zip(IN2, at[n:].tolist()))), after)
        return np.array([*(after - at[:n]), *(np.array(given) - commands)])

    for _ in range(_TRIES):
        left = off(at)
        if np.max(np.abs(left)) < _SETTLED:
            break
        step = np.linalg.lstsq(_jacobian(off, at), -left, rcond=1e-9)[0]
        at = np.asarray(at + step, dtype=np.float64)
        if not np.all(np.isfinite(at)) or np.max(np.abs(step)) < _SETTLED:
            break
    wrong = off(at)[n:]
    if not np.max(np.abs(wrong)) < 1e3 * _SETTLED:
        raise ModelError(
            f"controller {name!r} can't hold this flight with any state and sticks: its commands "
            f"of front, left, right and tail stay off by {', '.join(f'{one:.2g}' for one in wrong)}"
        )
    return seen._replace(**dict(zip(IN2, at[n:].tolist()))), at[:n]


def _jacobian(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    columns = [
        (function(at + _STEP * unit) - function(at - _STEP * unit)) / (2.0 * _STEP)
        for unit in np.eye(at.size)
    ]
    return np.column_stack(columns)
