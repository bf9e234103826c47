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
from helisim.physics.layout import STATE
from helisim.physics.native import installed
from helisim.provenance import made_by
from helisim.record import FlightRecord
from helisim.sim.excitation import Excitation
from helisim.sim.fault_notation import Fault, check_faults, to_dict
from helisim.sim.faults import FlightFault, write_faults
from helisim.sim.instruments import Recorder
from helisim.sim.pilot import Pilot
from helisim.sim.recorder_faults import RecorderFault
from helisim.sim.truth import Truth, read_truth
from helisim.sim.weather import Weather
from helisim.vehicle import Vehicle
from helisim.vehicle.motion import addresses
from helisim.vehicle.trim import place


def fly(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    jobs: int | None = None,
    on_flight: Callable[[], None] | None = None,
) -> list[FlightRecord]:
    """Fly the same manoeuvre a number of times and record each flight.

    The result depends on the vehicle, the arguments and the seed, not on `jobs`. All records
    are in memory at the end; `fly_each` gives them one by one.

    Args:
        vehicle: that flies.
        excitation: sweep or doublet.
        count: number of flights.
        seed: of pilots and sensors; flight k of a seed is always the same.
        pilot: the default `Pilot` if None.
        recorder: the vehicle's own if None.
        weather: calm if None; each flight has its own turbulence.
        faults: of servos, gyro and recorder, in each flight; a recorder's, in this order.
        jobs: threads; all processors if None.
        on_flight: called after each flight, for progress.

    Returns:
        One record a flight.

    Raises:
        InputError: count, seed or jobs is out of range, or a fault can't be in this flight.
        TrimError: the vehicle can't hover in the wind.
        DivergedError: a flight left the validity of the model.
    """
    records = []
    for record in fly_each(
        vehicle,
        excitation,
        flight_numbers(count),
        seed=seed,
        pilot=pilot,
        recorder=recorder,
        weather=weather,
        faults=faults,
        jobs=jobs,
    ):
        records.append(record)
        if on_flight is not None:
            on_flight()
    return records


def fly_each(
    vehicle: Vehicle,
    excitation: Excitation,
    numbers: Sequence[int],
    *,
    seed: int = 0,
    pilot: Pilot | None = None,
    recorder: Recorder | None = None,
    weather: Weather | None = None,
    faults: Sequence[Fault] = (),
    jobs: int | None = None,
) -> Iterator[FlightRecord]:
    """Fly the flights of these numbers and yield each record; the rest is as for `fly`.

    Flight k is the same whatever the other numbers, their order and `jobs`. Only as many
    flights as threads are in memory at a time.
    """
    pilot, recorder = pilot or Pilot(), recorder or Recorder.of(vehicle)
    weather = weather or Weather()
    truths = _simulated(
        vehicle,
        excitation,
        numbers,
        seed=seed,
        pilot=pilot,
        weather=weather,
        faults=check_faults(faults, excitation.duration),
        jobs=jobs,
    )

    def recorded(number: int, truth: Truth) -> FlightRecord:
        provenance = flight_provenance(
            vehicle,
            excitation,
            number,
            seed=seed,
            pilot=pilot,
            recorder=recorder,
            weather=weather,
            faults=faults,
        )
        record = recorder.record(truth, _generator(seed, number, "sensors"), provenance)
        for n, fault in enumerate(faults):
            if isinstance(fault, RecorderFault):
                record = fault.spoil(record, _generator(seed, number, f"fault {n}"))
        return record

    return (recorded(number, truth) for number, truth in zip(numbers, truths))


def simulate(
    vehicle: Vehicle,
    excitation: Excitation,
    *,
    count: int = 1,
    seed: int = 0,
    pilot: Pilot | None = None,
    weather: Weather | None = None,
    faults: Sequence[FlightFault] = (),
    jobs: int | None = None,
) -> Iterator[Truth]:
    """Yield what truly happens in each flight; arguments and errors as for `fly`.

    Only as many flights as threads are in memory at a time.
    """
    numbers = flight_numbers(count)
    pilot, weather = pilot or Pilot(), weather or Weather()
    return _simulated(
        vehicle,
        excitation,
        numbers,
        seed=seed,
        pilot=pilot,
        weather=weather,
        faults=faults,
        jobs=jobs,
    )


def flight_numbers(count: int) -> range:
    """Return the numbers of so many flights. Raises InputError."""
    if not isinstance(count, int) or count < 1:
        raise InputError(f"count must be an integer of 1 or more, got {count}")
    return range(count)


def _simulated(
    vehicle: Vehicle,
    excitation: Excitation,
    numbers: Sequence[int],
    *,
    seed: int,
    pilot: Pilot,
    weather: Weather,
    faults: Sequence[FlightFault],
    jobs: int | None,
) -> Iterator[Truth]:
    threads = (os.cpu_count() or 1) if jobs is None else jobs
    for name, number, least in (("jobs", threads, 1), ("seed", seed, 0)):
        if not isinstance(number, int) or number < least:
            raise InputError(f"{name} must be an integer of {least} or more, got {number}")
    vehicle = weather.trimmed(vehicle)
    batches = (numbers[k : k + threads] for k in range(0, len(numbers), threads))
    return (
        read_truth(vehicle, sensordata)
        for batch in batches
        for sensordata in _run(
            [
                prepare(vehicle, excitation, pilot, weather, faults, seed=seed, number=k)
                for k in batch
            ],
            [_start(vehicle, weather, seed=seed, number=k) for k in batch],
            excitation.duration,
        )
    )


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
        int(_generator(seed, number, purpose).integers(2**31)) for purpose in ("pilot", "air")
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
    rough = weather.start(vehicle, _generator(seed, number, "first air"))
    data.act[first + STATE.air_u : first + len(STATE)] = rough
    state = np.empty(mujoco.mj_stateSize(vehicle.model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(vehicle.model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


def _generator(seed: int, number: int, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, number, int.from_bytes(purpose.encode())])


def flight_provenance(
    vehicle: Vehicle,
    excitation: Excitation,
    number: int,
    *,
    seed: int,
    pilot: Pilot,
    recorder: Recorder,
    weather: Weather,
    faults: Sequence[Fault] = (),
) -> dict[str, Any]:
    """Return what a record says of its origin: enough to fly it again."""
    excitation = excitation.on(vehicle.parameters)
    plain = {key: getattr(excitation, key) for key in excitation.__dataclass_fields__}
    return made_by(
        "simulation",
        **vehicle.provenance,
        excitation={"kind": type(excitation).__name__, **plain},
        pilot={key: getattr(pilot, key) for key in pilot.__dataclass_fields__},
        recorder=recorder.as_dict(),
        weather=weather.as_dict(),
        faults=[to_dict(fault) for fault in faults],
        seed=seed,
        flight=number,
    )
