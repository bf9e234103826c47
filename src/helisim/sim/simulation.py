"""What truly happens in flights: pilot, gyro, servos and rotor in native steps, many at a time."""

import copy
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.errors import DivergedError, InputError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.sim.ending import watched
from helisim.sim.envelope import Watch, told
from helisim.sim.excitation import Excitation
from helisim.sim.faults import FlightFault, write_faults
from helisim.sim.pilot import Pilot
from helisim.sim.trajectory import Truth
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place

Result = TypeVar("Result")


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
        then=lambda _, truth: truth,
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
    then: Callable[[int, Truth], Result],
    jobs: int | None,
) -> Iterator[Result]:
    """Yield what `then` makes of each flight's number and truth, up to where the flight is over.

    A thread does all of a flight, and nothing goes on in threads while the caller has the word.
    """
    threads = (os.cpu_count() or 1) if jobs is None else jobs
    for name, number, least in (("jobs", threads, 1), ("seed", seed, 0)):
        if not isinstance(number, int) or number < least:
            raise InputError(f"{name} must be an integer of {least} or more, got {number}")
    vehicle = weather.trimmed(vehicle)
    rooms = _rooms_for_states(vehicle, min(threads, len(numbers)), excitation.duration)

    def flown(number: int, room: NDArray[np.float64]) -> Result:
        model = prepare(vehicle, excitation, pilot, weather, faults, seed=seed, number=number)
        start = _start(vehicle, weather, seed=seed, number=number)
        sensordata = _run(model, start, room)
        return then(number, watched(vehicle, watch, model, start, sensordata))

    def batches() -> Iterator[Result]:
        with ThreadPoolExecutor(threads) as pool:
            for first in range(0, len(numbers), threads):
                batch = numbers[first : first + threads]
                flights = [pool.submit(flown, *one) for one in zip(batch, rooms)]
                wait(flights)
                yield from (flight.result() for flight in flights)

    return batches()


def _rooms_for_states(vehicle: Vehicle, flights: int, duration: float) -> list[NDArray[np.float64]]:
    """Return memory for the states of a flight in each thread, which nobody reads.

    New memory for each flight would cost a fifth of the time: the threads wait for its pages.
    """
    size = mujoco.mj_stateSize(vehicle.model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    steps = round(duration / vehicle.model.opt.timestep) + 1
    return [np.empty((1, steps, size)) for _ in range(flights)]


def _run(
    model: mujoco.MjModel, start: NDArray[np.float64], room: NDArray[np.float64]
) -> NDArray[np.float64]:
    with installed():
        _, sensordata = rollout.rollout(
            model, mujoco.MjData(model), initial_state=start, nstep=room.shape[1], state=room
        )
    return sensordata[0]


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
