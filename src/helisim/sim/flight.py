"""The flight loop: MuJoCo's steps with whoever commands them, and whole flights of a plan.

`steps` is the loop of every flight that somebody commands as it goes on: a mission's script, a
hand, an autopilot's frames, a viewer. `roll` is its fast path where all commands are known before:
a plan's flights, a bench. What ends a flight is in `limits`.
"""

import copy
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from helisim.base.errors import DivergedError, InputError, RecordError, StorageError
from helisim.base.files import make_folder
from helisim.base.settings import FrozenMap, to_plain
from helisim.physics.drive import MOTOR
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.records.record import FlightRecord, difference, made_by, plain
from helisim.records.storage import read_record, write_record
from helisim.sim.excitation import injection, injection_digest
from helisim.sim.faults import RecorderFault, write_faults
from helisim.sim.ground import Ground
from helisim.sim.missions.mission import Mission, Reached, ScriptedPilot
from helisim.sim.plan import FlightPlan, Flyable, as_plan
from helisim.sim.recorder import (
    End,
    Recorder,
    Trajectory,
    last_second,
    read_trajectory,
    sound_samples,
)
from helisim.sim.weather import Weather
from helisim.vehicle import ControllerLike, Vehicle
from helisim.vehicle.assembly import check_motor
from helisim.vehicle.trim import Trim, addresses, find_trim, place

Result = TypeVar("Result")
Command = tuple[int, Callable[[mujoco.MjData], object]]
"""Every how many steps it is asked, and what is: a function of the data, before the step. It moves
sticks, servos or parameters, and ends the flight where it returns True."""

_APART = 5.0  # m/s between the speeds at which a trim is looked for, each near the last
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

    The force laws must be installed while it is asked for the next. Behind a step the sensor data
    are of the time before it.

    Args:
        model: of the flight.
        data: of the flight, which moves.
        commands: that are asked before a step, in this order.
        added: (n_step, n_injection) `injection` of a manoeuvre, whose last row stays; None for
            none.
        first: number of steps that were made before: a copy of a flight goes on from there.
        count: of the steps, at most; None never ends.
        each: time steps that are one step here, as an autopilot's frame has several.
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

    Args:
        model: of the flight.
        start: (n_state,) full physics state.
        count: of the steps.
        added: (n_step, n_injection) of a manoeuvre; None for none.
        control: (n_step, n_control) where no force law writes controls; None for none.
        state: (1, n_step, n_state) memory for the states, which are not read.
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
    """Yield what truly happens in each flight of a plan; arguments and errors as for `fly`.

    Only as many flights as threads are in memory at a time. `Trajectory.end` says why a flight
    that is kept was terminated early.
    """
    numbers = flight_numbers(count)
    trajectories = simulated(vehicle, plan, numbers, lambda _, one: one, seed=seed, jobs=jobs)

    def kept(trajectory: Trajectory) -> Trajectory:
        if trajectory.end is not None and not keep_ended:
            raise trajectory.end.error(scripted=trajectory.script is not None)
        return trajectory

    return (kept(one) for one in trajectories)


def flight_numbers(count: int) -> range:
    """Return the numbers of so many flights. Raises InputError."""
    return range(_at_least("count", count, 1))


def thread_count(jobs: int | None, name: str = "jobs") -> int:
    """Return how many threads are asked for: all processors if None. Raises InputError."""
    return _at_least(name, (os.cpu_count() or 1) if jobs is None else jobs, 1)


