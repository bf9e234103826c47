"""Identified models as the numbers of ArduPilot's state-space helicopter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.units import STANDARD_GRAVITY
from helisim.ident.fitting.ardupilot import DELAYS, DERIVATIVES, FLAPPING, LONGEST_MS, STATES
from helisim.ident.model.evaluate import matrices, state_space
from helisim.ident.model.structure import Structure
from helisim.records.channels import IN1

Matrix = NDArray[np.float64]
Place = tuple[str, str]

_FULL = {"col": 1.0, "lon": 0.5, "lat": 0.5, "ped": 0.5}
"""What ArduPilot's 1 is of commands from -0.5 to 0.5; its collective goes from 0 to 1."""
_OWN = {"col": "w", "lon": "q", "lat": "p", "ped": "r"}
_KINEMATIC: dict[Place, float] = {
    ("phi", "p"): 1.0,
    ("theta", "q"): 1.0,
    ("u", "theta"): -STANDARD_GRAVITY,
    ("v", "phi"): STANDARD_GRAVITY,
    ("a", "q"): -1.0,
    ("b", "p"): -1.0,
}
"""What the simulator has by itself."""
_SAME = 2e-3
"""Relative: by which gravity may differ between places, and rounding."""
_ROTOR_LAG = 0.1
"""s, where nothing flaps: the simulator divides by it."""
_MS = 1e-3


@dataclass
class _Core:
    """One model's rates of change: entries by place, and its commands' delays, s."""

    entries: dict[Place, float]
    folded: set[Place]
    delays: dict[str, float]
    by_servos: bool


def numbers_of(
    parts: Sequence[tuple[Structure, Mapping[str, float]]],
    *,
    full: Mapping[str, float],
    late: Mapping[str, float],
) -> tuple[dict[str, float], list[str]]:
    """Return the file's numbers of some models, and what it can't say of them.

    Args:
        parts: structures with values; where two say one thing, the first does.
        full: command -> what ArduPilot's 1 is, where not as usual.
        late: channel -> by how much it is recorded late, s.

    Raises:
        InputError: a model holds what the file has no place for.
    """
    for name in full:
        if name not in IN1:
            raise UnknownNameError("command", name, IN1)
    entries: dict[Place, float] = {}
    delays: dict[str, float] = {}
    remarks: list[str] = []
    for structure, values in parts:
        core = _core(structure, values, late)
        remarks += _check_places(structure.name, core)
        entries = {**core.entries, **entries}
        delays = {**core.delays, **delays}
        if core.by_servos:
            remarks.append(f"servos of {structure.name} stand as delays")
    if not delays:
        raise InputError("no model begins at a servo command (col, lon, lat, ped)")
    per_one = {name: full.get(name, _FULL[name]) for name in IN1}
    scaled = {
        (row, by): value * per_one.get(by, 1.0) for (row, by), value in entries.items() if value
    }
    numbers = {name: scaled[place] for name, place in DERIVATIVES.items() if place in scaled}
    numbers |= _flapping(scaled)
    written, said = _delays(delays)
    return numbers | written, [*remarks, *said]


def _core(structure: Structure, values: Mapping[str, float], late: Mapping[str, float]) -> _Core:
    """Return a model without servos and flap-back. Raises InputError."""
    for name in structure.inputs:
        if name not in IN1:
            raise InputError(
                f"{structure.name} begins at {name!r}, and ArduPilot's model at servo commands: "
                f"{', '.join(IN1)}"
            )
    system = state_space(structure, values)
    a, b = (np.asarray(one, dtype=np.float64) for one in (system.A, system.B))
    names = list(structure.states)
    own = [names.index(name) for name in STATES if name in names]
    servos = [k for k in range(len(names)) if k not in own]
    behind = np.flatnonzero(np.any(a[np.ix_(servos, own)], axis=1))
    if behind.size:
        told = ", ".join(names[servos[k]] for k in behind)
        raise InputError(f"{structure.name} has {told}, which ArduPilot's model has no state for")
    states = [names[k] for k in own]
    core_a, core_b = a[np.ix_(own, own)], b[own]
    lags = np.zeros(len(structure.inputs))
    if servos:
        through = a[np.ix_(own, servos)]
        steady = np.linalg.solve(a[np.ix_(servos, servos)], b[servos])
        slow = np.linalg.solve(a[np.ix_(servos, servos)], steady)
        core_b = core_b - through @ steady
        # G(s) = g (1 - s lag + ...), one lag for all that a command moves
        lags = np.sum(core_b * (through @ slow), axis=0) / np.sum(core_b**2, axis=0)
    core_a, folded = _without_flap_back(states, core_a)
    entries = {
        (row, by): float(value)
        for row, line in zip(states, np.hstack([core_a, core_b]))
        for by, value in zip((*states, *structure.inputs), line)
    }
    return _Core(entries, folded, _lags(structure, values, lags, late), bool(servos))


