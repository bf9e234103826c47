"""The flight loop: MuJoCo's steps with whoever commands them, and whole flights of a plan.

`steps` is the loop of every flight that somebody commands as it goes on: a mission's script, a
hand, an autopilot's frames, a viewer. `roll` is its fast path where all commands are known before:
a plan's flights, a bench. What ends a flight is in `limits`.
"""

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

from helisim.base.errors import DivergedError, InputError
from helisim.physics.drive import MOTOR
from helisim.physics.layout import PARAM, STATE
from helisim.physics.native import installed
from helisim.sim.excitation import injection
from helisim.sim.faults import write_faults
from helisim.sim.ground import Ground
from helisim.sim.missions.mission import Mission, ScriptedPilot
from helisim.sim.plan import FlightPlan, Flyable, as_plan
from helisim.sim.trajectory import End, Trajectory, read_trajectory, sound_samples
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.force_laws import check_motor
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import Trim, find_trim, place

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
