"""Ground tests: the helicopter held by a rig, its rotor off (Wu and Chen, sections 2 and 3.1).

`loop_gains` and `plumb_line` take logs of real ground tests as well.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from helisim.base.errors import InputError, RecordError, check_known, named
from helisim.base.linear import delay_fit
from helisim.base.settings import is_number, to_plain
from helisim.physics import pilot
from helisim.physics.gyro import held_lag
from helisim.physics.motion import flip
from helisim.records.record import FlightRecord, made_by
from helisim.sim.flight import at_least, roll
from helisim.sim.limits import FlightEnvelope
from helisim.sim.recorder import Recorder, read_trajectory
from helisim.vehicle import Vehicle
from helisim.vehicle.assembly import assemble

_Complex = NDArray[np.complex128]

_ENVELOPE = replace(FlightEnvelope.off(), tilt=FlightEnvelope().tilt, rate=FlightEnvelope().rate)
_STEPS = (0.016, 0.015, 0.014, 0.013, 0.012)  # of the pedals, unitised
_HELD, _APART = 0.506, 1.012  # s: no whole number of samples, against aliasing
SWEPT = 60.0  # s, of a test that sweeps a stick
# _TABLE_AMPLITUDE: rad
# _TABLE_BAND: rad/s
_TABLE_AMPLITUDE, _TABLE_BAND = 0.015, (2.0, 120.0)
# _TURNED: s, of the turntable's test
# _STEP_BAND: rad/s; above, servos and sticks alias
_TURNED, _STEP_BAND = 66.0, (2.0, 60.0)
_SERVO_RANGE = 0.5  # unitised: the gyro commands the tail servo no further
_LONGEST_DELAY = 0.1  # s, searched on both sides: beyond any gyro's latency and any recorder's
_TYPICAL = (0.01, 0.01, 0.003)  # s: the scales of delay, lead and its filter in the search
_HANGING, _REST = 40.0, 10.0  # s of a hanging, and at its end, in which the attitude is averaged
_BLOCK = 0.25  # s: a quarter of the pendulum's period, so that a swing shows between the means
_STANDARD_ERROR = 1e-3  # rad, of the mean attitude at most
_DRIFT = 4e-3  # rad between the halves of the rest: two standard errors of each, added


def pedal_steps(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return pedal steps, (n_time,), at times in s: each to one side, back, to the other, back."""
    stick = np.zeros(time.size)
    for number, step in enumerate([side * size for size in _STEPS for side in (1.0, -1.0)]):
        since = time - _APART - number * (_HELD + _APART)
        stick[(since >= 0.0) & (since < _HELD)] = step
    return stick


def stick_sweep(time: NDArray[np.float64], amplitude: float = 0.018) -> NDArray[np.float64]:
    """Return a stick's sweep, unitised, (n_time,), at `SWEPT` s with a second of rest about it."""
    sweep = [pilot.sweep(t - 1.0, SWEPT - 2.0, 8.0, 200.0, 1.0, 0.0, 0) for t in time]
    return amplitude * np.array(sweep)


