"""The flight loop, and whole flights of a plan."""

import copy
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypeVar

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.base.errors import InputError
from helisim.base.files import make_folder
from helisim.base.settings import to_plain
from helisim.physics.drive import MOTOR
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, made_by
from helisim.records.storage import write_record
from helisim.sim.excitation import injection, injection_digest
from helisim.sim.ground import Ground
from helisim.sim.missions.mission import Reached, ScriptedPilot, Start
from helisim.sim.plan import FlightPlan, Flyable, ServoStuck, as_plan, write_faults
from helisim.sim.recorder import End, Recorder, Trajectory, read_trajectory, sound_samples
from helisim.sim.weather import Weather
from helisim.vehicle import ControllerLike, Vehicle
from helisim.vehicle.addresses import addresses
from helisim.vehicle.assembly import check_motor
from helisim.vehicle.trim import Trim, find_trim, place, set_governor

Result = TypeVar("Result")
Command = tuple[int, Callable[[mujoco.MjData], object]]
"""The number of steps between calls, and a function that ends the flight by returning True."""

_APART = 5.0  # m/s between the speeds at which a trim is looked for, each near the last
_FEWEST_SAMPLES = 2  # beside the first, of the shortest record
_PHYSICS = mujoco.mjtState.mjSTATE_FULLPHYSICS


def steps(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    *commands: Command,
    added: NDArray[np.float64] | None = None,
    first: int = 0,
    count: int | None = None,
    each: int = 1,
) -> Iterator[int]:
    """Fly on by a step at a time, and yield how many there were since the start.

    The force laws must be installed. After a step sensor data are of the time before it. `added`
    is an `injection`, (n_step, n_injection), whose last row stays. `first` steps were made before,
    `count` None never ends, `each` time steps are one step here.
    """
    number = first
    while count is None or number < count:
        for every, command in commands:
            if number % every == 0 and command(data) is True:
                return
        if added is not None:
            row = added[min(number, len(added) - 1)]
            data.userdata[: row.size] = row
        mujoco.mj_step(model, data, each)
        number += 1
        yield number


