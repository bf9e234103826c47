"""The model that an LQG law is made of, from an identified plant.

An attitude can't be held for ever without the speed growing, so integrals of attitude would hold
what nothing can: the speeds that tilting gathers are left out, as are the steady tilt, what no
sensor shows and what no command moves.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import UnknownNameError
from helisim.design.plant import Plant
from helisim.ident.fitting.result import Fit
from helisim.ident.model.structure import Entries, Structure
from helisim.records.channels import RATES

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]

SPEEDS = ("u", "v")
_ATTITUDES = ("phi", "theta")


def lqg_model(
    plant: Plant,
    *,
    commands: Sequence[str] | None = None,
    sensed: Sequence[str] | None = None,
    without: Sequence[str] = SPEEDS,
) -> "control.StateSpace":
    """Return an identified plant at its ticks, ready for `lqg`.

    What a lead within a tick lets a command move at once is left out: no law could use it.

    Args:
        plant: identified.
        commands: by default those whose own rate is sensed: no collective.
        sensed: by default the rates, roll and pitch.
        without: states that are left out where a model has them.

    Raises:
        UnknownNameError: the plant has no such command or signal.
        NoResponse: it has no state space.
    """
    import control  # which brings pyplot

    own = {"lat": "p", "lon": "q", "ped": "r"}
    commands = commands or [name for name in plant.inputs if own.get(name) in plant.outputs]
    sensed = sensed or [name for name in plant.outputs if name in (*RATES, *_ATTITUDES)]
    for what, names, known in (
        ("command of the plant", commands, plant.inputs),
        ("signal of the plant", sensed, plant.outputs),
    ):
        for name in names:
            if name not in known:
                raise UnknownNameError(what, name, known)
    fits = tuple(_without(fit, without) for fit in plant.fits)
    # in a hover that leans, turning would move the angles too: a second integral of the yaw rate
    slower = replace(plant, fits=fits, tilt=(0.0, 0.0))
    whole = slower.sampled
    columns = [whole.inputs.index(name) for name in commands]
    rows = [whole.outputs.index(name) for name in sensed]
    a, b, c = _reached(whole.a, whole.b[:, columns], whole.c[rows])
    return control.StateSpace(
        a,
        b,
        c,
        0.0,
        whole.period,
        inputs=list(commands),
        outputs=list(sensed),
        remove_useless_states=False,
    )


def _without(fit: Fit, names: Sequence[str]) -> Fit:
    """Return a fit whose structure lacks some states, and those that move only them."""
    structure = fit.structure
    if not any(name in structure.states for name in names):
        return fit
    kept = [k for k, name in enumerate(structure.states) if name not in names]
    smaller = _of_states(structure, kept)
    idle = {
        k
        for k, name in enumerate(smaller.states)
        if name in _ATTITUDES
        and not any(
            row[k] != "0" for place, row in enumerate((*smaller.F, *smaller.H0)) if place != k
        )
    }
    if idle:
        smaller = _of_states(smaller, [k for k in range(len(smaller.states)) if k not in idle])
    return replace(fit, structure=smaller)


def _of_states(structure: Structure, kept: Sequence[int]) -> Structure:
    def picked(rows: Entries, *, both: bool) -> Entries:
        chosen = [rows[k] for k in kept] if both else rows
        return tuple(tuple(row[k] for k in kept) for row in chosen)

    return replace(
        structure,
        states=tuple(structure.states[k] for k in kept),
        M=picked(structure.M, both=True),
        F=picked(structure.F, both=True),
        G=tuple(structure.G[k] for k in kept),
        H0=picked(structure.H0, both=False),
        H1=picked(structure.H1, both=False),
    )


def _reached(a: Matrix, b: Matrix, c: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Return a system without the states that nothing moves or that show nowhere."""
    links = (a != 0.0) | np.eye(len(a), dtype=bool)
    moved = _spread(links, np.any(b != 0.0, axis=1))
    shown = _spread(links.T, np.any(c != 0.0, axis=0))
    kept = np.flatnonzero(moved & shown).tolist()
    return a[np.ix_(kept, kept)], b[kept], c[:, kept]


def _spread(links: NDArray[np.bool_], first: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what is reached from some states: links[i, j] says that j moves i."""
    reached = first
    while True:
        further = reached | np.any(links & reached[None, :], axis=1)
        if np.array_equal(further, reached):
            return reached
        reached = further
