"""The vehicle with its controller as one sampled system: the exact linear model from sticks."""

import numpy as np

from helisim.base.errors import ModelError
from helisim.base.linear import LinearSystem
from helisim.physics.memory import TIME_TOLERANCE
from helisim.records.record import ACCELERATIONS, IN1, IN2, RATES
from helisim.vehicle.linearize import OUTPUTS, Linearization

_SERVOS = ("front", "left", "right", "tail")
_TRUE = {name: f"true {name}" for name in OUTPUTS}


def close(
    base: Linearization,
    gyro: LinearSystem,
    *,
    imu: tuple[float, float, float] = (0.0, 0.0, 0.0),
    cut: str | None = None,
) -> Linearization:
    """Return the sampled system from the sticks to the motion, and to the law's commands.

    base: from IN1, continuous; gyro: `Vehicle.gyro`; imu: place from the centre of gravity, m, FRD;
    cut: command at which the loop is cut: then the input, its output the law's answer.
    """
    whole = sensed_base(base, gyro, imu=imu).feedback(gyro, cut)
    whole = whole.select(IN2 if cut is None else (cut,), (*_TRUE.values(), *IN1))
    return Linearization(
        whole.a,
        whole.b,
        whole.c,
        whole.d,
        whole.period,
        whole.inputs,
        (*OUTPUTS, *IN1),
        whole.states,
        whole.delays if cut is None else {},
        name="IN2_to_OUT" if cut is None else f"loop_at_{cut}",
        trim=base.trim,
    )


def sensed_base(
    base: Linearization, gyro: LinearSystem, *, imu: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> LinearSystem:
    """Return the base helicopter as a law at its ticks sees it; arguments as of `close`.

    Outputs: the true motion ("true p" and so on), then what a law senses, delayed as `gyro` says.
    ModelError: the rates' delay is not a whole number of periods.
    """
    period, latency = gyro.sampled.period or 0.0, gyro.delays.get(RATES[0], 0.0)
    waits = round(latency / period)
    if abs(waits * period - latency) > TIME_TOLERANCE:
        raise ModelError("the gyro's latency must be a whole number of its periods")
    feels = any(name in ACCELERATIONS for name in gyro.inputs)
    rows = dict(zip(OUTPUTS, zip(base.c, base.d)))
    places = dict(zip(base.states, np.eye(len(base.a))))
    seen = rows | {name: (places[f"{name}_position"], np.zeros(4)) for name in _SERVOS}
    if feels:
        x, y, z = imu
        turning = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # d(rates)/dt x place
        rates = [base.states.index(name) for name in RATES]
        force = base.select(outputs=ACCELERATIONS)
        felt = force.c + turning @ base.a[rates], force.d + turning @ base.b[rates]
        seen |= dict(zip(ACCELERATIONS, zip(*felt)))
    c, d = (np.array(one) for one in zip(*rows.values(), *seen.values()))
    outputs = (*_TRUE.values(), *seen)
    sensors = (*RATES, *ACCELERATIONS) if feels else RATES
    late = {name: gyro.delays.get(name, 0.0) for name in sensors}
    whole = LinearSystem(
        base.a, base.b, c, d, None, base.inputs, outputs, base.states, output_delays=late
    ).discretise(period)
    lines = [f"{name}_{k}" for k in range(waits) for name in RATES]
    lines += [f"{name}_0" for name in ACCELERATIONS if feels]
    return whole.reordered((*base.states, *lines))
