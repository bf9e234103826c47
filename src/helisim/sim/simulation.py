"""Fly plans: pilot, gyro, servos and rotor in native steps, many flights at a time."""

import copy
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import TypeVar

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.physics.drive import MOTOR
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.sim.ending import until_end, userdata
from helisim.sim.envelope import terminated_early
from helisim.sim.faults import write_faults
from helisim.sim.injection import injection
from helisim.sim.missions.flight import MissionFlight
from helisim.sim.missions.mission import Mission
from helisim.sim.plan import FlightPlan, Flyable, as_plan
from helisim.sim.trajectory import Trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.force_laws import check_motor
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import Trim, find_trim, place

Result = TypeVar("Result")

_APART = 5.0
"""m/s between the speeds at which a trim is looked for, each near the last."""


def simulate(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    keep_ended: bool = False,
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Trajectory]:
    """Yield what truly happens in each flight of a plan; arguments and errors as for `fly`.

    Only as many flights as threads are in memory at a time. `Trajectory.end` says why a flight
    that is kept was terminated early.
    """
    numbers = flight_numbers(count)
    trajectories = simulated(vehicle, plan, numbers, lambda _, one: one, seed=seed, jobs=jobs)

    def kept(trajectory: Trajectory) -> Trajectory:
        end = trajectory.end
        if end is not None and not keep_ended:
            scripted = trajectory.script is not None
            raise terminated_early(end.at, end.why, end.traceback, scripted=scripted)
        return trajectory

    return (kept(one) for one in trajectories)


def flight_numbers(count: int) -> range:
    """Return the numbers of so many flights. Raises InputError."""
    if not isinstance(count, int) or count < 1:
        raise InputError(f"count must be an integer of 1 or more, got {count}")
    return range(count)


def thread_count(jobs: int | None, name: str = "jobs") -> int:
    """Return how many threads are asked for: all processors if None. Raises InputError."""
    threads = (os.cpu_count() or 1) if jobs is None else jobs
    _check_at_least(name, threads, 1)
    return threads


def _check_at_least(name: str, number: int, least: int) -> None:
    if not isinstance(number, int) or number < least:
        raise InputError(f"{name} must be an integer of {least} or more, got {number}")


def simulated(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, Trajectory], Result],
    *,
    seed: int,
    jobs: int | None,
) -> Iterator[Result]:
    """Yield what `then` makes of each flight's number and trajectory, in the order of numbers.

    A thread does all of a flight, and nothing goes on in threads while the caller has the word.
    """
    threads = thread_count(jobs)
    _check_at_least("seed", seed, 0)
    plan = as_plan(plan)
    vehicle, grounded = _placed(_powered(vehicle, plan), plan)
    buffers = _state_buffers(grounded, min(threads, len(numbers)), plan)
    excitation = None if plan.excitation is None else plan.excitation.on(vehicle.parameters)
    added = None if excitation is None else injection(excitation, vehicle)
    places = () if excitation is None else excitation.places
    trim = start_trim(vehicle, plan.mission)

    def flown(number: int, buffer: NDArray[np.float64]) -> Result:
        model = prepare(vehicle, plan, seed=seed, number=number, model=grounded)
        start = _start(vehicle, plan, trim, grounded, seed=seed, number=number)
        if plan.mission is not None:
            mission = MissionFlight(plan.mission, vehicle, model, trim, plan.ground, added)
            flight = mission.trajectory(plan.envelope, start)
            return then(number, flight.injected(added, places))
        with vehicle.controller.flying(model) as flying:
            sensordata = _run(model, start, buffer, added)
            failure = flying.failure()
        flight = until_end(
            vehicle, plan.envelope, model, start, sensordata, added, failure, ground=plan.ground
        )
        return then(number, flight.injected(added, places))

    def batches() -> Iterator[Result]:
        with ThreadPoolExecutor(threads) as pool:
            for first in range(0, len(numbers), threads):
                batch = numbers[first : first + threads]
                flights = [pool.submit(flown, *one) for one in zip(batch, buffers)]
                wait(flights)
                yield from (flight.result() for flight in flights)

    return batches()


