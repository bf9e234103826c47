"""The vehicle with its gyro as one sampled system: the exact linear model from sticks.

Between two ticks of the gyro the servo commands are held, so the base helicopter is sampled
exactly; the gyro's law is sampled by itself. The gyro's latency is a whole number of its periods.
Nothing is approximated but the linearisation itself.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from helisim.errors import ModelError
from helisim.physics.timing import TIME_TOLERANCE
from helisim.records.channels import IN1, RATES
from helisim.vehicle.linearize import OUTPUTS, Linearization

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampledGyro:
    """The gyro's law at its ticks: x+ = A x + B (rates, sticks), u = C x + D (rates, sticks).

    Attributes:
        system: discrete StateSpace from p, q, r, COL, LON, LAT, PED to col, lon, lat, ped.
        period: s.
        latency: s, from sensing the rates to their use.
    """

    system: control.StateSpace
    period: float
    latency: float


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
) -> control.StateSpace:
    """Return the sampled system from the sticks to the motion, and to the gyro's commands.

    Args:
        base: from IN1 to the motion, continuous.
        gyro: its law.
        open_at: name of one of the gyro's commands at which the loop is cut: the input of
            the result is then what goes to that servo instead, its output what would have.

    Returns:
        Discrete StateSpace; inputs are the four sticks, or the cut command.
    """
    plant_a, plant_b = sample(np.asarray(base.system.A), np.asarray(base.system.B), gyro.period)
    shown = slice(len(OUTPUTS))
    plant_c, plant_d = np.asarray(base.system.C)[shown], np.asarray(base.system.D)[shown]
    rates = [OUTPUTS.index(name) for name in RATES]
    waits = round(gyro.latency / gyro.period)
    if abs(waits * gyro.period - gyro.latency) > TIME_TOLERANCE:
        raise ModelError("the gyro's latency must be a whole number of its periods")
    law = gyro.system
    law_a, law_b = np.asarray(law.A), np.asarray(law.B)
    law_c, law_d = np.asarray(law.C), np.asarray(law.D)
    n, g, line = plant_a.shape[0], law_a.shape[0], 3 * waits
    total = n + g + line
    # what the gyro sees: the rates now, or the oldest ones in its delay line
    seen = np.zeros((3, total))
    if waits:
        seen[:, n + g : n + g + 3] = np.eye(3)
    else:
        seen[:, :n] = plant_c[rates]
    state = np.zeros((g, total))
    state[:, n : n + g] = np.eye(g)
    command = law_c @ state + law_d[:, :3] @ seen
    direct = law_d[:, 3:]
    follows = np.eye(4)
    if open_at is not None:
        follows[IN1.index(open_at), IN1.index(open_at)] = 0.0
    a = np.zeros((total, total))
    a[:n, :n] = plant_a
    a[:n] += plant_b @ follows @ command
    a[n : n + g] = law_a @ state + law_b[:, :3] @ seen
    if waits:
        a[n + g : total - 3, n + g + 3 :] = np.eye(line - 3)
        a[total - 3 :, :n] = plant_c[rates]
    b = np.zeros((total, 4))
    b[:n] = plant_b @ follows @ direct
    b[n : n + g] = law_b[:, 3:]
    motion = np.zeros((len(OUTPUTS), total))
    motion[:, :n] = plant_c
    motion += plant_d @ follows @ command
    c = np.vstack([motion, command])
    d = np.vstack([plant_d @ follows @ direct, direct])
    names: tuple[str, ...] = law.input_labels[3:]
    if open_at is not None:
        cut = IN1.index(open_at)
        b = np.zeros((total, 1))
        b[:n, 0] = plant_b[:, cut]
        d = np.zeros((c.shape[0], 1))
        d[: len(OUTPUTS), 0] = plant_d[:, cut]
        names = (open_at,)
    states = [*base.system.state_labels, *law.state_labels]
    states += [f"{name}_{k}" for k in range(waits) for name in RATES]
    return control.StateSpace(
        a,
        b,
        c,
        d,
        gyro.period,
        states=states,
        inputs=list(names),
        outputs=[*OUTPUTS, *IN1],
        name="IN2_to_OUT" if open_at is None else f"loop_at_{open_at}",
    )
