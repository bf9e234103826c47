"""LQG: the optimal regulator of an identified model, with a Kalman filter of its sensors.

Sources: B. Francis, SIAM J. Control and Optimization 15, 1977 (command models are followed
exactly); G. Franklin, J. Powell and M. Workman, Digital Control of Dynamic Systems, 3rd edition,
1998, sections 8.2 and 9.5 (the newest measurement is used).
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning, block_diag

from helisim.base.errors import InputError, check_known
from helisim.base.linear import LinearSystem, zero_order_hold
from helisim.base.settings import check, setting
from helisim.design.laws.state_space import LIMIT, StateSpaceLaw
from helisim.design.plant import Plant
from helisim.records.record import IN1, IN2, RATES, made_by

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]
SPEEDS = ("u", "v")
_FOLLOWED = 1e-6  # relative error within which a model follows its commands
_DECAYS = 1e-9  # least distance of the slowest pole from the unit circle


@dataclass(frozen=True, kw_only=True)
class Tracked:
    """An output that a stick commands and an integral holds; of "r" the heading.

    `gain` is the output of a whole stick, SI; `frequency`, rad/s, of the command model: critically
    damped of an angle, first order of a rate. `error`, SI, weighs as much as the whole `effort`,
    and the integral may bear it for `settle`, s.
    """

    output: str
    stick: str = setting(choices=IN2)
    gain: float
    frequency: float = setting(above=0.0)
    error: float = setting(0.1, above=0.0)
    settle: float = setting(0.5, above=0.0)

    def __post_init__(self) -> None:
        check(self, self.output)

    def command_model(self, period: float) -> tuple[Matrix, Matrix]:
        """Return its matrices over a period (s), the stick held: (n, n) and (n, 1); n is 2 or 1."""
        w = self.frequency
        a, b = [[0.0, 1.0], [-w * w, -2.0 * w]], [[0.0], [w * w * self.gain]]
        if self.output in RATES:
            a, b = [[-w]], [[w * self.gain]]
        return zero_order_hold(np.array(a), np.array(b), period)


@dataclass(frozen=True, kw_only=True)
class LqgWeights:
    """Sizes that count alike in an LQG design, by name; of outputs further ones, SI.

    Effort of commands, unitised, is 0.1 by default; rms noise of sensors 0.01 rad/s of rates, else
    0.005, SI. Disturbance is of each command at each tick, rms, unitised, by default 0.01; large
    against the noise, the loop nears the regulator's (Doyle and Stein, IEEE Trans. Automatic
    Control 24, 1979).
    """

    output: Mapping[str, float] = setting(factory=dict, above=0.0)
    effort: Mapping[str, float] = setting(factory=dict, above=0.0)
    disturbance: Mapping[str, float] = setting(factory=dict, above=0.0)
    noise: Mapping[str, float] = setting(factory=dict, above=0.0)

    def __post_init__(self) -> None:
        check(self, "weights")

    def sizes(self, what: str, usual: Mapping[str, float | None]) -> dict[str, float]:
        """Return sizes by name, given before usual, None left out."""
        given = getattr(self, what)
        check_known(what, given, usual)
        return {name: one for name, one in {**usual, **given}.items() if one is not None}


class Regulator(NamedTuple):
    """Gain, (n_command, n_state + n_tracked), and filter gain, (n_state, n_sensed), u = -gain x.

    `poles` are the regulator's, (n_state + n_tracked,), and the estimate's, (n_state,), z-plane.
    """

    gain: Matrix
    filter_gain: Matrix
    poles: tuple[NDArray[np.complex128], NDArray[np.complex128]]


def regulator(model: LinearSystem, tracked: Sequence[Tracked], weights: LqgWeights) -> Regulator:
    """Return the optimal regulator and filter of a model; see `lqg`."""
    import control  # which brings pyplot

    a, b, c, period = model.a, model.b, model.c, model.period or 0.0
    commands, sensed = model.inputs, model.outputs
    held = [sensed.index(one.output) for one in tracked]
    n, t = len(a), len(tracked)
    whole_a = np.block([[a, np.zeros((n, t))], [period * c[held], np.eye(t)]])
    whole_b = np.vstack([b, np.zeros((t, b.shape[1]))])
    errors = {one.output: one.error for one in tracked}
    errors |= weights.sizes("output", dict.fromkeys(sensed))
    shown = [sensed.index(name) for name in errors]
    by_output = c[shown] / np.array(list(errors.values()))[:, None]
    rests = [1.0 / (one.error * one.settle) ** 2 for one in tracked]
    cost = block_diag(by_output.T @ by_output, np.diag(rests))
    effort = _squares(weights.sizes("effort", dict.fromkeys(commands, 0.1)))
    noise = np.diag(
        _squares(weights.sizes("noise", {n: 0.01 if n in RATES else 0.005 for n in sensed}))
    )
    disturbed = np.diag(_squares(weights.sizes("disturbance", dict.fromkeys(commands, 0.01))))
    refusal = InputError(
        f"no regulator is found by {', '.join(commands)} from {', '.join(sensed)}: a mode that "
        "doesn't decay isn't moved or isn't shown, such as a second integral of what is "
        "tracked; or the sizes are too far apart"
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", LinAlgWarning)
            gain, _, poles = control.dlqr(whole_a, whole_b, cost, np.diag(1.0 / effort))
            _, spread, _ = control.dlqe(a, b, c, disturbed, noise)
            filter_gain = np.linalg.solve(c @ spread @ c.T + noise, c @ spread).T
        left = np.linalg.eigvals(a @ (np.eye(n) - filter_gain @ c))
    except (np.linalg.LinAlgError, LinAlgWarning, TypeError, ValueError):
        raise refusal from None  # TypeError is python-control's of weights that rounding has spoilt
    both = np.asarray(poles, dtype=np.complex128), left.astype(np.complex128)
    if max(np.abs(one).max() for one in both) > 1.0 - _DECAYS:
        raise refusal
    return Regulator(np.asarray(gain, np.float64), filter_gain.astype(np.float64), both)


def _squares(sizes: Mapping[str, float]) -> Matrix:
    return np.array(list(sizes.values())) ** 2


def _checked(
    model: "control.StateSpace | LinearSystem", tracked: Sequence[Tracked]
) -> LinearSystem:
    period = getattr(model, "period" if isinstance(model, LinearSystem) else "dt", None)
    if not (isinstance(period, float | int) and period is not True and period > 0.0):
        raise InputError(
            "LQG needs a Plant, or a model sampled at the gyro's period with its delays among its "
            f"states; got {type(model).__name__} with dt = {period or 0}"
        )
    found = model if isinstance(model, LinearSystem) else LinearSystem.from_control(model)
    for what, names, known in (
        ("command of the model", found.inputs, IN1),
        ("output to track", [one.output for one in tracked], found.outputs),
    ):
        check_known(what, names, known)
    if not 0 < len(tracked) <= len(found.inputs):
        raise InputError(
            f"{len(tracked)} outputs are tracked with {len(found.inputs)} commands "
            f"({', '.join(found.inputs)}): track one at least, and as many at most"
        )
    if np.any(found.d):
        raise InputError(
            "an output follows a command within the tick, which no law can have seen: leave it "
            "out of what is sensed"
        )
    return found


def lqg(
    model: "control.StateSpace | LinearSystem | Plant",
    tracked: Sequence[Tracked],
    weights: LqgWeights | None = None,
    *,
    name: str = "lqg",
    limit: float = LIMIT,
) -> StateSpaceLaw:
    """Return an LQG law of a model, with integrals of tracked outputs.

    The law's states are the filter's prediction x, the integrals z, and the command models w:

        x^ = x + M (y - C x),   u = -K (x^ - P w) - K_z z + G w
        x+ = A x^ + B u,   z+ = z + T (y - w),   w+ = S w + R sticks

    `model` is sampled, delays among its states, or a plant; a command that it lacks is its stick's.
    `limit` is unitised. Raises InputError of arguments, or of a mode that neither decays nor is
    moved and shown.
    """
    weights = weights or LqgWeights()
    system = _checked(lqg_model(model) if isinstance(model, Plant) else model, tracked)
    found = regulator(system, tracked, weights)
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
    none = np.zeros((w, b.shape[1]))
    windup = np.vstack([b, back * (period / np.array([[one.settle] for one in tracked])), none])
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
    """Return P, (n_state, n_w), G, (n_command, n_w): P S = A P + B G, C P = Q; or InputError."""
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


def lqg_model(plant: Plant) -> LinearSystem:
    """Return an identified plant at its ticks for `lqg`: rates, roll and pitch by commands.

    Left out are speeds, the steady tilt, modes that no sensor shows or no command moves, and direct
    feedthrough. Raises NoResponse if the plant has no state space.
    """
    own = {"lat": "p", "lon": "q", "ped": "r"}
    commands = [name for name in plant.inputs if own.get(name) in plant.outputs]
    sensed = [name for name in plant.outputs if name in (*RATES, "phi", "theta")]
    # in a hover that leans, turning would move the angles too: a second integral of the yaw rate
    whole = replace(plant, tilt=(0.0, 0.0)).sampled.select(commands, sensed)
    slow = np.isin(whole.states, SPEEDS)
    links = (whole.a != 0.0) & ~slow[:, None] & ~slow
    moved = _reached(links, np.any(whole.b != 0.0, axis=1) & ~slow)
    kept = np.flatnonzero(moved & _reached(links.T, np.any(whole.c != 0.0, axis=0) & ~slow))
    whole = whole.reordered([whole.states[k] for k in kept])
    return replace(whole, d=0.0 * whole.d)


def _reached(links: NDArray[np.bool_], first: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return states reached from some; links[i, j]: j moves i."""
    ways = np.linalg.matrix_power(np.eye(len(links)) + links, len(links))
    return ways @ first > 0.0
