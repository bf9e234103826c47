"""Bench, turntable and suspension from rig to finding, each value beside the vehicle's truth."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from helisim.base.errors import RecordError, UnknownNameError
from helisim.base.settings import to_plain
from helisim.physics.gyro import held_lag
from helisim.physics.motion import flip
from helisim.records.record import FlightRecord
from helisim.sim.recorder import Recorder
from helisim.sim.rigs.bench import (
    PedalSteps,
    TableSweep,
    hang,
    hold,
    step_pedals,
    suspension_points,
    turn,
)
from helisim.sim.rigs.found import (
    REST,
    attitude_sensitivity,
    centre_errors,
    centre_of_gravity,
    loop_gains,
    plumb_line,
)
from helisim.vehicle import Vehicle
from helisim.vehicle.trim import root_body

_STEP_BAND = (2.0, 60.0)
"""rad/s. A step has content everywhere; below, the resolution of the slow ramp's record tells,
above, the servos' and the sticks' records alias."""
_PARTS = ("jump", "slope")
_NO_GAIN = "slope over jump: no other gain is in it"
_NOT_GIVEN = "which the bench does not give"
_DELAY = "pedal stick to tail servo command"
_PROPORTIONAL = "ped / r, proportional part"
_ONCE_MORE = "the bench's ratio once more, from another test"
_GAIN = "from the gain, which grows with frequency"
_LESS = "from the gain, which grows less the higher the frequency"
_LATE = "by how much the rate is recorded late, beside the servo command it causes"
_SERVO_RANGE = 0.5  # Unitised: the gyro commands the tail servo no further


@dataclass(frozen=True)
class Finding:
    """One number that a ground test found.

    Attributes:
        name: of the quantity.
        unit: SI.
        value: from the record.
        truth: what the vehicle and its recorder carry; None where there is none.
        standard_error: of `value`; None where it is not estimated.
        how: the method, in one line.
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
        plain = to_plain(self)
        last = {name: plain.pop(name) for name in ("standard_error", "how")}
        return {**plain, "error": self.error, **last}


@dataclass(frozen=True, kw_only=True)
class RigTest:
    """What the test in one rig found.

    Attributes:
        rig: its name.
        findings: in the order in which they are found.
        notes: what else there is to know.
    """

    rig: str
    findings: tuple[Finding, ...]
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Finding:
        """Return the finding of that name. Raises UnknownNameError."""
        for finding in self.findings:
            if finding.name == name:
                return finding
        raise UnknownNameError(f"finding of the {self.rig}", name, [f.name for f in self.findings])

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        findings = [finding.to_dict() for finding in self.findings]
        return {"rig": self.rig, "findings": findings, "notes": list(self.notes)}


def run_rigs(
    vehicle: Vehicle,
    *,
    seed: int = 1,
    recorder: Recorder | None = None,
    on_progress: Callable[[str], None] | None = None,
) -> tuple[RigTest, ...]:
    """Run bench, turntable and suspension, each using what the one before has found.

    No signal tells the gyro's four yaw gains apart beyond one common factor: the unit in which
    the gyro counts its rate error. The convention is that k_delta has the value which the gyro
    shows as its setting. The seed is of the sensors; `on_progress` is called with each rig's name.
    """
    on_progress, given = on_progress or (lambda _: None), {"seed": seed, "recorder": recorder}
    setting = vehicle.parameters["gyro.k_delta"]  # read off the gyro, as on a real bench
    bench = bench_test(vehicle, k_delta=setting, **given)
    on_progress(bench.rig)
    table = turntable_test(vehicle, k_p=bench["k_p"], k_i=bench["k_I"], **given)
    on_progress(table.rig)
    suspension = suspension_test(vehicle, **given)
    on_progress(suspension.rig)
    return bench, table, suspension


