"""LQG: the optimal regulator of an identified model, on what a Kalman filter makes of its sensors.

The regulator and the filter are python-control's `dlqr` and `dlqe`. Around them stand integrals of
what is tracked, so that the hover's trim is held, and the state and command with which the model
follows a smooth command model exactly (B. Francis, "The linear multivariable regulator problem",
SIAM J. Control and Optimization 15, 1977). The filter takes the newest measurement before the
command is given (G. Franklin, J. Powell and M. Workman, Digital Control of Dynamic Systems, 3rd
edition, 1998, sections 8.2 and 9.5), so the law itself is no tick late.
"""

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning, block_diag, expm, matrix_balance

from helisim.base.errors import HelisimError, InputError, UnknownNameError
from helisim.base.linear import LinearSystem
from helisim.base.settings import FrozenMap, check, setting
from helisim.design.laws.state_space import LIMIT, StateSpaceLaw
from helisim.design.plant import Plant
from helisim.ident import Fit, Structure
from helisim.records.record import IN1, IN2, RATES, made_by

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]
SPEEDS = ("u", "v")
_ATTITUDES = ("phi", "theta")
_TOO_FAR_APART = "no {} is found for these sizes: they are too far apart, bring them nearer"
_FOLLOWED = 1e-6
"""Relative error within which a model follows its commands."""
_ON_CIRCLE = 1e-9
"""By how much an eigenvalue may lie within the unit circle and still not decay."""
_BLIND = 1e-9
"""Least singular value, over the largest, of what moves or shows a mode."""


class UnstabilisableError(HelisimError):
    """A model has a mode that doesn't decay, and that no command moves or no sensor shows."""


@dataclass(frozen=True, kw_only=True)
class Tracked:
    """What a stick commands and an integral holds.

    Attributes:
        output: of the model, such as "phi"; "r" is turned at a rate, its heading held by the
            integral.
        stick: "LAT".
        gain: output of a whole stick, SI.
        frequency: of the command model, rad/s: second order of an angle, first of a rate.
        damping: of the command model of an angle.
        error: of the output that weighs as much as the whole `effort`, SI.
        settle: time for which the integral may bear this error, s.
    """

    output: str
    stick: str
    gain: float
    frequency: float = setting(above=0.0)
    damping: float = setting(1.0, above=0.0)
    error: float = setting(0.1, above=0.0)
    settle: float = setting(0.5, above=0.0)

    def __post_init__(self) -> None:
        if self.stick not in IN2:
            raise UnknownNameError("stick", self.stick, IN2)
        check(self, self.output)

    def command_model(self, period: float) -> tuple[Matrix, Matrix]:
        """Return its matrices over a period (s), the stick held: (n, n) and (n, 1); n is 2 or 1."""
        w = self.frequency
        if self.output in RATES:
            left = math.exp(-w * period)
            return np.array([[left]]), np.array([[self.gain * (1.0 - left)]])
        both = np.zeros((3, 3))
        both[:2] = [[0.0, 1.0, 0.0], [-w * w, -2.0 * self.damping * w, w * w * self.gain]]
        whole = np.asarray(expm(both * period), dtype=np.float64)
        return whole[:2, :2], whole[:2, 2:]


