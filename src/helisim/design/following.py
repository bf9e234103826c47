"""The state and the command with which a model follows what is asked of it exactly.

B. Francis, "The linear multivariable regulator problem", SIAM Journal on Control and Optimization
15, 1977.
"""

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError

Matrix = NDArray[np.float64]
_FOLLOWED = 1e-6
"""Relative error within which a model follows its commands."""


def followed(a: Matrix, b: Matrix, c: Matrix, s: Matrix, q: Matrix) -> tuple[Matrix, Matrix]:
    """Return states P and commands G with which outputs follow: C P w = Q w for all w+ = S w.

    They solve P S = A P + B G, C P = Q.

    Args:
        a: of the model, (n_state, n_state).
        b: (n_state, n_command).
        c: of the outputs that follow, (n_follow, n_state).
        s: (n_w, n_w).
        q: (n_follow, n_w).

    Returns:
        (n_state, n_w) and (n_command, n_w).

    Raises:
        InputError: the model can't follow.
    """
    n, m, w = len(a), b.shape[1], len(s)
    eye = np.eye(w)
    moved = np.hstack([np.kron(s.T, np.eye(n)) - np.kron(eye, a), -np.kron(eye, b)])
    shown = np.hstack([np.kron(eye, c), np.zeros((w * len(c), w * m))])
    whole, wanted = np.vstack([moved, shown]), np.concatenate([np.zeros(n * w), q.T.ravel()])
    found = np.asarray(np.linalg.lstsq(whole, wanted, rcond=None)[0], dtype=np.float64)
    off = float(np.max(np.abs(whole @ found - wanted)))
    if not off < _FOLLOWED * max(1.0, float(np.max(np.abs(q)))):
        raise InputError(
            f"the model can't follow commands of {len(c)} outputs with its {m} commands: "
            f"{off:.2g} stays; track fewer outputs, or others"
        )
    return found[: n * w].reshape(w, n).T, found[n * w :].reshape(w, m).T
