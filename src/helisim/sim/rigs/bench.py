"""Hold the helicopter in a rig, do something to it, and record what its computer sees."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import InputError, UnknownNameError
from helisim.base.settings import check, setting
from helisim.physics import pilot
from helisim.physics.motion import flip
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import roll
from helisim.sim.limits import FlightEnvelope
from helisim.sim.recorder import Recorder, read_trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.assembly import assemble

_ENVELOPE = replace(FlightEnvelope.off(), tilt=FlightEnvelope().tilt, rate=FlightEnvelope().rate)
"""Of what is held: a gyro that can't turn its helicopter may well saturate, near the ground."""


@dataclass(frozen=True, kw_only=True)
class PedalSteps:
    """Steps of the pedal stick on the bench: for each size to one side, back, to the other, back.

    Attributes:
        sizes: unitised stick. Unequal, so that the resolution of the recorded servo averages
            out. The tail servo ramps while a step lasts, to 0.42 of its 0.5 in the largest.
        hold: s, of each step. Neither it nor `rest` is a whole number of the recorder's
            samples: the edges fall everywhere between two samples, and what they alias averages
            out.
        rest: s, before the first and after each.
    """

    sizes: tuple[float, ...] = setting((0.016, 0.015, 0.014, 0.013, 0.012), above=0.0, high=0.5)
    hold: float = setting(0.506, unit="s", above=0.0)
    rest: float = setting(1.012, unit="s", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        if not self.sizes:
            raise InputError("sizes must hold one step or more")

    @property
    def duration(self) -> float:
        """Length of the test, s."""
        return self.rest + 2 * len(self.sizes) * (self.hold + self.rest)

    def control(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pedal stick at times in s; (n_time,) each."""
        stick = np.zeros(time.size)
        sides = [side * size for size in self.sizes for side in (1.0, -1.0)]
        for number, step in enumerate(sides):
            since = time - self.rest - number * (self.hold + self.rest)
            stick[(since >= 0.0) & (since < self.hold)] = step
        return stick


@dataclass(frozen=True, kw_only=True)
class TableSweep:
    """A sweep of the turntable to and fro.

    Attributes:
        amplitude: rad, of the angle. The gyro locks the heading, so the tail servo follows the
            angle at low frequency and the rate at high: this takes it to four fifths of its
            range at the upper edge, a sixth at the lower.
        band: (w_min, w_max) rad/s. Up to where a lead's filter of some milliseconds is told
            from its delay: to 40 rad/s it is known to half of it only, to 120 to a thirtieth.
        duration: s, of the whole test.
        rest: s, still, before and again after.
    """

    amplitude: float = setting(0.015, unit="rad", above=0.0)
    band: tuple[float, float] = setting((2.0, 120.0), unit="rad/s", above=0.0)
    duration: float = setting(66.0, unit="s", above=0.0)
    rest: float = setting(3.0, unit="s", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        _check_sweep(self.band, self.duration, self.rest)

    def control(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the table's commanded rate, rad/s to the left, at times in s; (n_time,) each."""
        length = self.duration - 2.0 * self.rest
        angle = [pilot.sweep(t - self.rest, length, *self.band, 2.0, 0.0, 0) for t in time]
        return -(self.amplitude * np.gradient(np.array(angle), time))


@dataclass(frozen=True, kw_only=True)
class StickSweep:
    """A sweep of one stick on the bench.

    Attributes:
        amplitude: of the stick, unitised. The gyro makes several times it of the servo's command,
            which stays within its range and its speed.
        band: (w_min, w_max) rad/s: to near a servo's natural frequency.
        duration: s, of the whole test, a second of rest before and after.
    """

    amplitude: float = setting(0.018, above=0.0)
    band: tuple[float, float] = setting((8.0, 200.0), unit="rad/s", above=0.0)
    duration: float = setting(60.0, unit="s", above=0.0)

    def __post_init__(self) -> None:
        check(self)
        _check_sweep(self.band, self.duration, 1.0)

    def control(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the stick at times in s; (n_time,) each."""
        length = self.duration - 2.0
        sweep = [pilot.sweep(t - 1.0, length, *self.band, 1.0, 0.0, 0) for t in time]
        return self.amplitude * np.array(sweep)


def _check_sweep(band: tuple[float, float], duration: float, rest: float) -> None:
    if not band[0] < band[1]:
        raise InputError(f"band must be 0 < w_min < w_max in rad/s, got {band}")
    if duration <= 2.0 * rest:
        raise InputError(f"duration must leave time to sweep, got {duration} s")


def hold(vehicle: Vehicle, rig: str) -> Vehicle:
    """Return the vehicle in a rig, "bench", "turntable" or "suspension"; else raise an error."""
    timestep = float(vehicle.model.opt.timestep)
    model = assemble(vehicle.folder, vehicle.parameters, timestep=timestep, rig=rig)
    return replace(vehicle, model=model)


def step_pedals(
    held: Vehicle,
    steps: PedalSteps | None = None,
    *,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Step the pedals of a helicopter on the bench, rotor off, and return the record."""
    return _driven(held, "bench", "PED", steps or PedalSteps(), seed, recorder)


def turn(
    held: Vehicle,
    sweep: TableSweep | None = None,
    *,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Sweep the rate of a helicopter on the turntable, sticks centred, rotor off."""
    return _driven(held, "turntable", "drive", sweep or TableSweep(), seed, recorder)


def sweep_stick(
    held: Vehicle,
    sweep: StickSweep | None = None,
    stick: str = "PED",
    *,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Sweep one stick of a helicopter on the bench, rotor off, and return the record."""
    return _driven(held, "bench", stick, sweep or StickSweep(), seed, recorder)


def hang(
    held: Vehicle,
    point: str,
    *,
    duration: float = 40.0,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Hang a helicopter by one of `suspension_points`, to swing to rest for a duration, s.

    Raises:
        UnknownNameError: no such point.
    """
    points = suspension_points(held)
    if point not in points:
        raise UnknownNameError("suspension point", point, points)
    what = {"point": point, "duration": duration}
    return _record(held, point, _at_rest(held, duration), "suspension", what, seed, recorder)


def suspension_points(held: Vehicle) -> dict[str, NDArray[np.float64]]:
    """Return where the suspension can take hold, by name: (3,) m, airframe axes (FRD)."""
    welds = [held.model.equality(k) for k in range(held.model.neq)]
    return {weld.name: np.array(flip(*weld.data[:3])) for weld in welds}


def _driven(
    held: Vehicle,
    rig: str,
    actuator: str,
    test: PedalSteps | TableSweep | StickSweep,
    seed: int,
    recorder: Recorder | None,
) -> FlightRecord:
    """Return the record of a test in which one actuator follows a law of time."""
    control = _at_rest(held, test.duration)
    time = np.arange(len(control)) * held.model.opt.timestep
    control[:, held.model.actuator(actuator).id] = test.control(time)
    return _record(held, "mounted", control, rig, asdict(test), seed, recorder)


def _at_rest(held: Vehicle, duration: float) -> NDArray[np.float64]:
    """Return controls at zero, (n_step, n_control): sticks centred, rotor off."""
    return np.zeros((round(duration / held.model.opt.timestep) + 1, held.model.nu))


def _record(
    held: Vehicle,
    key: str,
    control: NDArray[np.float64],
    rig: str,
    what: dict[str, Any],
    seed: int,
    recorder: Recorder | None,
) -> FlightRecord:
    if not isinstance(seed, int) or seed < 0:
        raise InputError(f"seed must be an integer, 0 or more, got {seed!r}")
    recorder, model = recorder or Recorder.of(held), held.model
    data, physics = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    start = np.empty(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, data, start, physics)
    if key in (points := suspension_points(held)):
        model = held.model.__copy__()
        model.eq_active0[:] = [name == key for name in points]
    trajectory = read_trajectory(held, roll(model, start, len(control), control=control))
    _ENVELOPE.check(held, trajectory)
    provenance = made_by(
        "ground test",
        **held.provenance,
        rig=rig,
        test=what,
        recorder=recorder.to_dict(),
        seed=seed,
    )
    rng = np.random.default_rng([seed, *f"{rig} {key}".encode()])
    return recorder.record(trajectory, rng, provenance)
