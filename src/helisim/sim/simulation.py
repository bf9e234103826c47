"""What truly happens in flights: pilot, gyro, servos and rotor in native steps, many at a time."""

import copy
import os
from collections.abc import Iterator, Sequence

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.errors import DivergedError, InputError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.sim.ending import watched
from helisim.sim.excitation import Excitation
from helisim.sim.faults import FlightFault, write_faults
from helisim.sim.pilot import Pilot
from helisim.sim.truth import Truth
from helisim.sim.watch import Watch, told
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place

_Flown = tuple[mujoco.MjModel, NDArray[np.float64], NDArray[np.float64]]
"""The model of a flight, its first state, and its sensor data."""


def simulate(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    weather: Weather | None = None,
    faults: Sequence[FlightFault] = (),
    watch: Watch | None = None,
    keep_ended: bool = False,
    jobs: int | None = None,
) -> Iterator[Truth]:
    """Yield what truly happens in each flight; arguments and errors as for `fly`.

    Only as many flights as threads are in memory at a time. `Truth.end` says why a flight that
    is kept was over before its time.
    """
    numbers = flight_numbers(count)
    pilot, weather = pilot or Pilot(), weather or Weather()
    truths = simulated(
        vehicle,
        excitation,
        numbers,
        seed=seed,
        pilot=pilot,
        weather=weather,
        faults=faults,
        watch=watch or Watch(),
        jobs=jobs,
    )

    def kept(truth: Truth) -> Truth:
        if truth.end is not None and not keep_ended:
            raise DivergedError(told(truth.end.at, truth.end.why))
        return truth

    return map(kept, truths)


def flight_numbers(count: int) -> range:
    """Return the numbers of so many flights. Raises InputError."""
    if not isinstance(count, int) or count < 1:
        raise InputError(f"count must be an integer of 1 or more, got {count}")
    return range(count)


def simulated(
    vehicle: Vehicle,
    excitation: Excitation,
    numbers: Sequence[int],
    *,
    seed: int,
    pilot: Pilot,
    weather: Weather,
    faults: Sequence[FlightFault],
    watch: Watch,
    jobs: int | None,
) -> Iterator[Truth]:
    """Yield what truly happens in the flights of these numbers, up to where each is over."""
    threads = (os.cpu_count() or 1) if jobs is None else jobs
    for name, number, least in (("jobs", threads, 1), ("seed", seed, 0)):
        if not isinstance(number, int) or number < least:
            raise InputError(f"{name} must be an integer of {least} or more, got {number}")
    vehicle = weather.trimmed(vehicle)
    batches = (numbers[k : k + threads] for k in range(0, len(numbers), threads))

    def flown(batch: Sequence[int]) -> list[_Flown]:
        models = [
            prepare(vehicle, excitation, pilot, weather, faults, seed=seed, number=k) for k in batch
        ]
        starts = [_start(vehicle, weather, seed=seed, number=k) for k in batch]
        return list(zip(models, starts, _run(models, starts, excitation.duration)))

    return (watched(vehicle, watch, *flight) for batch in batches for flight in flown(batch))


def _run(
    models: Sequence[mujoco.MjModel], starts: Sequence[NDArray[np.float64]], duration: float
) -> NDArray[np.float64]:
    steps = round(duration / models[0].opt.timestep) + 1
    workers = [mujoco.MjData(model) for model in models]
    with installed():
        _, sensordata = rollout.rollout(
            list(models), workers, initial_state=np.stack(starts), nstep=steps
        )
    return sensordata


def prepare(
    vehicle: Vehicle,
    excitation: Excitation,
    pilot: Pilot,
    weather: Weather,
    faults: Sequence[FlightFault] = (),
    *,
    seed: int,
    number: int,
) -> mujoco.MjModel:
    """Return a copy of the vehicle's model with pilot, manoeuvre, weather and faults of a flight.

    Args:
        vehicle: trimmed for the weather's steady wind.
        excitation: sweep or doublet.
        pilot: who flies.
        weather: of the flight.
        faults: of servos and gyro.
        seed: of pilot and turbulence.
        number: of the flight.
    """
    model = copy.copy(vehicle.model)
    par = model.actuator_user[addresses(model).rotor]
    hand, air = (
        int(generator(seed, number, purpose).integers(2**31)) for purpose in ("pilot", "air")
    )
    pilot.write(par, vehicle, seed=hand, height=weather.height)
    excitation.on(vehicle.parameters).write(par)
    weather.write(par, vehicle, seed=air)
    write_faults(par, faults)
    return model


def _start(vehicle: Vehicle, weather: Weather, *, seed: int, number: int) -> NDArray[np.float64]:
    """Return the full state in which a flight starts."""
    data = mujoco.MjData(vehicle.model)
    place(vehicle.model, data, vehicle.trim, height=weather.height)
    first = addresses(vehicle.model).state
    rough = weather.start(vehicle, generator(seed, number, "first air"))
    data.act[first + STATE.air_u : first + len(STATE)] = rough
    state = np.empty(mujoco.mj_stateSize(vehicle.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(vehicle.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose in one flight of a seed."""
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])
