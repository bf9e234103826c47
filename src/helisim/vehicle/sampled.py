"""The vehicle with its controller as one sampled system: the exact linear model from sticks.

Between two ticks of the gyro the servo commands are held, so the base helicopter is sampled
exactly; the control law is sampled by itself. The gyro's latency is a whole number of its
periods, and the accelerometer is read a time step late. Nothing is approximated but the
linearisation itself.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from helisim.base.errors import ModelError
from helisim.physics.timing import TIME_TOLERANCE
from helisim.records.channels import ACCELERATIONS, IN1, IN2, RATES
from helisim.vehicle.linearize import OUTPUTS, Linearization

if TYPE_CHECKING:
    import control

Matrix = NDArray[np.float64]
_SERVOS = ("front", "left", "right", "tail")


@dataclass(frozen=True, eq=False)
class SampledGyro:
    """A control law at its ticks: x+ = A x + B seen, u = C x + D seen.

    Attributes:
        system: discrete StateSpace from what it sees, by the names of `Seen`, to col, lon, lat,
            ped: from p, q, r, COL, LON, LAT, PED, and from what else changes its commands.
        period: s.
        latency: s, from sensing the rates to their use.
        timestep: s, by which the specific forces are late.
        imu: place of the accelerometer from the centre of gravity, m, body axes (FRD).
    """

    system: "control.StateSpace"
    period: float
    latency: float
    timestep: float = 0.0
    imu: tuple[float, float, float] = (0.0, 0.0, 0.0)


def sample(a: Matrix, b: Matrix, period: float) -> tuple[Matrix, Matrix]:
    """Return the matrices of a linear system sampled with held inputs, read-only."""
    n, m = b.shape
    both = np.zeros((n + m, n + m))
    both[:n] = np.hstack([a, b])
    whole = np.frombuffer(_exponential((both * period).tobytes())).reshape(n + m, n + m)
    return whole[:n, :n], whole[:n, n:]


@lru_cache(maxsize=4)
def _exponential(matrix: bytes) -> bytes:
    """Return the exponential of a square matrix; tuning asks for one again and again."""
    numbers = np.frombuffer(matrix)
    size = math.isqrt(numbers.size)
    return np.asarray(expm(numbers.reshape(size, size)), dtype=np.float64).tobytes()


def close(
    base: Linearization, gyro: SampledGyro, *, open_at: str | None = None
) -> "control.StateSpace":
    """Return the sampled system from the sticks to the motion, and to the law's commands.

    Args:
        base: from IN1 to the motion, continuous.
        gyro: its law.
        open_at: name of one of the law's commands at which the loop is cut: the input of
            the result is then what goes to that servo instead, its output what would have.

    Returns:
        Discrete StateSpace; inputs are the four sticks, or the cut command.
    """
    plant = sensed_base(base, gyro)
    law = gyro.system
    law_a, law_b = np.asarray(law.A), np.asarray(law.B)
    law_c, law_d = np.asarray(law.C), np.asarray(law.D)
    names = law.input_labels
    sticks = [names.index(name) for name in IN2]
    sensed = [k for k, name in enumerate(names) if name not in IN2]
    seen = np.vstack([plant.seen[names[k]] for k in sensed])
    n, g = plant.a.shape[0], law_a.shape[0]
    command = np.hstack([law_d[:, sensed] @ seen, law_c])
    direct = law_d[:, sticks]
    follows = np.eye(4)
    if open_at is not None:
        follows[IN1.index(open_at), IN1.index(open_at)] = 0.0
    a = block_diag(plant.a, law_a)
    a[:n] += plant.b @ follows @ command
    a[n:, :n] += law_b[:, sensed] @ seen
    b = np.vstack([plant.b @ follows @ direct, law_b[:, sticks]])
    motion = np.hstack([plant.c, np.zeros((len(OUTPUTS), g))]) + plant.d @ follows @ command
    c = np.vstack([motion, command])
    d = np.vstack([plant.d @ follows @ direct, direct])
    inputs: tuple[str, ...] = IN2
    if open_at is not None:
        cut = IN1.index(open_at)
        b = np.vstack([plant.b[:, [cut]], np.zeros((g, 1))])
        d = np.vstack([plant.d[:, [cut]], np.zeros((4, 1))])
        inputs = (open_at,)
    from control import StateSpace  # it brings pyplot: slow to import

    return StateSpace(
        a,
        b,
        c,
        d,
        gyro.period,
        states=[*plant.states, *law.state_labels],
        inputs=list(inputs),
        outputs=[*OUTPUTS, *IN1],
        name="IN2_to_OUT" if open_at is None else f"loop_at_{open_at}",
    )


@dataclass(frozen=True, eq=False)
class SensedBase:
    """The base helicopter with its sensors, sampled: x+ = A x + B u, y = C x + D u.

    Attributes:
        states: their names: of the base, of rates on their way, of forces felt before.
        seen: the row of what a law sees, by name, (1, n_state) each.
    """

    a: Matrix
    b: Matrix
    c: Matrix
    d: Matrix
    states: list[str]
    seen: dict[str, Matrix]


def sensed_base(base: Linearization, gyro: SampledGyro) -> SensedBase:
    """Return the base helicopter as a law at its ticks sees it.

    Args:
        base: from IN1 to the motion, continuous.
        gyro: whose period and latency it has, and which says whether forces are felt.

    Raises:
        ModelError: the latency is not a whole number of periods.
    """
    system = base.system
    base_a, base_b = np.asarray(system.A), np.asarray(system.B)
    shown = slice(len(OUTPUTS))
    c, d = np.asarray(system.C)[shown], np.asarray(system.D)[shown]
    plant_a, plant_b = sample(base_a, base_b, gyro.period)
    n = plant_a.shape[0]
    waits = round(gyro.latency / gyro.period)
    if abs(waits * gyro.period - gyro.latency) > TIME_TOLERANCE:
        raise ModelError("the gyro's latency must be a whole number of its periods")
    feels = any(name in ACCELERATIONS for name in gyro.system.input_labels)
    line, total = 3 * waits, n + 3 * waits + 3 * feels
    rates = [OUTPUTS.index(name) for name in RATES]
    a, b = np.zeros((total, total)), np.zeros((total, 4))
    a[:n, :n], b[:n] = plant_a, plant_b
    if waits:
        a[n : n + line - 3, n + 3 : n + line] = np.eye(line - 3)
        a[n + line - 3 : n + line, :n] = c[rates]
    if feels:
        early_a, early_b = sample(base_a, base_b, gyro.period - gyro.timestep)
        felt_c, felt_d = _felt_at(base, gyro.imu)
        a[n + line :, :n] = felt_c @ early_a
        b[n + line :] = felt_c @ early_b + felt_d
    rows = np.eye(total)
    output = np.hstack([c, np.zeros((c.shape[0], total - n))])
    seen = {name: output[[k]] for k, name in enumerate(OUTPUTS)}
    seen |= {name: rows[[system.state_labels.index(f"{name}_position")]] for name in _SERVOS}
    for k, name in enumerate(RATES):
        if waits:
            seen[name] = rows[[n + k]]
    if feels:
        seen |= {name: rows[[n + line + k]] for k, name in enumerate(ACCELERATIONS)}
    states = [*system.state_labels, *(f"{name}_{k}" for k in range(waits) for name in RATES)]
    states += [f"{name}_felt" for name in ACCELERATIONS] if feels else []
    return SensedBase(a, b, output, d, states, seen)


def _felt_at(base: Linearization, place: tuple[float, float, float]) -> tuple[Matrix, Matrix]:
    """Return the specific force at a place, (3, n_state) of the states and (3, 4) of the inputs."""
    x, y, z = place
    turning = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # d(rates)/dt x place
    force = [OUTPUTS.index(name) for name in ACCELERATIONS]
    rates = [base.system.state_labels.index(name) for name in RATES]
    return (
        np.asarray(base.system.C)[force] + turning @ np.asarray(base.system.A)[rates],
        np.asarray(base.system.D)[force] + turning @ np.asarray(base.system.B)[rates],
    )
