"""A flight that is over before its time: cut there, with its state and its last second."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.errors import DivergedError
from helisim.physics.native import installed
from helisim.records.channels import (
    ACCELERATIONS,
    AIR,
    ATTITUDES,
    CHANNELS,
    IN2,
    POSITIONS,
    RATES,
    ROTOR,
    SERVOS,
    VELOCITIES,
    Channel,
)
from helisim.records.record import FlightRecord
from helisim.sim.envelope import Watch, told
from helisim.sim.trajectory import End, Truth, read_truth, sound_samples
from helisim.vehicle import Vehicle

_LAST = 1.0
"""s, before the end, that are kept as they truly were."""
_AT_IMU = (*VELOCITIES, *ACCELERATIONS, *POSITIONS)


def watched(
    vehicle: Vehicle,
    watch: Watch,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    sensordata: NDArray[np.float64],
) -> Truth:
    """Return what truly happened in a flight, up to where it is over.

    Args:
        vehicle: that flew.
        watch: over the flight.
        model: of the flight, with pilot and manoeuvre.
        start: (n_state,) full physics state.
        sensordata: (n_step, nsensordata), of the time before each step.

    Raises:
        DivergedError: there is no flight at all.
    """
    count, how = sound_samples(model, sensordata)
    if count == 0:
        raise DivergedError(how)
    truth = read_truth(vehicle, sensordata[:count])
    found = watch.end(vehicle, truth)
    if found is None and count == len(sensordata):
        return truth
    at = count * model.opt.timestep
    if found is not None:
        count, how = found
        at = float(truth.time[count])
    if count == 0:
        raise DivergedError(told(at, how))
    state, warnings = _again(model, start, count)
    if found is None and warnings:
        how = f"MuJoCo warned of {', '.join(warnings)}"
    return truth.until(count, End(at, how, state))


def _again(
    model: mujoco.MjModel, start: NDArray[np.float64], samples: int
) -> tuple[NDArray[np.float64], list[str]]:
    """Fly again; return the state of the last sample, and what MuJoCo warns of after it.

    A batch keeps no states, and doesn't tell which of its flights a warning was in.
    """
    data = mujoco.MjData(model)
    with installed():
        states, _ = rollout.rollout(model, data, start[None], nstep=samples)
    kinds = [
        kind for kind in mujoco.mjtWarning.__members__.values() if int(kind) < len(data.warning)
    ]
    warned = [kind.name.removeprefix("mjWARN_") for kind in kinds if data.warning[int(kind)].number]
    return (states[0, samples - 2] if samples > 1 else start).copy(), warned


def last_second(truth: Truth, provenance: Mapping[str, Any]) -> FlightRecord:
    """Return the last second of a flight at the simulation's rate, true to the last digit.

    Beside the usual channels it has the servos' positions. Velocities, forces and positions are
    the IMU's.

    Args:
        truth: of a flight that has at least two samples.
        provenance: kept with the record.
    """
    truth = truth.since(truth.time[-1] - _LAST)
    thrust, torque, _, tail_thrust = truth.rotor.T
    groups = {
        IN2: truth.sticks.T,
        SERVOS: truth.servo_commands.T,
        RATES: truth.rates.T,
        ATTITUDES: truth.attitudes.T,
        VELOCITIES: truth.velocities.T,
        ACCELERATIONS: truth.specific_forces.T,
        POSITIONS: truth.positions.T,
        ROTOR: (*truth.flapping.T, thrust, torque, tail_thrust),
        AIR: truth.air.T,
    }
    channels = [_channel(name) for names in groups for name in names]
    channels += [
        Channel(f"{name}_position", "1", "OTHER", f"true position of {name}") for name in SERVOS
    ]
    columns = [column for of_group in groups.values() for column in of_group]
    values = np.column_stack([*columns, truth.servo_positions])
    return FlightRecord(truth.time, values, tuple(channels), provenance)


def _channel(name: str) -> Channel:
    one = CHANNELS[name]
    if name not in _AT_IMU:
        return one
    return replace(one, meaning=one.meaning.replace("the centre of gravity", "the IMU"))