def _at_least(name: str, number: int, least: int) -> int:
    if not isinstance(number, int) or number < least:
        raise InputError(f"{name} must be an integer of {least} or more, got {number!r:.60}")
    return number


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
    _at_least("seed", seed, 0)
    plan = as_plan(plan)
    vehicle, grounded = _placed(_powered(vehicle, plan), plan)
    excitation = None if plan.excitation is None else plan.excitation.on(vehicle.parameters)
    added = None if excitation is None else injection(excitation, vehicle)
    places = () if excitation is None else excitation.places
    trim = start_trim(vehicle, plan.mission)
    # new memory for each flight would cost a fifth of the time: the threads wait for its pages
    size = mujoco.mj_stateSize(grounded, _PHYSICS)
    rows = _step_count(plan, grounded) if plan.mission is None else 0
    buffers = [np.empty((1, rows, size)) for _ in range(min(threads, len(numbers)))]

    def flown(number: int, buffer: NDArray[np.float64]) -> Result:
        model = prepare(vehicle, plan, seed=seed, number=number, model=grounded)
        start = start_state(vehicle, plan, grounded, trim, seed=seed, number=number)
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

    The model is `prepare`d for it; start, (n_state,), is its full physics state, added the
    (n_step, n_injection) of the excitation, and state (1, n_step, n_state) memory as for `roll`.

    Raises:
        DivergedError: not one sample is within the envelope.
    """
    count, pilot, who = _step_count(plan, model), None, f"controller {vehicle.controller.name!r}"

    def begun() -> tuple[mujoco.MjData, ScriptedPilot | None, tuple[Command, ...]]:
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, start, _PHYSICS)
        if plan.mission is None:
            return data, None, ()
        pilot = ScriptedPilot(plan.mission, vehicle, model, data, trim, plan.ground)
        return data, pilot, pilot.commands

    with vehicle.controller.flying(model) as flying:
        if plan.mission is None:
            sensordata = roll(model, start, count, added=added, state=state)
        else:
            data, pilot, commands = begun()
            sensordata, made = np.empty((count, model.nsensordata)), 0
            with installed():
                for made in steps(model, data, *commands, added=added, count=count):
                    sensordata[made - 1] = data.sensordata
            sensordata = sensordata[:made]
        failure = flying.failure()
    if failure is None and plan.mission is not None and pilot and pilot.failure:
        failure, who = pilot.failure, f"mission {plan.mission.name!r}"
    sound, why = sound_samples(model, sensordata)
    traceback = None if failure is None else failure.traceback
    why = why if failure is None else f"{who} {failure.why}"
    if sound == 0:
        raise DivergedError(why) if failure is None else End(0.0, why, start, traceback).error()
    flight = read_trajectory(vehicle, sensordata[:sound])
    flight = replace(flight, ground=plan.ground, script=None if pilot is None else pilot.script)
    found = plan.envelope.end(vehicle, flight)
    if found is None and failure is None and sound == len(sensordata):
        return flight
    at, kept = sound * model.opt.timestep, sound
    if found is not None:
        kept, why = found
        at, traceback = float(flight.time[kept]), None
    if kept == 0:
        raise End(at, why, start).error()
    last = start
    with vehicle.controller.flying(model), installed():  # again, for the state and the warnings
        data, _, commands = begun()
        for made in steps(model, data, *commands, added=added, count=kept):
            last = _state(model, data) if made == kept - 1 else last
    kinds = {int(one): name for name, one in mujoco.mjtWarning.__members__.items()}
    warned = [kinds[k].removeprefix("mjWARN_") for k, w in enumerate(data.warning) if w.number]
    if found is None and failure is None and warned:
        why = f"MuJoCo warned of {', '.join(warned)}"
    return flight.until(kept, End(at, why, last, traceback))


def _step_count(plan: FlightPlan, model: mujoco.MjModel) -> int:
    return round(plan.duration / model.opt.timestep) + 1


def _state(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """Return the full physics state, (n_state,)."""
    state = np.empty(mujoco.mj_stateSize(model, _PHYSICS))
    mujoco.mj_getState(model, data, state, _PHYSICS)
    return state


def _powered(vehicle: Vehicle, plan: FlightPlan) -> Vehicle:
    """Return a vehicle whose rotor a motor turns, where a mission needs one. Raises ModelError."""
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
    if plan.ground is None:
        vehicle = plan.weather.trimmed(vehicle)
        return vehicle, vehicle.model
    vehicle = plan.weather.trimmed(plan.ground.felt_by(vehicle))
    return vehicle, vehicle.grounded_model(plan.ground.put_into)


def prepare(
    vehicle: Vehicle,
    plan: Flyable,
    *,
    seed: int,
    number: int,
    model: mujoco.MjModel | None = None,
) -> mujoco.MjModel:
    """Return a copy of a trimmed vehicle's model that flies one flight of a plan.

    What no compiled formula adds comes in `mjData.userdata`: before each step, the row of the
    excitation's `injection`. A `model` of the same vehicle on a ground may be copied instead.
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
    """Return the steady flight in which a mission, or a hover, begins. Raises TrimError."""
    trim, speed = vehicle.trim, 0.0 if mission is None else mission.start.speed
    for k in range(math.ceil(speed / _APART)):
        trim = find_trim(
            vehicle.model, speed=min(speed, (k + 1) * _APART), height=trim.height, near=trim
        )
    return trim


