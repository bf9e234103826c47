"""Tells which outputs of a structure an input reaches at all, whatever the parameters are."""

import numpy as np
from numpy.typing import NDArray

from helisim.ident.model.structure import Structure


def connected(structure: Structure) -> frozenset[str]:
    """Return the responses ("p/lat") that aren't zero by the structure's own zeros.

    A response that is zero has neither decibels nor a phase, so nothing measured can be fitted
    to it. Parameters that are fixed at zero count as paths: they are values, not the structure.
    """
    n, inputs, outputs = len(structure.states), structure.inputs, structure.outputs
    there = {name: np.zeros((n, n), dtype=np.bool_) for name in "MF"}
    there["G"] = np.zeros((n, len(inputs)), dtype=np.bool_)
    for name in ("H0", "H1"):
        there[name] = np.zeros((len(outputs), n), dtype=np.bool_)
    for name in ("D", "D1"):
        there[name] = np.zeros((len(outputs), len(inputs)), dtype=np.bool_)
    for entry in structure.entries:
        if entry.matrix in there:
            there[entry.matrix][entry.row, entry.column] = True
    # An equation without a rate constrains its states; else it drives those whose rates it has.
    driven = np.where(np.any(there["M"], axis=1, keepdims=True), there["M"], there["F"])
    moved = driven.T @ (driven | there["F"])  # a state moved by another in one step
    reached: NDArray[np.bool_] = driven.T @ there["G"]
    for _ in range(n):
        reached = reached | (moved @ reached)
    paths: NDArray[np.bool_] = (there["H0"] | there["H1"]) @ reached | there["D"] | there["D1"]
    return frozenset(f"{outputs[o]}/{inputs[i]}" for o, i in np.argwhere(paths))