def roll(
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    count: int,
    *,
    added: NDArray[np.float64] | None = None,
    control: NDArray[np.float64] | None = None,
    state: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Fly a whole flight natively; return its sensor data, (n_step, nsensordata).

    The start is a full physics state, (n_state,). Optional are an injection, (n_step, n_injection),
    control, (n_step, n_control), and memory for the states, (1, n_step, n_state).
    """
    inputs, spec = control, mujoco.mjtState.mjSTATE_CTRL
    if control is None:
        spec = mujoco.mjtState.mjSTATE_USERDATA
        rest = 0 if added is None else model.nuserdata - added.shape[1]
        inputs = None if added is None else np.pad(added, ((0, 0), (0, rest)))
    with installed():
        _, sensordata = rollout.rollout(
            model,
            mujoco.MjData(model),
            initial_state=start,
            control=None if inputs is None else inputs[None],
            control_spec=spec,
            nstep=count,
            state=state,
        )
    return sensordata[0]


def simulate(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    keep_ended: bool = False,
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Trajectory]:
    """Yield the trajectory of each flight of a plan; arguments and errors as for `fly`."""

    def kept(_: int, trajectory: Trajectory) -> Trajectory:
        if trajectory.end is not None and not keep_ended:
            raise trajectory.end.error()
        return trajectory

    return _simulated(vehicle, plan, range(at_least("count", count, 1)), kept, seed=seed, jobs=jobs)


def thread_count(jobs: int | None, name: str = "jobs") -> int:
    """Return how many threads are asked for: all processors if None. Raises InputError."""
    return at_least(name, (os.cpu_count() or 1) if jobs is None else jobs, 1)


def at_least(name: str, number: int, least: int) -> int:
    """Return an integer that is not less. Raises InputError."""
    if not isinstance(number, int) or number < least:
        raise InputError(f"{name} must be an integer of {least} or more, got {number!r:.60}")
    return number


def _simulated(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, Trajectory], Result],
    *,
    seed: int,
    jobs: int | None,
) -> Iterator[Result]:
    threads = thread_count(jobs)
    at_least("seed", seed, 0)
    plan = as_plan(plan).on(vehicle)
    vehicle, grounded = _placed(_powered(vehicle, plan), plan)
    added = None if plan.excitation is None else injection(plan.excitation, vehicle)
    places = () if plan.excitation is None else plan.excitation.places
    first = Start() if plan.mission is None else plan.mission.start
    trim = start_trim(vehicle, first.speed)
    # new memory for each flight would cost a fifth of the time: the threads wait for its pages
    size = mujoco.mj_stateSize(grounded, _PHYSICS)
    rows = round(plan.duration / grounded.opt.timestep) + 1 if plan.mission is None else 0
    buffers = [np.empty((1, rows, size)) for _ in range(min(threads, len(numbers)))]

    def flown(number: int, buffer: NDArray[np.float64]) -> Result:
        model = prepare(vehicle, plan, seed=seed, number=number, model=grounded)
        data, start = mujoco.MjData(grounded), np.empty(size)
        begin(vehicle, grounded, data, plan.weather, plan.ground, trim, first.height, seed, number)
        mujoco.mj_getState(grounded, data, start, _PHYSICS)
        flight = fly_from(vehicle, plan, model, start, trim, added=added, state=buffer)
        return then(number, flight.injected(added, places))

    def batches() -> Iterator[Result]:
        with ThreadPoolExecutor(threads) as pool:
            for first in range(0, len(numbers), threads):
                batch = numbers[first : first + threads]
                flights = [pool.submit(flown, *one) for one in zip(batch, buffers)]
                wait(flights)
                yield from (flight.result() for flight in flights)

    return batches()


def fly_from(
    vehicle: Vehicle,
    plan: FlightPlan,
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    trim: Trim,
    *,
    added: NDArray[np.float64] | None = None,
    state: NDArray[np.float64] | None = None,
) -> Trajectory:
    """Return one flight of a plan, cut where it leaves the envelope or its states break.

    The model is `prepare`d; start, (n_state,), added, (n_step, n_injection), and state, (1, n_step,
    n_state), are as for `roll`. Raises DivergedError if no sample is within the envelope.
    """
    count, script, who = (
        round(plan.duration / model.opt.timestep) + 1,
        None,
        f"controller {vehicle.controller.name!r}",
    )
    with vehicle.controller.flying(model) as failed:
        if plan.mission is None:
            sensordata = roll(model, start, count, added=added, state=state)
            failure = failed()
        else:
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, start, _PHYSICS)
            pilot = ScriptedPilot(plan.mission, vehicle, model, data, trim, plan.ground)
            flown = steps(model, data, *pilot.commands, added=added, count=count)
            with installed():
                rows = [data.sensordata.copy() for _ in flown]
            sensordata = np.array(rows).reshape(-1, model.nsensordata)
            failure, script = failed(), pilot.script
            if failure is None and pilot.failure is not None:
                failure, who = pilot.failure, f"mission {plan.mission.name!r}"
    kept, why = sound_samples(model, sensordata)
    said = (why,) if failure is None else (f"{who} {failure.why}", failure.traceback)
    end = End(kept * model.opt.timestep, *said)
    if kept == 0:
        raise end.error()
    flight = read_trajectory(vehicle, sensordata[:kept])
    flight = replace(flight, ground=plan.ground, script=script)
    found = plan.envelope.end(vehicle, flight)
    if found is not None:
        kept, end = found[0], End(float(flight.time[found[0]]), found[1])
    elif not end.why:
        return flight
    if kept == 0:
        raise end.error()
    return replace(flight.rows(slice(kept)), end=end)


def _powered(vehicle: Vehicle, plan: FlightPlan) -> Vehicle:
    if plan.mission is None or not plan.mission.engine:
        return vehicle
    why = f"in the mission {plan.mission.name} a motor turns the rotor of {vehicle.name}"
    check_motor(vehicle.parameters, why)
    model = copy.copy(vehicle.model)
    set_governor(model, MOTOR)
    trim = find_trim(model, height=vehicle.trim.height, near=vehicle.trim)
    powered = replace(vehicle, model=model, trim=trim)
    return replace(powered, controller=vehicle.controller.on(powered))


def _placed(vehicle: Vehicle, plan: FlightPlan) -> tuple[Vehicle, mujoco.MjModel]:
    ground = plan.ground
    vehicle = plan.weather.trimmed(vehicle if ground is None else ground.felt_by(vehicle))
    return vehicle, vehicle.model if ground is None else vehicle.grounded_model(ground.put_into)


def prepare(
    vehicle: Vehicle,
    plan: FlightPlan,
    *,
    seed: int,
    number: int,
    model: mujoco.MjModel | None = None,
) -> mujoco.MjModel:
    """Return a copy of a trimmed vehicle's model, or of `model`, that flies one flight."""
    copied: mujoco.MjModel = copy.copy(model or vehicle.model)
    par = copied.actuator_user[addresses(copied).rotor]
    pilot_seed, air_seed = (
        int(generator(seed, number, purpose).integers(2**31)) for purpose in ("pilot", "air")
    )
    plan.pilot.write(par, vehicle, seed=pilot_seed, height=plan.weather.height)
    if plan.excitation is not None:
        plan.excitation.on(vehicle.parameters).write(par)
    plan.weather.write(par, vehicle, seed=air_seed)
    write_faults(par, plan.faults)
    trim = vehicle.trim
    held = (*vehicle.swashplate.mix(trim.col, trim.lon, trim.lat), trim.ped)
    vehicle.controller.plan_for(par, held)
    return copied


def start_trim(vehicle: Vehicle, speed: float) -> Trim:
    """Return the steady flight at a speed, m/s, found from slower ones. Raises TrimError."""
    trim = vehicle.trim
    for k in range(math.ceil(speed / _APART)):
        trim = find_trim(
            vehicle.model, speed=min(speed, (k + 1) * _APART), height=trim.height, near=trim
        )
    return trim


def begin(
    vehicle: Vehicle,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    weather: Weather,
    ground: Ground | None = None,
    trim: Trim | None = None,
    height: float | None = None,
    seed: int = 0,
    number: int = 0,
) -> None:
    """Put a vehicle where a flight begins; its own trim and the weather's height, m, if None."""
    place(model, data, trim or vehicle.trim, height=weather.height if height is None else height)
    if ground is not None:
        ground.begin(vehicle, model, data)
    first = addresses(model).state + STATE.air_u
    rough = weather.start(vehicle, generator(seed, number, "first air"))
    data.act[first : first + rough.size] = rough


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose in one flight of a seed."""
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])


def fly(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    controller: ControllerLike | Literal["own"] = "own",
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
    keep_ended: bool = False,
    on_flight: Callable[[], None] | None = None,
) -> list[FlightRecord]:
    """Fly a plan, or a bare manoeuvre or mission, `count` times; return the records.

    A `controller` in place of the vehicle's own is a law of (seen, state, settings), a
    `Controller`, a law as data, or None: the servos stay trimmed, but for what the plan adds.
    Flight k of a `seed` is always the same, whatever `jobs`, the threads; all processors if None.
    `keep_ended` returns flights that were terminated early too, marked by `ended`. `on_flight` is
    called after each.

    Raises InputError, TrimError if the vehicle can't hover in the wind, or DivergedError, which has
    the record, if a flight left its envelope or its controller failed.
    """
    numbers = range(at_least("count", count, 1))
    if controller != "own":
        vehicle = vehicle.with_controller(controller)
    records = []
    for record in fly_each(vehicle, plan, numbers, seed=seed, jobs=jobs, keep_ended=keep_ended):
        records.append(record)
        if on_flight is not None:
            on_flight()
    return records


def fly_each(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, FlightRecord], Any] = lambda _, record: record,
    *,
    seed: int = 0,
    jobs: int | None = None,
    keep_ended: bool = False,
) -> Iterator[Any]:
    """Fly the flights of these numbers as `fly` does; yield what `then` makes of each record."""
    plan = as_plan(plan).on(vehicle)
    recorder, of_plan = plan.recorder or Recorder.of(vehicle), plan.to_dict()
    added = None if plan.excitation is None else injection_digest(plan.excitation, vehicle)
    if added is not None:
        of_plan["sticks_digest"] = added

    def recorded(number: int, trajectory: Trajectory) -> Any:
        facts = {**of_plan, "plan_digest": plan.digest, "seed": seed, "flight": number}
        provenance = made_by("simulation", **vehicle.provenance, **facts)
        end = trajectory.end
        if trajectory.script is not None:
            provenance["reached"] = to_plain(Reached.of(vehicle, trajectory))
        if end is not None:
            provenance["ended"] = end.to_dict()
            if trajectory.time[-1] * recorder.rate_hz < _FEWEST_SAMPLES:
                raise end.error()
        record = recorder.record(trajectory, generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(plan.faults):
            if not isinstance(fault, ServoStuck):
                record = fault.apply(record, generator(seed, number, f"fault {n}"))
        if end is not None and not keep_ended:
            error = end.error()
            error.record = record
            raise error
        return then(number, record)

    return _simulated(vehicle, plan, numbers, recorded, seed=seed, jobs=jobs)


def fly_to(
    folder: str | PathLike[str],
    vehicle: Vehicle,
    plan: Flyable,
    *,
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> dict[Path, str]:
    """Fly a plan as `fly` does, write each record as its flight ends; return why each ended.

    The reason is "" for a flight as planned; others are kept as far as they went. Raises
    InputError, also where such a record exists, StorageError, or DivergedError if there is nothing
    to record.
    """
    plan = as_plan(plan).on(vehicle)
    numbers = range(at_least("count", count, 1))
    paths = [Path(folder) / f"{plan.name}_{k + 1:04d}.parquet" for k in numbers]
    if there := [path for path in paths if path.exists()]:
        raise InputError(f"{there[0]} is there already: choose another folder, or remove it")
    flights = fly_each(vehicle, plan, numbers, seed=seed, jobs=jobs, keep_ended=True)
    make_folder(Path(folder))
    ended = {}
    for path, record in zip(paths, flights):
        write_record(record, path)
        ended[path] = record.ended
        if on_flight is not None:
            on_flight()
    return ended