@dataclass(frozen=True, kw_only=True)
class LqgWeights:
    """What an LQG design weighs. Each number is a size: of what counts as much as any other's.

    Attributes:
        output: further outputs -> the size that is borne, SI; such as rates.
        effort: command -> the size that is borne, unitised; the default of each is 0.1.
        disturbance: command -> disturbance there that the filter expects, rms, unitised, new at
            each tick; the default of each is 0.01. Large against the noise, the loop nears that of
            the regulator alone (J. Doyle and G. Stein, "Robustness with observers", IEEE
            Transactions on Automatic Control 24, 1979).
        noise: what is sensed -> its noise, rms, SI; the default of rates is 0.01 rad/s, of
            all else 0.005.
    """

    output: Mapping[str, float] = field(default_factory=dict)
    effort: Mapping[str, float] = field(default_factory=dict)
    disturbance: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, sizes in vars(self).items():
            object.__setattr__(self, name, FrozenMap(sizes))

    def _sizes(
        self, what: str, known: Sequence[str], usual: Mapping[str, float]
    ) -> dict[str, float]:
        """Return sizes by name, those given in place of the usual. Raises InputError."""
        given = getattr(self, what)
        for name, size in given.items():
            if name not in known:
                raise UnknownNameError(what, name, known)
            if not (isinstance(size, int | float) and math.isfinite(size) and size > 0.0):
                raise InputError(f"{what} of {name} must be a size above 0, got {size!r}")
        return {**usual, **{name: float(size) for name, size in given.items()}}


@dataclass(frozen=True, eq=False)
class Regulator:
    """What an LQG law is made of; the state is the model's, then integrals of what is tracked.

    Attributes:
        model: sampled; from commands to what is sensed.
        gain: (n_command, n_state + n_tracked), of u = -gain x.
        poles: of the regulator alone, (n_state + n_tracked,), z-plane.
        filter_gain: (n_state, n_sensed), of the newest measurement.
        filter_poles: of the estimate's error, (n_state,), z-plane.
    """

    model: LinearSystem
    gain: Matrix
    poles: NDArray[np.complex128]
    filter_gain: Matrix
    filter_poles: NDArray[np.complex128]


def regulator(
    model: "control.StateSpace | LinearSystem",
    tracked: Sequence[Tracked],
    weights: LqgWeights | None = None,
) -> Regulator:
    """Return the optimal regulator and filter of a model.

    Args:
        model: sampled, from commands among col, lon, lat, ped to what is sensed, delays among
            its states; no output may follow a command within the tick.
        tracked: what is held by integrals.
        weights: sizes of errors, commands, disturbances and noise.

    Raises:
        InputError: the model isn't sampled, or a name or number is none.
        UnstabilisableError: no command moves, or no sensor shows, what doesn't decay.
    """
    import control  # which brings pyplot

    weights, model = weights or LqgWeights(), _checked(model, tracked)
    a, b, c, period = model.a, model.b, model.c, model.period or 0.0
    commands, sensed = model.inputs, model.outputs
    held = [sensed.index(one.output) for one in tracked]
    n, t = len(a), len(tracked)
    whole_a = np.block([[a, np.zeros((n, t))], [period * c[held], np.eye(t)]])
    whole_b = np.vstack([b, np.zeros((t, b.shape[1]))])
    states = [*model.states, *(f"integral of {one.output}" for one in tracked)]
    blind = _blind(whole_a, whole_b, period, states)
    if blind:
        raise UnstabilisableError(
            f"the model can't be stabilised: no command ({', '.join(commands)}) moves {blind}"
        )
    blind = _blind(a.T, c.T, period, model.states)
    if blind:
        raise UnstabilisableError(
            f"the model can't be stabilised from {', '.join(sensed)}: they don't show {blind}"
        )
    errors = {one.output: one.error for one in tracked} | weights._sizes("output", sensed, {})
    shown = [sensed.index(name) for name in errors]
    by_output = c[shown] / np.array(list(errors.values()))[:, None]
    rests = [1.0 / (one.error * one.settle) ** 2 for one in tracked]
    effort = weights._sizes("effort", commands, dict.fromkeys(commands, 0.1))
    cost = block_diag(by_output.T @ by_output, np.diag(rests))
    with _solved("regulator"):
        gain, _, poles = control.dlqr(whole_a, whole_b, cost, np.diag(1.0 / _squares(effort)))
    usual = {name: 0.01 if name in RATES else 0.005 for name in sensed}
    noise = np.diag(_squares(weights._sizes("noise", sensed, usual)))
    disturbed = weights._sizes("disturbance", commands, dict.fromkeys(commands, 0.01))
    with _solved("filter"):
        _, spread, _ = control.dlqe(a, b, c, np.diag(_squares(disturbed)), noise)
        filter_gain = np.linalg.solve(c @ spread @ c.T + noise, c @ spread).T
    found = Regulator(
        model,
        np.asarray(gain, dtype=np.float64),
        np.asarray(poles, dtype=np.complex128),
        np.asarray(filter_gain, dtype=np.float64),
        np.linalg.eigvals(a @ (np.eye(n) - filter_gain @ c)).astype(np.complex128),
    )
    for what, own in (("regulator", found.poles), ("filter", found.filter_poles)):
        if np.max(np.abs(own)) > 1.0:
            raise InputError(_TOO_FAR_APART.format(what))
    return found


