"""Chooses how large a transfer function a coherent response asks for, to begin with."""

import numpy as np
from numpy.typing import NDArray

from helisim.ident.fitting.order import order


def simplest(omega: NDArray[np.float64], response: NDArray[np.complex128]) -> str:
    """Return tf:0/1, tf:0/2, tf:1/2 or a larger one: the first that follows a response.

    Args:
        omega: (n_freq,) rad/s.
        response: (n_freq,) output over input, where it is coherent.
    """
    zeros, poles = order(omega, response)
    return f"tf:{zeros}/{poles}"