def bench_test(
    vehicle: Vehicle,
    *,
    k_delta: float,
    steps: PedalSteps | None = None,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find k_p and k_I of the yaw gyro: the pedals step while the rig holds the heading.

    The gyro answers the step with a jump of k_p k_delta and a ramp of k_I k_delta: the bench
    sees the two products and their ratio. The gain of the stick, k_delta, must come from
    elsewhere: from the gyro's settings.

    Raises:
        RecordError: the tail servo ran into its limit.
    """
    record = step_pedals(hold(vehicle, "bench"), steps, seed=seed, recorder=recorder)
    _check_servo(record)
    found = loop_gains(record, input="PED", output="servo_tail", band=_STEP_BAND, noisy="output")
    p, p_error = found.proportional, found.proportional_error
    i, i_error = found.integral, found.integral_error
    true = vehicle.parameters
    k_p, k_i, own = true["gyro.k_p"], true["gyro.k_i"], true["gyro.k_delta"]
    over = f"over k_delta = {k_delta:g}"
    jump, slope = (f"{one} of the tail servo's command over the pedal step" for one in _PARTS)
    findings = (
        Finding("k_delta", "1", k_delta, how="not measured: as the gyro shows its setting"),
        Finding("k_p k_delta", "1", p, k_p * own, p_error, jump),
        Finding("k_I k_delta", "1/s", i, k_i * own, i_error, slope),
        Finding("k_I / k_p", "1/s", found.ratio, k_i / k_p, how=_NO_GAIN),
        Finding("k_p", "1", p / k_delta, k_p, p_error / k_delta, f"jump {over}, {_NOT_GIVEN}"),
        Finding("k_I", "1/s", i / k_delta, k_i, i_error / k_delta, f"slope {over}"),
        Finding("delay", "s", found.delay, true["gyro.ped_latency"], found.delay_error, _DELAY),
    )
    rest = record.select(("p", "q", "r"))
    note = (
        f"rates while the pedals stepped: {np.max(np.abs(rest.mean(axis=0))):.1e} rad/s mean, "
        f"{np.max(rest.std(axis=0)):.1e} rad/s rms, the sensors' noise"
    )
    return RigTest(rig="bench", findings=findings, notes=(note,))


def turntable_test(
    vehicle: Vehicle,
    *,
    k_p: Finding,
    k_i: Finding,
    sweep: TableSweep | None = None,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find k_a of the yaw gyro: the table sweeps the yaw rate while the pedals are centred.

    Identifies H2 = ped / r = -(k_p + k_I/s) k_a (eq. (3) of the paper) and the gyro's lead on
    the rate with its filter, as a continuous lead answers like the gyro's sampled one. The noise
    is in the recorded rate, so the fit predicts the rate; k_p and k_I are the bench's, with errors.

    Raises:
        RecordError: the tail servo ran into its limit.
    """
    sweep, recorder = sweep or TableSweep(), recorder or Recorder.of(vehicle)
    record = turn(hold(vehicle, "turntable"), sweep, seed=seed, recorder=recorder)
    _check_servo(record)
    found = loop_gains(
        record, input="r", output="servo_tail", band=sweep.band, noisy="input", lead=True
    )
    p, p_error = found.proportional, found.proportional_error
    i, i_error = found.integral, found.integral_error
    true = vehicle.parameters
    period, k_a = true["gyro.period"], true["gyro.k_a"]
    lead_filter = held_lag(true["gyro.lead_filter"], period) - 0.5 * period
    ratio, latency = true["gyro.k_i"] / true["gyro.k_p"], true["gyro.latency"]
    by_i, by_p = _ratio_error(i, i_error, k_i), _ratio_error(p, p_error, k_p)
    over = "part over the bench's"
    findings = (
        Finding("k_p k_a", "s", -p, true["gyro.k_p"] * k_a, p_error, _PROPORTIONAL),
        Finding("k_I k_a", "1", -i, true["gyro.k_i"] * k_a, i_error, "ped / r, integral part"),
        Finding("k_I / k_p", "1/s", found.ratio, ratio, how=_ONCE_MORE),
        Finding("k_a", "s", -i / k_i.value, k_a, by_i, f"integral {over} k_I = {k_i.value:.5g}"),
        Finding(
            "k_a by k_p",
            "s",
            -p / k_p.value,
            k_a,
            by_p,
            f"proportional {over} k_p = {k_p.value:.5g}",
        ),
        Finding("lead", "s", found.lead, true["gyro.lead"], found.lead_error, _GAIN),
        Finding("lead_filter", "s", found.lead_filter, lead_filter, found.lead_filter_error, _LESS),
        Finding("tau_r", "s", -found.delay, recorder.late("r") - latency, found.delay_error, _LATE),
    )
    return RigTest(rig="turntable", findings=findings)


def _ratio_error(part: float, error: float, over: Finding) -> float:
    """Return the standard error of a part over a finding, both in error on their own."""
    of_bench = part / over.value**2 * (over.standard_error or 0.0)
    return math.hypot(error / over.value, of_bench)


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
    found, (true_centre, imu) = centre_of_gravity(lines), _drawing(held)
    first, second = (np.array(line.down) for line in lines)
    crossing = float(np.arccos(np.clip(first @ second, -1.0, 1.0)))
    gap = abs(np.cross(first, second) @ (lines[1].point - lines[0].point)) / np.sin(crossing)
    sensitivity = attitude_sensitivity(lines)
    worst = max(recorder.noise.get("phi", 0.0), recorder.noise.get("theta", 0.0))
    samples, allowed = recorder.rate_hz * REST, 1e-3 / sensitivity
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
        for axis, value, true, error in zip("xyz", values, truths, centre_errors(lines))
    ]
    distance = float(np.linalg.norm(found - true_centre))
    far = Finding("cg distance", "m", distance, 0.0, how="found to true centre of gravity")
    return RigTest(
        rig="suspension",
        findings=(*findings, far),
        notes=(
            f"the lines cross at {np.degrees(crossing):.1f} degrees and miss each other by "
            f"{1e3 * gap:.3f} mm",
            f"an attitude off by 1 mrad in the worst way moves the centre by "
            f"{sensitivity:.3f} mm: 1 mm allows a bias of {1e3 * allowed:.2f} mrad "
            f"({np.degrees(allowed):.2f} degrees), or {1e3 * allowed * np.sqrt(samples):.0f} mrad "
            f"of white noise averaged over {REST:g} s; the recorder has {1e3 * worst:.3g} mrad",
        ),
    )


def _drawing(held: Vehicle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return true centre of gravity and IMU in the airframe's own axes (FRD), (3,) m each."""
    model = held.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    body = root_body(model)
    turned = data.xmat[body].reshape(3, 3).T
    centre = turned @ (data.subtree_com[body] - data.xpos[body])
    imu = turned @ (data.site(held.roles.site("imu")).xpos - data.xpos[body])
    return np.array(flip(*centre)), np.array(flip(*imu))