def _without_flap_back(states: Sequence[str], a: Matrix) -> tuple[Matrix, set[Place]]:
    """Return A with the flapping that velocities bring at once in their derivatives.

    The tip path plane follows a velocity within its lag, far faster than that changes.
    """
    flapping = [k for k, name in enumerate(states) if name in ("a", "b")]
    speeds = [k for k, name in enumerate(states) if name in ("u", "v", "w")]
    if not (flapping and speeds and np.any(a[np.ix_(flapping, speeds)])):
        return a, set()
    steady = -np.linalg.solve(a[np.ix_(flapping, flapping)], a[np.ix_(flapping, speeds)])
    moved = a.copy()
    others = [k for k in range(len(states)) if k not in flapping]
    moved[np.ix_(others, speeds)] += a[np.ix_(others, flapping)] @ steady
    moved[np.ix_(flapping, speeds)] = 0.0
    return moved, {(states[j], states[k]) for j in others for k in speeds}


def _lags(
    structure: Structure, values: Mapping[str, float], servos: Matrix, late: Mapping[str, float]
) -> dict[str, float]:
    """Return the delay of each command, to its own rate where the model has it, s."""
    numbers = matrices(structure, values).lags
    found = {}
    for k, name in enumerate(structure.inputs):
        outputs = structure.outputs
        output = _OWN[name] if _OWN[name] in outputs else outputs[0]
        total = numbers[outputs.index(output), k] + servos[k]
        found[name] = float(total) - late.get(output, 0.0) + late.get(name, 0.0)
    return found


def _check_places(name: str, core: _Core) -> list[str]:
    """Return what is dropped of the velocities' own. Raises InputError for anything else."""
    known = {*DERIVATIVES.values(), *FLAPPING.values(), ("a", "a"), ("b", "b")}
    lost, dropped = [], []
    for place, value in core.entries.items():
        row, by = place
        if place in _KINEMATIC:
            if value and abs(value / _KINEMATIC[place] - 1.0) > _SAME:
                lost.append(f"{value:.4g} in d{row}/dt by {by}, not {_KINEMATIC[place]:.4g}")
        elif value and place not in known:
            said = f"{value:.2g} in d{row}/dt by {by}"
            (dropped if place in core.folded else lost).append(said)
    if lost:
        raise InputError(f"{name} can't be a model of ArduPilot, which has no {'; '.join(lost)}")
    return [f"{name}: dropped {one}, which flap-back brings" for one in dropped]


def _flapping(entries: Mapping[Place, float]) -> dict[str, float]:
    """Return the numbers of the tip path plane. Raises InputError."""
    rates = {name: -entries[name, name] for name in ("a", "b") if (name, name) in entries}
    if not rates:
        return {"tf": _ROTOR_LAG}
    rate = next(iter(rates.values()))
    if not rate > 0.0 or any(abs(one / rate - 1.0) > _SAME for one in rates.values()):
        raise InputError("ArduPilot's rotor has one lag, above 0, for both of its tilts")
    tilts = {name: entries[place] / rate for name, place in FLAPPING.items() if place in entries}
    # a tilted thrust, where the model doesn't say it
    thrust = {
        "Xa1s": entries.get(("u", "a"), -STANDARD_GRAVITY),
        "Yb1s": entries.get(("v", "b"), STANDARD_GRAVITY),
    }
    return {"tf": 1.0 / rate, **tilts, **thrust}


def _delays(found: Mapping[str, float]) -> tuple[dict[str, float], list[str]]:
    """Return the delays that the simulator knows, whole ms, and by how much they are off."""
    shared: dict[str, list[str]] = {}
    for name in found:
        shared.setdefault(DELAYS[name], []).append(name)
    written, remarks = {}, []
    for key, names in shared.items():
        mean = sum(found[name] for name in names) / len(names)
        whole = min(LONGEST_MS, max(0, round(mean / _MS)))
        written[key] = float(whole)
        off = {name: found[name] / _MS - whole for name in names}
        if any(abs(one) > 0.5 for one in off.values()):
            said = ", ".join(f"{found[name] / _MS:.1f} ms of {name}" for name in names)
            remarks.append(f"{key} = {whole} stands for {said}")
    return written, remarks
