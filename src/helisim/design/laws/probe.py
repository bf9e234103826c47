"""The matrices of a law that is linear within its limits, by asking the law itself."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helisim.base.linear import LinearSystem
from helisim.physics.gyro import Seen
from helisim.records.channels import IN1

_SMALL = 2.0**-20
"""Of what is probed with: within every limit, and no rounding as a power of two."""


def probed(
    law: Callable[..., Any],
    settings: NDArray[np.float64],
    states: int,
    period: float,
    inputs: Sequence[str],
) -> LinearSystem:
    """Return a law's matrices, without states that nothing moves.

    Args:
        law: of (seen, state, settings), whose four commands are col, lon, lat and ped, 0 where
            all that it sees and its state are.
        settings: (n_settings,).
        states: how many it has.
        period: s, of its ticks.
        inputs: of what it sees.
    """
    columns = []
    for k in range(states + len(inputs)):
        state, seen = np.zeros(states), Seen(*np.zeros(len(Seen._fields)).tolist())
        if k < states:
            state[k] = _SMALL
        else:
            seen = seen._replace(**{inputs[k - states]: _SMALL})
        commands = law(seen, state, settings)
        columns.append(np.array([*state, *commands]) / _SMALL)
    whole = np.column_stack(columns)
    kept = list(range(states))
    while kept:
        moves = [k for k in kept if _moves(whole[k], k, [*kept, *range(states, whole.shape[1])])]
        if moves == kept:
            break
        kept = moves
    seen_at = range(states, whole.shape[1])
    given_at = range(states, whole.shape[0])
    return LinearSystem(
        whole[np.ix_(kept, kept)],
        whole[np.ix_(kept, seen_at)],
        whole[np.ix_(given_at, kept)],
        whole[np.ix_(given_at, seen_at)],
        period,
        tuple(inputs),
        IN1,
    )


def _moves(row: NDArray[np.float64], own: int, among: list[int]) -> bool:
    """Return whether something among states and inputs, but a state itself, moves that state."""
    return bool(np.any(row[[k for k in among if k != own]]))