def table_sweep(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turntable's commanded rate, rad/s to the left, at times in s; (n_time,) each."""
    length = _TURNED - 2.0 * 3.0  # s, of rest before and after
    angle = [pilot.sweep(t - 3.0, length, *_TABLE_BAND, 2.0, 0.0, 0) for t in time]
    return -(_TABLE_AMPLITUDE * np.gradient(np.array(angle), time))


def hold(vehicle: Vehicle, rig: str) -> Vehicle:
    """Return the vehicle in a rig: "bench", "turntable" or "suspension"."""
    return replace(
        vehicle,
        model=assemble(
            vehicle.folder, vehicle.parameters, timestep=float(vehicle.model.opt.timestep), rig=rig
        ),
    )


def drive(
    held: Vehicle,
    actuator: str,
    test: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    *,
    duration: float,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Return the record of a stick, or the turntable's "drive", that moves as a test, rotor off.

    The test returns what is commanded, (n_time,), at times in s; the duration is in s.
    """
    rig = "turntable" if actuator == "drive" else "bench"
    return _record(
        held, "mounted", rig, {"moves": actuator, "duration": duration}, seed, recorder, test
    )


def hang(
    held: Vehicle,
    point: str,
    *,
    duration: float = _HANGING,
    seed: int = 0,
    recorder: Recorder | None = None,
) -> FlightRecord:
    """Hang a helicopter by one of `suspension_points` for some s. Raises UnknownNameError."""
    check_known("suspension point", [point], suspension_points(held))
    return _record(
        held, point, "suspension", {"point": point, "duration": duration}, seed, recorder
    )


def suspension_points(held: Vehicle) -> dict[str, NDArray[np.float64]]:
    """Return where the suspension can take hold, by name: (3,) m, airframe axes (FRD)."""
    welds = [held.model.equality(k) for k in range(held.model.neq)]
    return {weld.name: np.array(flip(*weld.data[:3])) for weld in welds}


def _record(
    held: Vehicle,
    key: str,
    rig: str,
    what: dict[str, Any],
    seed: int,
    recorder: Recorder | None,
    test: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> FlightRecord:
    at_least("seed", seed, 0)
    recorder, model = recorder or Recorder.of(held), held.model
    time = np.arange(round(what["duration"] / model.opt.timestep) + 1) * model.opt.timestep
    control = np.zeros((time.size, model.nu))
    if test is not None:
        control[:, model.actuator(what["moves"]).id] = test(time)
    data, physics = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    start = np.empty(mujoco.mj_stateSize(model, physics))
    mujoco.mj_getState(model, data, start, physics)
    if key in (points := suspension_points(held)):
        model = held.model.__copy__()
        model.eq_active0[:] = [name == key for name in points]
    trajectory = read_trajectory(held, roll(model, start, len(control), control=control))
    _ENVELOPE.check(held, trajectory)
    said = {"rig": rig, "test": what, "recorder": recorder.to_dict(), "seed": seed}
    rng = np.random.default_rng([seed, *f"{rig} {key}".encode()])
    return recorder.record(trajectory, rng, made_by("ground test", **held.provenance, **said))


@dataclass(frozen=True)
class LoopGains:
    """output = (proportional + integral/s) (1 + lead s/(1 + filter s)) e^(-delay s) input.

    The delay, s, is from the input's record to the output's, negative where the input's is late;
    lead in s; standard `errors` are for white noise, without the resolution of a recorded servo.
    """

    proportional: float
    integral: float
    delay: float
    lead: float
    lead_filter: float
    errors: Mapping[str, float]

    @property
    def ratio(self) -> float:
        """Integral over proportional, 1/s: free of every gain outside the controller."""
        return self.integral / self.proportional


def loop_gains(
    record: FlightRecord,
    *,
    input: str,
    output: str,
    band: tuple[float, float],
    noisy_input: bool = False,
    lead: bool = False,
) -> LoopGains:
    """Identify a proportional-integral loop from a record that starts and ends at rest.

    Least squares on Fourier transforms of recorded differences in a band, rad/s; the residual is
    taken in the output, or a noisy input. Raises InputError, or RecordError: a channel is still.
    """
    step = record.sample_time
    frequency = 2.0 * np.pi * np.fft.rfftfreq(len(record) - 1, step)
    used = (frequency >= band[0]) & (frequency <= band[1]) & (frequency > 0.0)
    if np.count_nonzero(used) < 8 or band[1] > np.pi / step:
        raise InputError(
            f"a record of {record.duration:.3g} s at {step:.3g} s resolves less than 8 "
            f"frequencies in {band} rad/s"
        )
    omega: NDArray[np.float64] = np.asarray(frequency[used], dtype=np.float64)

    def spectrum(name: str) -> _Complex:
        if np.ptp(record[name]) == 0.0:
            raise RecordError(f"channel {name!r} does not move in this record")
        return np.fft.rfft(np.diff(record[name]))[used] / (1.0 - np.exp(-1j * omega * step))

    drives, driven = spectrum(input), spectrum(output)
    start = _start(drives, driven, omega)
    count = 5 if lead else 3
    scale = np.array([start[0], start[1], *_TYPICAL])[:count]

    def all_five(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.pad(unknown * scale, (0, 5 - count))

    def residual(unknown: NDArray[np.float64]) -> NDArray[np.float64]:
        response = _response(all_five(unknown), omega)
        gap = drives - driven / response if noisy_input else driven - response * drives
        return np.concatenate([gap.real, gap.imag])

    first = np.array([1.0, 1.0, start[2] / scale[2], 1.0, 1.0])[:count]
    best = least_squares(
        residual,
        first,
        # a lead below zero has the gain of one above it: a second, false minimum
        bounds=([-np.inf, -np.inf, -np.inf, 0.0, 0.0][:count], np.inf),
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    variance = 2.0 * best.cost / (best.fun.size - count)
    jacobian = np.asarray(best.jac)
    spread = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)) * variance)
    errors = dict(zip(LoopGains.__dataclass_fields__, np.abs(all_five(spread)).tolist()))
    return LoopGains(*all_five(best.x).tolist(), errors=errors)


def _response(x: NDArray[np.float64], omega: NDArray[np.float64]) -> _Complex:
    s = 1j * omega
    proportional, integral, delay, lead, lead_filter = x
    led = 1.0 + lead * s / (1.0 + lead_filter * s)
    return (proportional + integral / s) * led * np.exp(-s * delay)


def _start(drives: _Complex, driven: _Complex, omega: NDArray[np.float64]) -> tuple[float, ...]:
    """Return proportional and integral gain and delay, s: linear least squares at each delay."""
    delays = np.linspace(-_LONGEST_DELAY, _LONGEST_DELAY, 81).tolist()
    return delay_fit(drives, driven, omega, delays, lambda one: (one, one / (1j * omega)))


@dataclass(frozen=True, eq=False)
class PlumbLine:
    """The vertical through a suspension point (3,) m: a unit vector (3,), airframe axes (FRD).

    `error`, rad, is the standard error of its direction, each way across.
    """

    point: NDArray[np.float64]
    down: NDArray[np.float64]
    error: float = 0.0


def plumb_line(record: FlightRecord, point: Sequence[float] | NDArray[np.float64]) -> PlumbLine:
    """Return the plumb line of a helicopter that hangs by a point, (3,) m, FRD.

    It is found from the mean attitude in the last 10 s of the record. Raises InputError, or
    RecordError if the helicopter still moves.
    """
    if np.shape(point) != (3,) or not all(is_number(one) and np.isfinite(one) for one in point):
        raise InputError(f"point must be three finite numbers, got {point!r:.60}")
    at_rest = record.slice(record.time[-1] - _REST, record.time[-1])
    angles = at_rest.select(("phi", "theta"))
    blocks = np.array_split(angles, max(4, round(at_rest.duration / _BLOCK)))
    means = np.array([block.mean(axis=0) for block in blocks])
    half = len(means) // 2
    drift = np.abs(means[:half].mean(axis=0) - means[half:].mean(axis=0))
    spread = means.std(axis=0, ddof=1) / np.sqrt(len(means))
    if np.any(spread > _STANDARD_ERROR) or np.any(drift > _DRIFT):
        raise RecordError(
            f"the helicopter still moves: in the last {_REST:g} s the standard error of phi and "
            f"theta is {spread[0]:.2g} and {spread[1]:.2g} rad (allowed {_STANDARD_ERROR:g}), "
            f"their drift {drift[0]:.2g} and {drift[1]:.2g} rad (allowed {_DRIFT:g}); record "
            "for longer"
        )
    phi, theta = angles.mean(axis=0)
    down = [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    return PlumbLine(np.array(point), np.array(down), float(np.max(spread)))


def centre_of_gravity(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    """Return the point nearest to all plumb lines, (3,) m, FRD. Raises InputError: parallel."""
    across = [np.eye(3) - np.outer(line.down, line.down) for line in lines]
    total = np.sum(across, axis=0)
    if len(lines) < 2 or np.linalg.cond(total) > 1e4:
        raise InputError(
            f"two plumb lines or more that aren't parallel meet in a point, got {len(lines)}; hang "
            "the helicopter from another point"
        )
    return np.linalg.solve(
        total, np.sum([a @ line.point for a, line in zip(across, lines)], axis=0)
    )


def _shifts(lines: Sequence[PlumbLine]) -> NDArray[np.float64]:
    centre = centre_of_gravity(lines)
    shifts = np.empty((len(lines), 2, 3))
    for number, line in enumerate(lines):
        for k, direction in enumerate(np.linalg.svd(line.down[None, :])[2][1:]):
            tilted, moved = line.down + 1e-6 * direction, list(lines)
            moved[number] = PlumbLine(line.point, tilted / np.linalg.norm(tilted))
            shifts[number, k] = (centre_of_gravity(moved) - centre) / 1e-6
    return shifts


@dataclass(frozen=True)
class Finding:
    """One number that a ground test found, SI, and in one line how.

    `truth` and `standard_error`, of `value`, are None where there is none.
    """

    name: str
    unit: str
    value: float
    truth: float | None = None
    standard_error: float | None = None
    how: str = ""

    @property
    def error(self) -> float | None:
        """Value minus truth, in the unit."""
        return None if self.truth is None else self.value - self.truth

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {**to_plain(self), "error": self.error}


@dataclass(frozen=True, kw_only=True)
class RigTest:
    """The findings of the test in one rig, in their order."""

    rig: str
    findings: tuple[Finding, ...]

    def __getitem__(self, name: str) -> Finding:
        """Return the finding of that name. Raises UnknownNameError."""
        return named(self.findings, name, f"finding of the {self.rig}")

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {"rig": self.rig, "findings": [finding.to_dict() for finding in self.findings]}


def run_rigs(
    vehicle: Vehicle,
    *,
    seed: int = 1,
    recorder: Recorder | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[RigTest, ...]:
    """Run bench, turntable and suspension, each using what the one before has found.

    The gyro's four yaw gains are known up to one factor; k_delta is taken as the gyro's setting.
    """
    given: dict[str, Any] = {"seed": seed, "recorder": recorder}
    bench = bench_test(vehicle, **given)
    on_progress(bench.rig)
    table = turntable_test(vehicle, k_p=bench["k_p"], k_i=bench["k_I"], **given)
    on_progress(table.rig)
    suspension = suspension_test(vehicle, **given)
    on_progress(suspension.rig)
    return bench, table, suspension


def bench_test(vehicle: Vehicle, *, seed: int = 1, recorder: Recorder | None = None) -> RigTest:
    """Find k_p and k_I of the yaw gyro: the pedals step while the rig holds the heading.

    The answer is a jump of k_p k_delta and a ramp of k_I k_delta. Raises RecordError at a limit.
    """
    held, lasts = hold(vehicle, "bench"), _APART + 2 * len(_STEPS) * (_HELD + _APART)
    record = drive(held, "PED", pedal_steps, duration=lasts, seed=seed, recorder=recorder)
    _check_servo(record)
    found = loop_gains(record, input="PED", output="servo_tail", band=_STEP_BAND)
    p, i, off, true = found.proportional, found.integral, found.errors, vehicle.parameters
    k_p, k_i, late = true["gyro.k_p"], true["gyro.k_i"], true["gyro.ped_latency"]
    k_delta = true["gyro.k_delta"]  # read off the gyro, as on a real bench
    over = f"over k_delta = {k_delta:g}"
    hows = (
        "not measured: as the gyro shows its setting",
        "jump of the tail servo's command over the pedal step",
        "slope of the tail servo's command over the pedal step",
        "slope over jump: no other gain is in it",
        f"jump {over}, which the bench does not give",
        f"slope {over}",
        "pedal stick to tail servo command",
    )
    findings = (
        Finding("k_delta", "1", k_delta, how=hows[0]),
        Finding("k_p k_delta", "1", p, k_p * k_delta, off["proportional"], hows[1]),
        Finding("k_I k_delta", "1/s", i, k_i * k_delta, off["integral"], hows[2]),
        Finding("k_I / k_p", "1/s", found.ratio, k_i / k_p, how=hows[3]),
        Finding("k_p", "1", p / k_delta, k_p, off["proportional"] / k_delta, hows[4]),
        Finding("k_I", "1/s", i / k_delta, k_i, off["integral"] / k_delta, hows[5]),
        Finding("delay", "s", found.delay, late, off["delay"], hows[6]),
    )
    return RigTest(rig="bench", findings=findings)


def turntable_test(
    vehicle: Vehicle,
    *,
    k_p: Finding,
    k_i: Finding,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find k_a of the yaw gyro: the table sweeps the yaw rate while the pedals are centred.

    H2 = ped / r = -(k_p + k_I/s) k_a (eq. (3) of the paper), with the gyro's lead and its filter.
    Raises RecordError: the tail servo ran into its limit.
    """
    recorder, held = recorder or Recorder.of(vehicle), hold(vehicle, "turntable")
    record = drive(held, "drive", table_sweep, duration=_TURNED, seed=seed, recorder=recorder)
    _check_servo(record)
    found = loop_gains(
        record, input="r", output="servo_tail", band=_TABLE_BAND, noisy_input=True, lead=True
    )
    p, i, off = found.proportional, found.integral, found.errors
    true = vehicle.parameters
    period, k_a = true["gyro.period"], true["gyro.k_a"]
    lag = held_lag(true["gyro.lead_filter"], period) - 0.5 * period
    ratio, late = true["gyro.k_i"] / true["gyro.k_p"], recorder.late("r") - true["gyro.latency"]
    by_i = _ratio_error(i, off["integral"], k_i)
    by_p = _ratio_error(p, off["proportional"], k_p)
    over = "part over the bench's"
    hows = (
        "ped / r, proportional part",
        "ped / r, integral part",
        "the bench's ratio once more, from another test",
        f"integral {over} k_I = {k_i.value:.5g}",
        f"proportional {over} k_p = {k_p.value:.5g}",
        "from the gain, which grows with frequency",
        "from the gain, which grows less the higher the frequency",
        "by how much the rate is recorded late, beside the servo command it causes",
    )
    findings = (
        Finding("k_p k_a", "s", -p, true["gyro.k_p"] * k_a, off["proportional"], hows[0]),
        Finding("k_I k_a", "1", -i, true["gyro.k_i"] * k_a, off["integral"], hows[1]),
        Finding("k_I / k_p", "1/s", found.ratio, ratio, how=hows[2]),
        Finding("k_a", "s", -i / k_i.value, k_a, by_i, hows[3]),
        Finding("k_a by k_p", "s", -p / k_p.value, k_a, by_p, hows[4]),
        Finding("lead", "s", found.lead, true["gyro.lead"], off["lead"], hows[5]),
        Finding("lead_filter", "s", found.lead_filter, lag, off["lead_filter"], hows[6]),
        Finding("tau_r", "s", -found.delay, late, off["delay"], hows[7]),
    )
    return RigTest(rig="turntable", findings=findings)


def _ratio_error(part: float, error: float, over: Finding) -> float:
    return math.hypot(error / over.value, part / over.value**2 * (over.standard_error or 0.0))


def _check_servo(record: FlightRecord) -> None:
    furthest = float(np.max(np.abs(record["servo_tail"])))
    if furthest > 0.99 * _SERVO_RANGE:
        raise RecordError(
            f"the tail servo's command reached {furthest:.3f} of {_SERVO_RANGE}: its limit "
            "hides the gyro's answer; step or sweep less"
        )


def suspension_test(
    vehicle: Vehicle, *, seed: int = 1, recorder: Recorder | None = None
) -> RigTest:
    """Find the centre of gravity and the IMU's lever arm: hang the helicopter from two points."""
    held, recorder = hold(vehicle, "suspension"), recorder or Recorder.of(vehicle)
    points = suspension_points(held)
    records = {name: hang(held, name, seed=seed, recorder=recorder) for name in points}
    lines = [plumb_line(records[name], point) for name, point in points.items()]
    found, imu = centre_of_gravity(lines), np.array(flip(*held.model.site("imu").pos))
    true_centre = np.round(imu - held.imu_offset, 12) + 0.0  # m: no rounding of a difference, no -0
    off = np.array([line.error for line in lines])[:, None, None]
    errors = np.sqrt(np.sum((_shifts(lines) * off) ** 2, axis=(0, 1)))
    first, second = (line.down for line in lines)
    crossing = float(np.arccos(np.clip(first @ second, -1.0, 1.0)))
    gap = abs(np.cross(first, second) @ (lines[1].point - lines[0].point)) / np.sin(crossing)
    findings = [
        Finding(f"{name}_{axis}", "m", float(value), float(true), float(error), how)
        for name, values, truths, how in (
            ("cg", found, true_centre, "where the plumb lines meet, airframe axes"),
            (
                "imu",
                imu - found,
                held.imu_offset,
                "lever arm: the drawing's IMU less the centre of gravity",
            ),
        )
        for axis, value, true, error in zip("xyz", values, truths, errors)
    ]
    distance = float(np.linalg.norm(found - true_centre))
    findings += [
        Finding("cg distance", "m", distance, 0.0, how="found to true centre of gravity"),
        Finding("crossing", "rad", crossing, how="angle between the plumb lines"),
        Finding("gap", "m", float(gap), how="by which the plumb lines miss each other"),
    ]
    return RigTest(rig="suspension", findings=tuple(findings))
