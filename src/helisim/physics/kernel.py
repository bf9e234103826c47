"""How every force law is compiled: for MuJoCo's callbacks, and callable from Python."""

from functools import partial

from numba import njit

kernel = partial(njit, error_model="numpy", forceinline=True)
"""A division by zero gives infinity, as in C; the flight then counts as diverged."""
