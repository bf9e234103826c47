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
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning, block_diag, expm

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.value import FrozenMap
from helisim.design.following import followed
from helisim.design.laws.state_space import LIMIT, StateSpaceLaw
from helisim.design.lqg_model import lqg_model
from helisim.design.plant import Plant
from helisim.design.stabilisable import check_moved, check_shown
from helisim.records.channels import IN1, IN2
from helisim.records.provenance import made_by

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]
_TOO_FAR_APART = "no {} is found for these sizes: they are too far apart, bring them nearer"


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
    frequency: float
    damping: float = 1.0
    error: float = 0.1
    settle: float = 0.5

    def __post_init__(self) -> None:
        if self.stick not in IN2:
            raise UnknownNameError("stick", self.stick, IN2)
        for name in ("frequency", "damping", "error", "settle"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} of {self.output} must be above 0, got {value!r}")
        if not math.isfinite(self.gain):
            raise InputError(f"gain of {self.output} must be finite, got {self.gain!r}")

    def command_model(self, period: float) -> tuple[Matrix, Matrix]:
        """Return its matrices over a period (s), the stick held: (n, n) and (n, 1); n is 2 or 1."""
        w = self.frequency
        if self.output in ("p", "q", "r"):
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


@dataclass(frozen=True, eq=False)
class Regulator:
    """What an LQG law is made of; the state is the model's, then integrals of what is tracked.

    Attributes:
        model: discrete; from commands to what is sensed.
        gain: (n_command, n_state + n_tracked), of u = -gain x.
        poles: of the regulator alone, (n_state + n_tracked,), z-plane.
        filter_gain: (n_state, n_sensed), of the newest measurement.
        filter_poles: of the estimate's error, (n_state,), z-plane.
    """

    model: "control.StateSpace"
    gain: Matrix
    poles: NDArray[np.complex128]
    filter_gain: Matrix
    filter_poles: NDArray[np.complex128]


def regulator(
    model: "control.StateSpace", tracked: Sequence[Tracked], weights: LqgWeights | None = None
) -> Regulator:
    """Return the optimal regulator and filter of a model.

    Args:
        model: discrete, from commands among col, lon, lat, ped to what is sensed, delays among
            its states; no output may follow a command within the tick.
        tracked: what is held by integrals.
        weights: sizes of errors, commands, disturbances and noise.

    Raises:
        InputError: the model isn't sampled, or a name or number is none.
        UnstabilisableError: no command moves, or no sensor shows, what doesn't decay.
    """
    import control

    weights = weights or LqgWeights()
    a, b, c = _checked(model, tracked)
    commands, sensed = model.input_labels, model.output_labels
    held = [sensed.index(one.output) for one in tracked]
    n, t = len(a), len(tracked)
    period = float(model.dt)
    whole_a = np.block([[a, np.zeros((n, t))], [period * c[held], np.eye(t)]])
    whole_b = np.vstack([b, np.zeros((t, b.shape[1]))])
    summed = [f"integral of {one.output}" for one in tracked]
    check_moved(whole_a, whole_b, period, [*model.state_labels, *summed], commands)
    check_shown(a, c, period, model.state_labels, sensed)
    errors = {one.output: one.error for one in tracked} | _sizes(
        "output", weights.output, sensed, {}
    )
    shown = [sensed.index(name) for name in errors]
    by_output = c[shown] / np.array(list(errors.values()))[:, None]
    rests = [1.0 / (one.error * one.settle) ** 2 for one in tracked]
    effort = _sizes("effort", weights.effort, commands, dict.fromkeys(commands, 0.1))
    cost = block_diag(by_output.T @ by_output, np.diag(rests))
    with _solved("regulator"):
        gain, _, poles = control.dlqr(whole_a, whole_b, cost, _squares(effort, inverse=True))
    noise = {name: 0.01 if name in ("p", "q", "r") else 0.005 for name in sensed}
    noise = _sizes("noise", weights.noise, sensed, noise)
    disturbed = _sizes("disturbance", weights.disturbance, commands, dict.fromkeys(commands, 0.01))
    with _solved("filter"):
        _, spread, _ = control.dlqe(a, b, c, _squares(disturbed), _squares(noise))
        filter_gain = np.linalg.solve(c @ spread @ c.T + _squares(noise), c @ spread).T
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