def start_state(
    vehicle: Vehicle,
    plan: FlightPlan,
    model: mujoco.MjModel,
    trim: Trim | None = None,
    *,
    seed: int,
    number: int,
) -> NDArray[np.float64]:
    """Return the full physics state in which a flight starts, (n_state,); see `begin`."""
    data, mission = mujoco.MjData(model), plan.mission
    height = None if mission is None else mission.start.height
    begin(vehicle, model, data, plan.weather, plan.ground, trim, height, seed, number)
    return _state(model, data)


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
    """Put a vehicle where a flight begins: in its trim or parked, in air as rough as ever.

    The trim is the vehicle's if None; the height of its origin above the ground, m, the weather's.
    """
    place(model, data, trim or vehicle.trim, height=weather.height if height is None else height)
    if ground is not None:
        ground.begin(vehicle, model, data)
    first = addresses(model).state + STATE.air_u
    rough = weather.start(vehicle, generator(seed, number, "first air"))
    data.act[first : first + rough.size] = rough


def generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    """Return the random numbers of one purpose in one flight of a seed."""
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])


LAST_SECONDS = "last_second"
"""Folder beside records, of the last seconds of those flights that were terminated early."""
_FEWEST_SAMPLES = 2
"""Beside the first, of the shortest record; the lever arm's derivative needs them."""


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight as it was recorded.

    Attributes:
        record: of the flight computer, as far as the flight went.
        last_second: at the simulation's rate, of a flight that was terminated early; else None.
    """

    record: FlightRecord
    last_second: FlightRecord | None


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
    """Fly a plan a number of times and record each flight.

    The result depends on the vehicle, the plan, the number and the seed, not on `jobs`. All
    records are in memory at the end; `fly_each` gives them one by one.

    Args:
        vehicle: that flies.
        plan: of the flights; a bare manoeuvre or mission, or a function of time in s that gives
            what is added to the four sticks, is a plan with all else default.
        controller: that flies in place of the vehicle's own: a law of (seen, state, settings), a
            `Controller`, a law as data such as `read_law` gives, or None: then the servos stay
            where they are trimmed, but for what the plan adds to their commands.
        count: number of flights.
        seed: of pilots, turbulence and sensors; flight k of a seed is always the same.
        jobs: threads; all processors if None.
        keep_ended: True returns flights that were terminated early as far as they went, marked:
            `FlightRecord.ended` says why, and the identification refuses them.
        on_flight: called after each flight, for progress.

    Returns:
        One record a flight.

    Raises:
        InputError: count, seed or jobs is out of range, or the plan can't be flown.
        TrimError: the vehicle can't hover in the wind.
        DivergedError: a flight left its envelope, or its controller failed, and such aren't to be
            kept; the error has its record, its last second and the controller's traceback.
    """
    numbers = flight_numbers(count)
    if not isinstance(controller, str):
        vehicle = vehicle.with_controller(controller)
    elif controller != "own":
        raise InputError(
            f"controller must be a law, a Controller, None or 'own', got {controller!r}"
        )
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
    *,
    seed: int = 0,
    jobs: int | None = None,
    keep_ended: bool = False,
) -> Iterator[FlightRecord]:
    """Fly the flights of these numbers and yield each record; the rest is as for `fly`.

    Flight k is the same whatever the other numbers, their order and `jobs`. Only as many
    flights as threads are in memory at a time.
    """

    def record(flight: Flight) -> FlightRecord:
        if flight.last_second is not None and not keep_ended:
            said = flight.record.provenance
            error = End(**{"traceback": None, **said["ended"]}).error(scripted="mission" in said)
            error.record, error.last_second = flight.record, flight.last_second
            raise error
        return flight.record

    return (record(one) for one in fly_all(vehicle, plan, numbers, seed=seed, jobs=jobs))


def fly_all(
    vehicle: Vehicle,
    plan: Flyable,
    numbers: Sequence[int],
    then: Callable[[int, Flight], Any] = lambda _, flight: flight,
    *,
    seed: int = 0,
    jobs: int | None = None,
) -> Iterator[Any]:
    """Yield each flight, those that were terminated early too, with their last second.

    What is yielded is what `then` makes of number and flight, in the thread that flew it. The
    other arguments and errors are those of `fly_each`.

    Raises:
        DivergedError: a flight was terminated before there was a record of it.
    """
    plan = as_plan(plan).on(vehicle)
    recorder = plan.recorder or Recorder.of(vehicle)

    def recorded(number: int, trajectory: Trajectory) -> Any:
        provenance = flight_provenance(vehicle, plan, seed=seed, number=number)
        end, last = trajectory.end, None
        if trajectory.script is not None:
            provenance["reached"] = to_plain(Reached.of(vehicle, trajectory))
        if end is not None:
            provenance["ended"] = end.to_dict()
            if trajectory.time[-1] * recorder.rate_hz < _FEWEST_SAMPLES:
                raise end.error(scripted=trajectory.script is not None)
            last = last_second(trajectory, provenance)
        record = recorder.record(trajectory, generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(plan.faults):
            if isinstance(fault, RecorderFault):
                record = fault.apply(record, generator(seed, number, f"fault {n}"))
        return then(number, Flight(record, last))

    return simulated(vehicle, plan, numbers, recorded, seed=seed, jobs=jobs)


def flight_provenance(vehicle: Vehicle, plan: Flyable, *, seed: int, number: int) -> dict[str, Any]:
    """Return what a record says of its origin: enough to fly it again."""
    plan = as_plan(plan).on(vehicle)
    facts = plan.to_dict()
    facts["weather"]["dryden"] = to_plain(plan.weather.dryden)
    added = None if plan.excitation is None else injection_digest(plan.excitation, vehicle)
    if added is not None:
        facts["sticks_digest"] = added
    facts |= {"plan_digest": plan.digest, "seed": seed, "flight": number}
    return made_by("simulation", **vehicle.provenance, **facts)


@dataclass(frozen=True)
class Flown:
    """What a folder holds after its flights.

    Attributes:
        paths: one record a flight, in order.
        found: how many of them were there before, and were left as they are.
        ended: why those were terminated early that were; a folder `last_second` holds that of
            each, at the simulation's rate.
    """

    paths: tuple[Path, ...]
    found: int
    ended: Mapping[Path, str]


def fly_to(
    folder: Path,
    vehicle: Vehicle,
    plan: Flyable,
    *,
    count: int = 1,
    seed: int = 0,
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> Flown:
    """Fly a plan as `fly` does and write each record as its flight ends.

    Flights that the folder already holds, whole and of the same provenance, aren't flown
    again; so a second call goes on where an interrupted one stopped. A damaged file is
    written anew. A flight that is terminated early is kept as far as it went, marked, and the
    others go on. Memory doesn't grow with `count`.

    Args:
        folder: of records such as `lat_0001.parquet`; made if it doesn't exist.
        vehicle: that flies.
        plan: of the flights; a bare manoeuvre, or a function of time in s that gives what is
            added to the four sticks, is a plan with all else default.
        count: number of flights that the folder shall hold.
        seed: of pilots, turbulence and sensors.
        jobs: threads; all processors if None.
        on_flight: called once for each flight that the folder holds, for progress.

    Raises:
        InputError: as for `fly`; or the folder holds a flight of another configuration.
        DivergedError: a flight is terminated before there is a record of it; those before it
            are kept.
        StorageError: the folder can't be made or written.
    """
    plan = as_plan(plan).on(vehicle)
    paths = [folder / f"{plan.name}_{k + 1:04d}.parquet" for k in flight_numbers(count)]
    ended: dict[Path, str] = {}
    missing = []

    def kept(path: Path, record: FlightRecord) -> None:
        if record.ended:
            ended[path] = record.ended
        if on_flight is not None:
            on_flight()

    for number, path in enumerate(paths):
        expected = flight_provenance(vehicle, plan, seed=seed, number=number)
        found = _found(path, plain(expected))
        if found is None:
            missing.append(number)
        else:
            kept(path, found)
    flights = fly_all(vehicle, plan, missing, seed=seed, jobs=jobs)
    make_folder(folder)
    for number, flight in zip(missing, flights):
        write_flight(flight, paths[number])
        kept(paths[number], flight.record)
    return Flown(tuple(paths), count - len(missing), FrozenMap(dict(sorted(ended.items()))))


def write_flight(flight: Flight, path: Path) -> Path | None:
    """Write a flight, and its last second, if there is one, into a folder beside it.

    Returns the path of the last second. Raises StorageError.
    """
    beside = None
    if flight.last_second is not None:  # first: a record that says that it ended has it
        beside = make_folder(path.parent / LAST_SECONDS) / f"{path.stem}.parquet"
        write_record(flight.last_second, beside)
    write_record(flight.record, path)
    return beside


def _found(path: Path, expected: Mapping[str, Any]) -> FlightRecord | None:
    """Return the flight that a file holds; None where it is missing or damaged."""
    if not path.exists():
        return None
    try:
        found = read_record(path)
    except (StorageError, RecordError):
        return None
    origin = {k: v for k, v in found.provenance.items() if k not in ("ended", "reached")}
    change = difference(origin, expected)
    if "excitation" in origin and "plan_digest" not in origin:
        change = "an earlier version of helisim flew it, and stated no plan_digest"
    if change:
        raise InputError(
            f"{path} holds a flight of another configuration: {change}; "
            "choose another folder, or remove the file"
        )
    return found
