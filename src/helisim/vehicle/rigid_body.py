"""Six degrees of freedom of a linear model: rotors and servos follow at once."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from helisim.base.errors import InputError

if TYPE_CHECKING:
    import control

RIGID_BODY = ("u", "v", "w", "p", "q", "r", "phi", "theta")
"""States that flight mechanics' derivatives are of."""
PLACE = ("psi", "north", "east", "down")
"""States that change no force in still air far from the ground."""


def residualised(
    system: "control.StateSpace", keep: Sequence[str], *, without: Sequence[str] = ()
) -> "control.StateSpace":
    """Return a system with fewer states: the others are where they settle.

    With x' = A11 x + A12 z + B1 u and 0 = A21 x + A22 z + B2 u it has A11 - A12 inv(A22) A21 and
    B1 - A12 inv(A22) B2, and the whole system's response at rest.

    Args:
        system: continuous, with named states.
        keep: names of the states that stay, in the order wanted.
        without: names of states that stay at their values instead of settling.

    Raises:
        InputError: it is sampled, has no such state, or the others don't settle.
    """
    from control import StateSpace  # it brings pyplot: slow to import

    labels = list(system.state_labels)
    missing = [name for name in keep if name not in labels]
    if missing or system.dt:
        kind = f"no state {missing[0]!r}" if missing else f"a period of {system.dt:g} s"
        raise InputError(
            f"reducing takes a continuous model with the states {', '.join(keep)}; this has {kind}"
        )
    a, b, c, d = (np.asarray(getattr(system, name)) for name in "ABCD")
    slow = [labels.index(name) for name in keep]
    fast = [k for k, name in enumerate(labels) if name not in (*keep, *without)]
    settled = a[np.ix_(fast, fast)]
    if fast and np.linalg.matrix_rank(settled) < len(fast):
        names = ", ".join(labels[k] for k in fast)
        raise InputError(f"a state that is to be left out never settles, among {names}")
    by_state = -np.linalg.solve(settled, a[np.ix_(fast, slow)])
    by_input = -np.linalg.solve(settled, b[fast])
    return StateSpace(
        a[np.ix_(slow, slow)] + a[np.ix_(slow, fast)] @ by_state,
        b[slow] + a[np.ix_(slow, fast)] @ by_input,
        c[:, slow] + c[:, fast] @ by_state,
        d + c[:, fast] @ by_input,
        states=list(keep),
        inputs=list(system.input_labels),
        outputs=list(system.output_labels),
        name=system.name,
    )
