"""Time-domain simulation of linear models, in blocks: no Python in the step."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

if TYPE_CHECKING:
    import control

_BLOCK = 64
"""Samples in a block: only speed depends on it."""

Discrete = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""Transition, effect of the sample now, and effect of the change to the next sample."""


def simulate(
    model: "control.StateSpace",
    inputs: NDArray[np.float64],
    step: float,
    start: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the outputs, (n_time, n_out), exact for inputs linear between samples.

    Args:
        model: a continuous model.
        inputs: (n_time, n_in).
        step: sample time, s.
        start: (n_state,) initial state; at rest by default.
    """
    a, b, c, d = (np.asarray(x, dtype=np.float64) for x in (model.A, model.B, model.C, model.D))
    transition, now, change = _discretise(a, b, step)
    rise = np.diff(inputs, axis=0, append=inputs[-1:])
    driven = inputs @ now.T + rise @ change.T
    states = _propagate(transition, driven, np.zeros(a.shape[0]) if start is None else start)
    return states @ c.T + inputs @ d.T


def delayed(
    model: "control.StateSpace",
    inputs: NDArray[np.float64],
    step: float,
    lags: NDArray[np.float64],
    by_rate: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the outputs of a model at rest with a delay a pair, (n_time, n_out).

    Exact for inputs linear between samples, also where a delay isn't a whole number of them.
    Before the record inputs rest at their first value, after it at their last. An input's rate
    is the mean of the slopes on both sides of a sample, linear between samples.

    Args:
        model: a continuous model.
        inputs: (n_time, n_in), deviations from trim.
        step: sample time, s.
        lags: (n_out, n_in) s, negative where an output leads its input.
        by_rate: (n_out, n_in) D1, by how much an output follows an input's rate; none by default.
    """
    a, b, c, d = (np.asarray(x, dtype=np.float64) for x in (model.A, model.B, model.C, model.D))
    samples, n_in = inputs.shape
    outputs = np.zeros((samples, c.shape[0]))
    # What the delays reach beyond the record, on both sides.
    margin = int(np.ceil(np.max(np.abs(lags), initial=0.0) / step)) + 2
    transition, now, change = _discretise(a, b, step)
    for j in range(n_in):
        wide = np.pad(inputs[:, j], margin, mode="edge")
        rise = np.diff(wide, append=wide[-1])
        rate = np.gradient(wide, step)
        driven = np.outer(wide, now[:, j]) + np.outer(rise, change[:, j])
        states = _propagate(transition, driven, np.zeros(a.shape[0]))
        for lag in np.unique(lags[:, j]):
            whole = int(np.floor(-lag / step))
            part = -lag - whole * step
            at = slice(margin + whole, margin + whole + samples)
            ahead, held, risen = _discretise(a, b, part)
            slope = rise[at] * (part / step)
            moved = (
                states[at] @ ahead.T + np.outer(wide[at], held[:, j]) + np.outer(slope, risen[:, j])
            )
            for k in np.flatnonzero(lags[:, j] == lag):
                outputs[:, k] += moved @ c[k] + (wide[at] + slope) * d[k, j]
                if by_rate is not None and by_rate[k, j]:
                    ahead_at = slice(at.start + 1, at.stop + 1)
                    between = rate[at] + (rate[ahead_at] - rate[at]) * (part / step)
                    outputs[:, k] += between * by_rate[k, j]
    return outputs


def _discretise(a: NDArray[np.float64], b: NDArray[np.float64], step: float) -> Discrete:
    """Return the exact transition over one step of an input that changes linearly."""
    n, n_in = b.shape
    block = np.zeros((n + 2 * n_in, n + 2 * n_in))
    block[:n, :n] = a * step
    block[:n, n : n + n_in] = b * step
    block[n : n + n_in, n + n_in :] = np.eye(n_in)
    power = np.asarray(expm(block), dtype=np.float64)
    return power[:n, :n], power[:n, n : n + n_in], power[:n, n + n_in :]


def _propagate(
    transition: NDArray[np.float64], driven: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return x_0 .. x_(N-1) of x_(k+1) = A x_k + driven_k, (n_time, n_state).

    Blocks are started from zero all at once, then the states at their edges are chained.
    """
    samples, n = driven.shape
    if n == 0:
        return driven
    blocks = -(-samples // _BLOCK)
    padded = np.zeros((blocks * _BLOCK, n))
    padded[:samples] = driven
    padded = padded.reshape(blocks, _BLOCK, n)
    local = np.zeros((blocks, _BLOCK + 1, n))
    powers = np.zeros((_BLOCK + 1, n, n))
    powers[0] = np.eye(n)
    for k in range(_BLOCK):
        local[:, k + 1] = local[:, k] @ transition.T + padded[:, k]
        powers[k + 1] = transition @ powers[k]
    edge = np.zeros((blocks, n))
    state = start
    for block in range(blocks):
        edge[block] = state
        state = powers[_BLOCK] @ state + local[block, _BLOCK]
    free = np.einsum("kij,bj->bki", powers[:_BLOCK], edge)
    return (local[:, :_BLOCK] + free).reshape(-1, n)[:samples]