@contextmanager
def _solved(what: str) -> Iterator[None]:
    """Say of a Riccati equation that isn't solved what to do. Raises InputError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            yield
    except (np.linalg.LinAlgError, LinAlgWarning, TypeError, ValueError) as error:
        # TypeError is python-control's of weights that rounding has spoilt
        raise InputError(_TOO_FAR_APART.format(what)) from error


def _squares(sizes: Mapping[str, float]) -> Matrix:
    return np.array(list(sizes.values())) ** 2


def _checked(
    model: "control.StateSpace | LinearSystem", tracked: Sequence[Tracked]
) -> LinearSystem:
    """Return a model that can be regulated. Raises InputError."""
    if isinstance(model, LinearSystem):
        found = model
    else:
        period = getattr(model, "dt", None)
        if not isinstance(period, float | int) or isinstance(period, bool):
            got = f"one with dt = {period!r}" if hasattr(model, "dt") else f"{model!r:.80}"
            raise InputError(_NEEDS_SAMPLED.format(got))
        found = LinearSystem.from_control(model)
    if not found.period or not found.period > 0.0:
        raise InputError(_NEEDS_SAMPLED.format(f"one with dt = {found.period or 0}"))
    for name in found.inputs:
        if name not in IN1:
            raise UnknownNameError("command of the model", name, IN1)
    for one in tracked:
        if one.output not in found.outputs:
            raise UnknownNameError("output to track", one.output, found.outputs)
    if len(tracked) > len(found.inputs):
        raise InputError(
            f"{len(tracked)} outputs are tracked with {len(found.inputs)} commands "
            f"({', '.join(found.inputs)}): track as many at most"
        )
    if np.any(found.d):
        rows = [found.outputs[k] for k in np.flatnonzero(np.any(found.d, axis=1))]
        raise InputError(
            f"{', '.join(rows)} follows a command within the tick, which no law can have seen: "
            "leave it out of what is sensed"
        )
    return found


_NEEDS_SAMPLED = (
    "LQG needs a Plant, or a model sampled at the gyro's period with its delays among its states; "
    "got {}"
)


def _blind(a: Matrix, b: Matrix, period: float, states: Sequence[str]) -> str:
    """Return, in words, a mode that doesn't decay and b doesn't reach; "" if there is none.

    By the test of Popov, Belevitch and Hautus, of balanced matrices, as rates of change.
    """
    balanced, (scale, _) = matrix_balance(a, permute=False, separate=True)
    reach = b / scale[:, None] / period
    for value in np.linalg.eigvals(a):
        if abs(value) < 1.0 - _ON_CIRCLE:
            continue
        own = (balanced - value * np.eye(len(a))) / period
        left, sizes, _ = np.linalg.svd(np.hstack([own, reach]))
        if sizes[-1] < _BLIND * sizes[0]:
            shares, rate = np.abs(left[:, -1]), np.log(complex(value)) / period
            main = [int(k) for k in np.argsort(-shares)[:3]]
            where = [states[k] for k in main if shares[k] > 0.3 * shares.max()]
            grows = rate.real > 1e-6
            how = f"doubles in {math.log(2.0) / rate.real:.2g} s" if grows else "never decays"
            turning = f" at {abs(rate.imag):.3g} rad/s" if abs(rate.imag) > 1e-6 else ""
            return f"a mode of {', '.join(where)} that {how}{turning}"
    return ""


def lqg(
    model: "control.StateSpace | LinearSystem | Plant",
    tracked: Sequence[Tracked],
    weights: LqgWeights | None = None,
    *,
    name: str = "lqg",
    limit: float = LIMIT,
) -> StateSpaceLaw:
    """Return an LQG law of a model, with integrals of what sticks command.

    A command that the model doesn't have is its stick's: col follows COL. The law's states are the
    filter's prediction x, the integrals z, and the command models w:

        x^ = x + M (y - C x),   u = -K (x^ - P w) - K_z z + G w
        x+ = A x^ + B u,   z+ = z + T (y - w),   w+ = S w + R sticks

    Args:
        model: as for `regulator`, or an identified plant, of which `lqg_model` makes one.
        tracked: what sticks command, at most one for each of the model's commands.
        weights: sizes of errors, commands, disturbances and noise.
        name: of the law.
        limit: of each command, unitised.

    Raises:
        InputError: the model isn't sampled, or a name or number is none.
        UnstabilisableError: no command moves, or no sensor shows, what doesn't decay.
    """
    weights = weights or LqgWeights()
    if not tracked:
        raise InputError("nothing is tracked: name at least one output that a stick commands")
    found = regulator(lqg_model(model) if isinstance(model, Plant) else model, tracked, weights)
    system = found.model
    a, b, c, period = system.a, system.b, system.c, system.period or 0.0
    n, t = len(a), len(tracked)
    held = [system.outputs.index(one.output) for one in tracked]
    models = [one.command_model(period) for one in tracked]
    s, r = block_diag(*(one[0] for one in models)), block_diag(*(one[1] for one in models))
    shown = block_diag(*(np.eye(1, len(one[0])) for one in models))
    w = len(s)
    # sticks that rest are part of what is followed
    rests = np.block([[s, r], [np.zeros((t, w)), np.eye(t)]])
    states, commands = _followed(a, b, c[held], rests, np.hstack([shown, np.zeros((t, t))]))
    k, k_z, m = found.gain[:, :n], found.gain[:, n:], found.filter_gain
    ahead = k @ states + commands
    newest = np.eye(n) - m @ c
    law_c = np.hstack([-k @ newest, -k_z, ahead[:, :w]])
    law_d = np.hstack([-k @ m, ahead[:, w:]])
    moved = np.hstack([a @ newest, np.zeros((n, t + w))])
    summed = np.hstack([np.zeros((t, n)), np.eye(t), -period * shown])
    modelled = np.hstack([np.zeros((w, n + t)), s])
    law_a = np.vstack([moved + b @ law_c, summed, modelled])
    law_b = np.vstack(
        [
            np.hstack([a @ m, np.zeros((n, t))]) + b @ law_d,
            np.hstack([period * np.eye(len(c))[held], np.zeros((t, t))]),
            np.hstack([np.zeros((w, len(c))), r]),
        ]
    )
    back = -np.linalg.pinv(k_z)
    share = period / np.array([one.settle for one in tracked])
    none = np.zeros((w, b.shape[1]))
    windup = np.vstack([b, share[:, None] * back, none])
    start = np.vstack([np.zeros((n, b.shape[1])), back, none])
    own = {command: stick for command, stick in zip(IN1, IN2) if command not in system.inputs}
    sticks = [one.stick for one in tracked]
    inputs = (*system.outputs, *sticks, *(one for one in own.values() if one not in sticks))
    rows = [IN1.index(command) for command in system.inputs]
    whole_c, whole_d = np.zeros((4, len(law_a))), np.zeros((4, len(inputs)))
    whole_c[rows], whole_d[rows, : law_d.shape[1]] = law_c, law_d
    for command, stick in own.items():
        whole_d[IN1.index(command), inputs.index(stick)] = 1.0
    wide = np.eye(4)[rows]
    return StateSpaceLaw(
        period=period,
        inputs=inputs,
        a=law_a,
        b=np.pad(law_b, ((0, 0), (0, len(inputs) - law_b.shape[1]))),
        c=whole_c,
        d=whole_d,
        windup=windup @ wide,
        start=start @ wide,
        limits=(limit, limit, limit, limit),
        name=name,
        provenance=made_by(
            "LQG",
            tracked={one.output: dict(vars(one)) for one in tracked},
            weights={key: dict(sizes) for key, sizes in vars(weights).items() if sizes},
        ),
    )


def _followed(a: Matrix, b: Matrix, c: Matrix, s: Matrix, q: Matrix) -> tuple[Matrix, Matrix]:
    """Return states P and commands G with which outputs follow: C P w = Q w for all w+ = S w.

    They solve P S = A P + B G, C P = Q; (n_state, n_w) and (n_command, n_w).

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


