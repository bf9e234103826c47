"""Fly plans: pilot, gyro, servos and rotor in native steps, many flights at a time."""

import copy
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from typing import TypeVar

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.errors import DivergedError, InputError
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.physics.own_laws import Failure
from helisim.sim.envelope import FlightEnvelope, terminated_early
from helisim.sim.faults import write_faults
from helisim.sim.ground import Ground
from helisim.sim.injection import injection
from helisim.sim.plan import FlightPlan, Flyable, as_plan
from helisim.sim.trajectory import End, Trajectory, read_trajectory, sound_samples
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place

Result = TypeVar("Result")


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
            raise terminated_early(end.at, end.why, end.traceback)
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
    vehicle, grounded = _placed(vehicle, plan)
    buffers = _state_buffers(grounded, min(threads, len(numbers)), plan.excitation.duration)
    added = injection(plan.excitation.on(vehicle.parameters), vehicle)

    def flown(number: int, buffer: NDArray[np.float64]) -> Result:
        model = prepare(vehicle, plan, seed=seed, number=number, model=grounded)
        start = _start(vehicle, plan.weather, plan.ground, grounded, seed=seed, number=number)
        with vehicle.controller.flying(model) as flying:
            sensordata = _run(model, start, buffer, added)
            failure = flying.failure()
        flight = until_end(
            vehicle, plan.envelope, model, start, sensordata, added, failure, ground=plan.ground
        )
        return then(number, flight.injected(added, plan.excitation.places))

    def batches() -> Iterator[Result]:
        with ThreadPoolExecutor(threads) as pool:
            for first in range(0, len(numbers), threads):
                batch = numbers[first : first + threads]
                flights = [pool.submit(flown, *one) for one in zip(batch, buffers)]
                wait(flights)
                yield from (flight.result() for flight in flights)

    return batches()


def _placed(vehicle: Vehicle, plan: FlightPlan) -> tuple[Vehicle, mujoco.MjModel]:
    """Return a vehicle trimmed where a plan has it hover, and its model with what is there."""
    ground = plan.ground
    if ground is None:
        vehicle = plan.weather.trimmed(vehicle)
        return vehicle, vehicle.model
    vehicle = plan.weather.trimmed(ground.felt_by(vehicle))
    return vehicle, vehicle.grounded_model(ground.put_into)


def _state_buffers(
    model: mujoco.MjModel, flights: int, duration: float
) -> list[NDArray[np.float64]]:
    """Return memory for the states of a flight in each thread, (1, n_step, n_state), never read.

    New memory for each flight would cost a fifth of the time: the threads wait for its pages.
    """
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    steps = round(duration / model.opt.timestep) + 1
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
            control=_userdata(model, added),
            control_spec=mujoco.mjtState.mjSTATE_USERDATA,
            nstep=buffer.shape[1],
            state=buffer,
        )
    return sensordata[0]


def _userdata(
    model: mujoco.MjModel, added: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Return what is added at each step as all the user data of a model, (1, n_step, n)."""
    if added is None:
        return None
    return np.pad(added, ((0, 0), (0, model.nuserdata - added.shape[1])))[None]


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
    model = copy.copy(vehicle.model if model is None else model)
    par = model.actuator_user[addresses(model).rotor]
    pilot_seed, air_seed = (
        int(generator(seed, number, purpose).integers(2**31)) for purpose in ("pilot", "air")
    )
    plan.pilot.write(par, vehicle, seed=pilot_seed, height=plan.weather.height)
    plan.excitation.on(vehicle.parameters).write(par)
    plan.weather.write(par, vehicle, seed=air_seed)
    write_faults(par, plan.flight_faults)
    trim = vehicle.trim
    held = (*vehicle.swashplate.mix(trim.col, trim.lon, trim.lat), trim.ped)
    vehicle.controller.plan_for(par, held)
    return model


def _start(
    vehicle: Vehicle,
    weather: Weather,
    ground: Ground | None = None,
    model: mujoco.MjModel | None = None,
    *,
    seed: int,
    number: int,
) -> NDArray[np.float64]:
    """Return the full physics state in which a flight starts, (n_state,)."""
    model = vehicle.model if model is None else model
    data = mujoco.MjData(model)
    place(model, data, vehicle.trim, height=weather.height)
    if ground is not None:
        ground.begin(vehicle, model, data)
    first = addresses(model).state
    rough = weather.start(vehicle, generator(seed, number, "first air"))
    data.act[first + STATE.air_u : first + STATE.feels_x] = rough
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose in one flight of a seed."""
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])


def until_end(
    vehicle: Vehicle,
    envelope: FlightEnvelope,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    sensordata: NDArray[np.float64],
    added: NDArray[np.float64] | None = None,
    failure: Failure | None = None,
    ground: Ground | None = None,
) -> Trajectory:
    """Return the trajectory of a flight, cut where it leaves the envelope or its states break.

    Args:
        vehicle: that flew.
        envelope: that it must stay in.
        model: of the flight, with pilot and excitation.
        start: (n_state,) full physics state.
        sensordata: (n_step, nsensordata), of the time before each step.
        added: (n_step, n_injection) `injection` of the excitation.
        failure: of the controller, None if it didn't fail.
        ground: that was below; None if nothing was.

    Raises:
        DivergedError: not one sample is within the envelope.
    """
    count, why = sound_samples(model, sensordata)
    if failure is not None:
        why = f"controller {vehicle.controller.name!r} {failure.why}"
    if count == 0:
        raise terminated_early(0.0, why, failure.traceback) if failure else DivergedError(why)
    trajectory = replace(read_trajectory(vehicle, sensordata[:count]), ground=ground)
    found = envelope.end(vehicle, trajectory)
    if found is None and count == len(sensordata):
        return trajectory
    at = count * model.opt.timestep
    if found is not None:
        count, why = found
        at = float(trajectory.time[count])
    if count == 0:
        raise terminated_early(at, why)
    state, warnings = _flown_again(vehicle, model, start, count, added)
    if found is not None or failure is None:
        failure = None
        if found is None and warnings:
            why = f"MuJoCo warned of {', '.join(warnings)}"
    return trajectory.until(count, End(at, why, state, failure.traceback if failure else None))


def _flown_again(
    vehicle: Vehicle,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    samples: int,
    added: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], list[str]]:
    """Fly again; return the state of the last sample, and what MuJoCo warns of after it.

    A batch keeps no states, and doesn't say which of its flights a warning was in.
    """
    data = mujoco.MjData(model)
    with vehicle.controller.flying(model), installed():
        states, _ = rollout.rollout(
            model,
            data,
            start[None],
            _userdata(model, None if added is None else added[:samples]),
            control_spec=mujoco.mjtState.mjSTATE_USERDATA,
            nstep=samples,
        )
    kinds = [
        kind for kind in mujoco.mjtWarning.__members__.values() if int(kind) < len(data.warning)
    ]
    warned = [kind.name.removeprefix("mjWARN_") for kind in kinds if data.warning[int(kind)].number]
    return (states[0, samples - 2] if samples > 1 else start).copy(), warned
