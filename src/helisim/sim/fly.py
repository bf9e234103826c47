"""Fly: pilot, gyro, servos and rotor in native steps, and the recorder behind them."""

import copy
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.errors import InputError
from helisim.physics.native import installed
from helisim.provenance import made_by
from helisim.record import FlightRecord
from helisim.sim.excitation import Excitation
from helisim.sim.instruments import Recorder
from helisim.sim.pilot import Pilot
from helisim.sim.truth import Truth, read_truth
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place

_HEIGHT = 20.0
"""m above the ground: out of its effect, with room for a heave sweep."""


def fly(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> list[FlightRecord]:
    """Fly the same manoeuvre a number of times and record each flight.

    The result depends on the vehicle, the arguments and the seed, not on `jobs`.

    Args:
        vehicle: that flies.
        excitation: sweep or doublet.
        count: number of flights.
        seed: of pilots and sensors; flight k of a seed is always the same.
        pilot: the default `Pilot` if None.
        recorder: the vehicle's own if None.
        jobs: threads; all processors if None.
        on_flight: called after each flight, for progress.

    Returns:
        One record a flight.

    Raises:
        InputError: count, seed or jobs is out of range.
        DivergedError: a flight left the validity of the model.
    """
    recorder = recorder or Recorder.of(vehicle)
    records = []
    for k, truth in enumerate(
        simulate(vehicle, excitation, count=count, seed=seed, pilot=pilot, jobs=jobs)
    ):
        provenance = _provenance(vehicle, excitation, pilot or Pilot(), recorder, seed, k)
        records.append(recorder.record(truth, _generator(seed, k, "sensors"), provenance))
        if on_flight is not None:
            on_flight()
    return records


def simulate(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    jobs: int | None = None,
) -> Iterator[Truth]:
    """Yield what truly happens in each flight; arguments and errors as for `fly`.

    Only as many flights as threads are in memory at a time.
    """
    jobs = (os.cpu_count() or 1) if jobs is None else jobs
    if not all(isinstance(number, int) for number in (count, jobs, seed)):
        raise InputError(f"count, jobs and seed must be integers, got {count}, {jobs}, {seed}")
    if count < 1 or jobs < 1 or seed < 0:
        raise InputError(
            f"count and jobs must be 1 or more and seed 0 or more, got {count}, {jobs}, {seed}"
        )
    numbers = range(count)
    for start in range(0, count, jobs):
        batch = numbers[start : start + jobs]
        models = [
            prepare(vehicle, excitation, pilot or Pilot(), seed=seed, number=k) for k in batch
        ]
        for sensordata in _run(vehicle, models, excitation.duration):
            yield read_truth(vehicle, sensordata)


def _run(
    vehicle: Vehicle, models: Sequence[mujoco.MjModel], duration: float
) -> NDArray[np.float64]:
    model = vehicle.model
    steps = round(duration / model.opt.timestep) + 1
    start = mujoco.MjData(model)
    place(model, start, vehicle.trim, height=_HEIGHT)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.empty(size)
    mujoco.mj_getState(model, start, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    workers = [mujoco.MjData(model) for _ in models]
    with installed():
        _, sensordata = rollout.rollout(
            list(models),
            workers,
            initial_state=np.tile(state, (len(models), 1)),
            nstep=steps,
        )
    return sensordata


def prepare(
    vehicle: Vehicle, excitation: Excitation, pilot: Pilot, *, seed: int, number: int
) -> mujoco.MjModel:
    """Return a copy of the vehicle's model with pilot and manoeuvre of one flight in place."""
    model = copy.copy(vehicle.model)
    par = model.actuator_user[addresses(model).rotor]
    hand = int(_generator(seed, number, "pilot").integers(2**31))
    pilot.write(par, vehicle, seed=hand, height=_HEIGHT)
    excitation.write(par)
    return model


def _generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])


def _provenance(
    vehicle: Vehicle,
    excitation: Excitation,
    pilot: Pilot,
    recorder: Recorder,
    seed: int,
    number: int,
) -> dict[str, Any]:
    plain = {key: getattr(excitation, key) for key in excitation.__dataclass_fields__}
    return made_by(
        "simulation",
        **vehicle.provenance,
        excitation={"kind": type(excitation).__name__, **plain},
        pilot={key: getattr(pilot, key) for key in pilot.__dataclass_fields__},
        recorder=recorder.as_dict(),
        seed=seed,
        flight=number,
    )