def lqg_model(
    plant: Plant,
    *,
    commands: Sequence[str] | None = None,
    sensed: Sequence[str] | None = None,
    without: Sequence[str] = SPEEDS,
) -> LinearSystem:
    """Return an identified plant at its ticks, ready for `lqg`.

    An attitude can't be held for ever without the speed growing, so integrals of attitude would
    hold what nothing can: the speeds that tilting gathers are left out, as are the steady tilt,
    what no sensor shows and what no command moves; and what a lead within a tick lets a command
    move at once, which no law could use.

    Args:
        plant: identified.
        commands: by default those whose own rate is sensed: no collective.
        sensed: by default the rates, roll and pitch.
        without: states that are left out where a model has them.

    Raises:
        UnknownNameError: the plant has no such command or signal.
        NoResponse: it has no state space.
    """
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
    whole = replace(plant, fits=fits, tilt=(0.0, 0.0)).sampled.select(commands, sensed)
    links = (whole.a != 0.0) | np.eye(len(whole.a), dtype=bool)
    moved = _reached(links, np.any(whole.b != 0.0, axis=1))
    kept = np.flatnonzero(moved & _reached(links.T, np.any(whole.c != 0.0, axis=0))).tolist()
    whole = whole.reordered([whole.states[k] for k in kept])
    return replace(whole, d=0.0 * whole.d)