def lqg(
    model: "control.StateSpace | Plant",
    tracked: Sequence[Tracked],
    weights: LqgWeights | None = None,
    *,
    name: str = "lqg",
    limit: float = LIMIT,
) -> StateSpaceLaw:
    """Return an LQG law of a model, with integrals of what sticks command.

    A command that the model doesn't have is its stick's: col follows COL.

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
    if isinstance(model, Plant):
        model = lqg_model(model)
    found = regulator(model, tracked, weights)
    law = _Assembled(found, tracked)
    sticks = [one.stick for one in tracked]
    commands, sensed = model.input_labels, model.output_labels
    own = [stick for command, stick in zip(IN1, IN2) if command not in commands]
    inputs = (*sensed, *sticks, *(stick for stick in own if stick not in sticks))
    n, k = len(law.a), len(inputs)
    c, d, windup, start = (np.zeros(shape) for shape in ((4, n), (4, k), (n, 4), (n, 4)))
    rows = [IN1.index(command) for command in commands]
    c[rows], d[rows, : law.d.shape[1]] = law.c, law.d
    windup[:, rows], start[:, rows] = law.windup, law.start
    for command, stick in zip(IN1, IN2):
        if command not in commands:
            d[IN1.index(command), inputs.index(stick)] = 1.0
    b = np.hstack([law.b, np.zeros((n, k - law.b.shape[1]))])
    return StateSpaceLaw(
        period=float(model.dt),
        inputs=inputs,
        a=law.a,
        b=b,
        c=c,
        d=d,
        windup=windup,
        start=start,
        limits=(limit,) * 4,
        name=name,
        provenance=made_by(
            "LQG",
            tracked={one.output: dict(vars(one)) for one in tracked},
            weights={key: dict(sizes) for key, sizes in vars(weights).items() if sizes},
        ),
    )


class _Assembled:
    """The matrices of an LQG law, from what is sensed and the sticks to the model's commands.

    Its states are the filter's prediction x, the integrals z, and the command models w.

        x^ = x + M (y - C x),   u = -K (x^ - P w) - K_z z + G w
        x+ = A x^ + B u,   z+ = z + T (y - w),   w+ = S w + R sticks
    """

    def __init__(self, found: Regulator, tracked: Sequence[Tracked]) -> None:
        model = found.model
        a, b, c = (np.asarray(getattr(model, name)) for name in "ABC")
        period, n, t = float(model.dt), len(a), len(tracked)
        held = [model.output_labels.index(one.output) for one in tracked]
        models = [one.command_model(period) for one in tracked]
        s, r = block_diag(*(one[0] for one in models)), block_diag(*(one[1] for one in models))
        shown = block_diag(*(np.eye(1, len(one[0])) for one in models))
        # sticks that rest are part of what is followed
        rests = np.block([[s, r], [np.zeros((t, len(s))), np.eye(t)]])
        states, commands = followed(a, b, c[held], rests, np.hstack([shown, np.zeros((t, t))]))
        k, k_z, m = found.gain[:, :n], found.gain[:, n:], found.filter_gain
        ahead = k @ states + commands
        newest = np.eye(n) - m @ c
        w = len(s)
        self.c = np.hstack([-k @ newest, -k_z, ahead[:, :w]])
        self.d = np.hstack([-k @ m, ahead[:, w:]])
        moved = np.hstack([a @ newest, np.zeros((n, t + w))])
        summed = np.hstack([np.zeros((t, n)), np.eye(t), -period * shown])
        modelled = np.hstack([np.zeros((w, n + t)), s])
        self.a = np.vstack([moved + b @ self.c, summed, modelled])
        pick = np.eye(len(c))[held]
        self.b = np.vstack(
            [
                np.hstack([a @ m, np.zeros((n, t))]) + b @ self.d,
                np.hstack([period * pick, np.zeros((t, t))]),
                np.hstack([np.zeros((w, len(c))), r]),
            ]
        )
        back = -np.linalg.pinv(k_z)
        share = period / np.array([one.settle for one in tracked])
        none = np.zeros((w, b.shape[1]))
        self.windup = np.vstack([b, share[:, None] * back, none])
        self.start = np.vstack([np.zeros((n, b.shape[1])), back, none])


def _checked(
    model: "control.StateSpace", tracked: Sequence[Tracked]
) -> tuple[Matrix, Matrix, Matrix]:
    """Return A, B, C of a model that can be regulated. Raises InputError."""
    period = getattr(model, "dt", None)
    if not isinstance(period, float | int) or isinstance(period, bool) or not period > 0.0:
        got = f"one with dt = {period!r}" if hasattr(model, "dt") else f"{model!r:.80}"
        raise InputError(
            "LQG needs a Plant, or a model sampled at the gyro's period with its delays among its "
            f"states; got {got}"
        )
    for name in model.input_labels:
        if name not in IN1:
            raise UnknownNameError("command of the model", name, IN1)
    for one in tracked:
        if one.output not in model.output_labels:
            raise UnknownNameError("output to track", one.output, model.output_labels)
    if len(tracked) > len(model.input_labels):
        raise InputError(
            f"{len(tracked)} outputs are tracked with {len(model.input_labels)} commands "
            f"({', '.join(model.input_labels)}): track as many at most"
        )
    a, b, c, d = (np.asarray(getattr(model, name), dtype=np.float64) for name in "ABCD")
    if np.any(d):
        rows = [model.output_labels[k] for k in np.flatnonzero(np.any(d, axis=1))]
        raise InputError(
            f"{', '.join(rows)} follows a command within the tick, which no law can have seen: "
            "leave it out of what is sensed"
        )
    return a, b, c


def _sizes(
    what: str, given: Mapping[str, float], known: Sequence[str], usual: Mapping[str, float]
) -> dict[str, float]:
    """Return sizes by name, those given in place of the usual. Raises InputError."""
    for name, size in given.items():
        if name not in known:
            raise UnknownNameError(what, name, known)
        if not (isinstance(size, int | float) and math.isfinite(size) and size > 0.0):
            raise InputError(f"{what} of {name} must be a size above 0, got {size!r}")
    return {**usual, **{name: float(size) for name, size in given.items()}}


def _squares(sizes: Mapping[str, float], *, inverse: bool = False) -> Matrix:
    squares = np.array(list(sizes.values())) ** 2
    return np.diag(1.0 / squares if inverse else squares)