def _powered(vehicle: Vehicle, plan: FlightPlan) -> Vehicle:
    """Return a vehicle whose rotor a motor turns, where a mission needs one.

    Raises:
        ModelError: the vehicle has none.
    """
    if plan.mission is None or not plan.mission.engine:
        return vehicle
    why = f"in the mission {plan.mission.name} a motor turns the rotor of {vehicle.name}"
    check_motor(vehicle.parameters, why)
    model = copy.copy(vehicle.model)
    model.actuator_user[addresses(model).rotor, PARAM.drive_governor] = MOTOR
    trim = find_trim(model, height=vehicle.trim.height, near=vehicle.trim)
    powered = Vehicle(vehicle.folder, vehicle.parameters, model, trim, vehicle.controller)
    return replace(powered, controller=vehicle.controller.on(powered))


def _placed(vehicle: Vehicle, plan: FlightPlan) -> tuple[Vehicle, mujoco.MjModel]:
    """Return a vehicle trimmed where a plan has it hover, and its model with what is there."""
    ground = plan.ground
    if ground is None:
        vehicle = plan.weather.trimmed(vehicle)
        return vehicle, vehicle.model
    vehicle = plan.weather.trimmed(ground.felt_by(vehicle))
    return vehicle, vehicle.grounded_model(ground.put_into)


def _state_buffers(
    model: mujoco.MjModel, flights: int, plan: FlightPlan
) -> list[NDArray[np.float64]]:
    """Return memory for the states of a flight in each thread, (1, n_step, n_state), never read.

    New memory for each flight would cost a fifth of the time: the threads wait for its pages. A
    mission is stepped from its script, and needs none.
    """
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    steps = round(plan.duration / model.opt.timestep) + 1 if plan.mission is None else 0
    return [np.empty((1, steps, size)) for _ in range(flights)]


def _run(
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    buffer: NDArray[np.float64],
    added: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """Return the sensor data of a flight, (n_step, nsensordata)."""
    with installed():
        _, sensordata = rollout.rollout(
            model,
            mujoco.MjData(model),
            initial_state=start,
            control=userdata(model, added),
            control_spec=mujoco.mjtState.mjSTATE_USERDATA,
            nstep=buffer.shape[1],
            state=buffer,
        )
    return sensordata[0]


def prepare(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    seed: int,
    number: int,
    model: mujoco.MjModel | None = None,
) -> mujoco.MjModel:
    """Return a copy of the vehicle's model that flies one flight of a plan.

    What no compiled formula adds comes in `mjData.userdata`: before each step, the row of the
    excitation's `injection`.

    Args:
        vehicle: trimmed for the weather's steady wind.
        plan: of the flight.
        seed: of pilot and turbulence.
        number: of the flight.
        model: to copy in place of the vehicle's own: of the same vehicle on the ground.
    """
    plan = as_plan(plan)
    copied: mujoco.MjModel = copy.copy(model or vehicle.model)
    par = copied.actuator_user[addresses(copied).rotor]
    pilot_seed, air_seed = (
        int(generator(seed, number, purpose).integers(2**31)) for purpose in ("pilot", "air")
    )
    plan.pilot.write(par, vehicle, seed=pilot_seed, height=plan.weather.height)
    if plan.excitation is not None:
        plan.excitation.on(vehicle.parameters).write(par)
    plan.weather.write(par, vehicle, seed=air_seed)
    write_faults(par, plan.flight_faults)
    trim = vehicle.trim
    held = (*vehicle.swashplate.mix(trim.col, trim.lon, trim.lat), trim.ped)
    vehicle.controller.plan_for(par, held)
    return copied


def start_trim(vehicle: Vehicle, mission: Mission | None) -> Trim:
    """Return the steady flight in which flights begin: the hover, or what a mission starts from.

    Raises:
        TrimError: the vehicle can't fly as fast.
    """
    trim, speed = vehicle.trim, 0.0 if mission is None else mission.start.speed
    for k in range(math.ceil(speed / _APART)):
        trim = find_trim(
            vehicle.model, speed=min(speed, (k + 1) * _APART), height=trim.height, near=trim
        )
    return trim


def _start(
    vehicle: Vehicle,
    plan: FlightPlan,
    trim: Trim,
    model: mujoco.MjModel,
    *,
    seed: int,
    number: int,
) -> NDArray[np.float64]:
    """Return the full physics state in which a flight starts, (n_state,)."""
    data, weather = mujoco.MjData(model), plan.weather
    height = None if plan.mission is None else plan.mission.start.height
    place(model, data, trim, height=weather.height if height is None else height)
    if plan.ground is not None:
        plan.ground.begin(vehicle, model, data)
    first = addresses(model).state
    rough = weather.start(vehicle, generator(seed, number, "first air"))
    data.act[first + STATE.air_u : first + STATE.feels_x] = rough
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose in one flight of a seed."""
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])
