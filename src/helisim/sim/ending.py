"""Where a flight ends: whole, or cut where it leaves the envelope or its states break."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.base.errors import DivergedError
from helisim.physics.laws import Failure
from helisim.physics.native import installed
from helisim.sim.envelope import FlightEnvelope, terminated_early
from helisim.sim.ground import Ground
from helisim.sim.trajectory import End, Trajectory, read_trajectory, sound_samples
from helisim.vehicle import Vehicle

Again = tuple[NDArray[np.float64], list[str]]
"""A full physics state, (n_state,), and what MuJoCo warned of."""


def userdata(
    model: mujoco.MjModel, added: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Return what is added at each step as all the user data of a model, (1, n_step, n)."""
    if added is None:
        return None
    return np.pad(added, ((0, 0), (0, model.nuserdata - added.shape[1])))[None]


def until_end(
    vehicle: Vehicle,
    envelope: FlightEnvelope,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    sensordata: NDArray[np.float64],
    added: NDArray[np.float64] | None = None,
    failure: Failure | None = None,
    ground: Ground | None = None,
    *,
    who: str = "",
    again: Callable[[int], Again] | None = None,
) -> Trajectory:
    """Return the trajectory of a flight, cut where it leaves the envelope or its states break.

    Args:
        vehicle: that flew.
        envelope: that it must stay in.
        model: of the flight, with pilot and excitation.
        start: (n_state,) full physics state.
        sensordata: (n_step, nsensordata), of the time before each step.
        added: (n_step, n_injection) `injection` of the excitation.
        failure: of the controller, or of a mission's script; None if there was none.
        ground: that was below; None if nothing was.
        who: failed, in words; "" for the controller.
        again: flies so many samples again, for the state of the last and what MuJoCo warns of; None
            for a flight in which nobody but the force laws acts.

    Raises:
        DivergedError: not one sample is within the envelope.
    """
    count, why = sound_samples(model, sensordata)
    if failure is not None:
        why = f"{who or f'controller {vehicle.controller.name!r}'} {failure.why}"
    if count == 0:
        raise terminated_early(0.0, why, failure.traceback) if failure else DivergedError(why)
    trajectory = replace(read_trajectory(vehicle, sensordata[:count]), ground=ground)
    found = envelope.end(vehicle, trajectory)
    if found is None and failure is None and count == len(sensordata):
        return trajectory
    at = count * model.opt.timestep
    if found is not None:
        count, why = found
        at = float(trajectory.time[count])
    if count == 0:
        raise terminated_early(at, why)
    if again is None:
        again = partial(_flown_again, vehicle, model, start, added)
    state, warnings = again(count)
    if found is not None or failure is None:
        failure = None
        if found is None and warnings:
            why = f"MuJoCo warned of {', '.join(warnings)}"
    return trajectory.until(count, End(at, why, state, failure.traceback if failure else None))


def _flown_again(
    vehicle: Vehicle,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    added: NDArray[np.float64] | None,
    samples: int,
) -> Again:
    """Fly again; return the state of the last sample, and what MuJoCo warns of after it.

    A batch keeps no states, and doesn't say which of its flights a warning was in.
    """
    data = mujoco.MjData(model)
    with vehicle.controller.flying(model), installed():
        states, _ = rollout.rollout(
            model,
            data,
            start[None],
            userdata(model, None if added is None else added[:samples]),
            control_spec=mujoco.mjtState.mjSTATE_USERDATA,
            nstep=samples,
        )
    return (states[0, samples - 2] if samples > 1 else start).copy(), warned(data)


def warned(data: mujoco.MjData) -> list[str]:
    """Return what MuJoCo has warned of, by its own names."""
    kinds = [
        kind for kind in mujoco.mjtWarning.__members__.values() if int(kind) < len(data.warning)
    ]
    return [kind.name.removeprefix("mjWARN_") for kind in kinds if data.warning[int(kind)].number]