def _without(fit: Fit, names: Sequence[str]) -> Fit:
    """Return a fit whose structure lacks some states, and those that move only them."""
    structure = fit.structure
    if not any(name in structure.states for name in names):
        return fit
    smaller = _of_states(structure, [name for name in structure.states if name not in names])
    idle = {
        name
        for k, name in enumerate(smaller.states)
        if name in _ATTITUDES
        and not any(row[k] != "0" for at, row in enumerate((*smaller.F, *smaller.H0)) if at != k)
    }
    smaller = _of_states(smaller, [name for name in smaller.states if name not in idle])
    return replace(fit, structure=smaller)


def _of_states(structure: Structure, names: Sequence[str]) -> Structure:
    kept = [structure.states.index(name) for name in names]
    columns = {
        name: tuple(tuple(row[k] for k in kept) for row in getattr(structure, name))
        for name in ("M", "F", "H0", "H1")
    }
    rows = {name: tuple(columns[name][k] for k in kept) for name in ("M", "F")}
    g = tuple(structure.G[k] for k in kept)
    return replace(structure, states=tuple(names), **{**columns, **rows, "G": g})


def _reached(links: NDArray[np.bool_], first: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what is reached from some states: links[i, j] says that j moves i."""
    reached = first
    while True:
        further = reached | np.any(links & reached[None, :], axis=1)
        if np.array_equal(further, reached):
            return reached
        reached = further
