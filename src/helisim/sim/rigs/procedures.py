"""Bench and turntable from rig to finding, each value beside the truth that the vehicle carries."""

import math
from collections.abc import Callable

import numpy as np

from helisim.base.errors import RecordError
from helisim.physics.gyro import held_lag
from helisim.records.record import FlightRecord
from helisim.sim.recorder import Recorder
from helisim.sim.rigs.finding import Finding, RigTest
from helisim.sim.rigs.gains import loop_gains
from helisim.sim.rigs.hold import PedalSteps, TableSweep, hold, step_pedals, turn
from helisim.sim.rigs.suspension import suspension_test
from helisim.vehicle import Vehicle

_STEP_BAND = (2.0, 60.0)
"""rad/s. A step has content everywhere; below, the resolution of the slow ramp's record tells,
above, the servos' and the sticks' records alias."""
_SERVO_RANGE = 0.5
"""Unitised: the gyro commands the tail servo no further."""


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
    shows as its setting; bench and turntable then give the other three.

    Args:
        vehicle: to test.
        seed: of the sensors.
        recorder: the vehicle's own if None.
        on_progress: called with a rig's name after each test.
    """
    on_progress = on_progress or (lambda _: None)
    setting = vehicle.parameters["gyro.k_delta"]  # read off the gyro, as on a real bench
    bench = bench_test(vehicle, k_delta=setting, seed=seed, recorder=recorder)
    on_progress(bench.rig)
    table = turntable_test(
        vehicle, k_p=bench["k_p"], k_i=bench["k_I"], seed=seed, recorder=recorder
    )
    on_progress(table.rig)
    suspension = suspension_test(vehicle, seed=seed, recorder=recorder)
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

    Args:
        vehicle: to test.
        k_delta: gain of the pedal stick, 1.
        steps: the default `PedalSteps` if None.
        seed: of the sensors.
        recorder: the vehicle's own if None.

    Raises:
        RecordError: the tail servo ran into its limit.
    """
    record = step_pedals(hold(vehicle, "bench"), steps, seed=seed, recorder=recorder)
    _check_servo(record)
    found = loop_gains(record, input="PED", output="servo_tail", band=_STEP_BAND, noisy="output")
    true = vehicle.parameters
    k_p, k_i = true["gyro.k_p"], true["gyro.k_i"]
    rest = record.select(("p", "q", "r"))
    return RigTest(
        rig="bench",
        findings=(
            Finding(
                name="k_delta",
                unit="1",
                value=k_delta,
                how="not measured: as the gyro shows its setting",
            ),
            Finding(
                name="k_p k_delta",
                unit="1",
                value=found.proportional,
                truth=k_p * true["gyro.k_delta"],
                standard_error=found.proportional_error,
                how="jump of the tail servo's command over the pedal step",
            ),
            Finding(
                name="k_I k_delta",
                unit="1/s",
                value=found.integral,
                truth=k_i * true["gyro.k_delta"],
                standard_error=found.integral_error,
                how="slope of the tail servo's command over the pedal step",
            ),
            Finding(
                name="k_I / k_p",
                unit="1/s",
                value=found.ratio,
                truth=k_i / k_p,
                how="slope over jump: no other gain is in it",
            ),
            Finding(
                name="k_p",
                unit="1",
                value=found.proportional / k_delta,
                truth=k_p,
                standard_error=found.proportional_error / k_delta,
                how=f"jump over k_delta = {k_delta:g}, which the bench does not give",
            ),
            Finding(
                name="k_I",
                unit="1/s",
                value=found.integral / k_delta,
                truth=k_i,
                standard_error=found.integral_error / k_delta,
                how=f"slope over k_delta = {k_delta:g}",
            ),
            Finding(
                name="delay",
                unit="s",
                value=found.delay,
                truth=true["gyro.ped_latency"],
                standard_error=found.delay_error,
                how="pedal stick to tail servo command",
            ),
        ),
        notes=(
            f"rates while the pedals stepped: {np.max(np.abs(rest.mean(axis=0))):.1e} rad/s mean, "
            f"{np.max(rest.std(axis=0)):.1e} rad/s rms, the sensors' noise",
        ),
    )


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
    is in the recorded rate, so the fit predicts the rate.

    Args:
        vehicle: to test.
        k_p: from the bench; k_a has its error too.
        k_i: from the bench, 1/s.
        sweep: the default `TableSweep` if None.
        seed: of the sensors.
        recorder: the vehicle's own if None.

    Raises:
        RecordError: the tail servo ran into its limit.
    """
    sweep = sweep or TableSweep()
    recorder = recorder or Recorder.of(vehicle)
    record = turn(hold(vehicle, "turntable"), sweep, seed=seed, recorder=recorder)
    _check_servo(record)
    true = vehicle.parameters
    period = true["gyro.period"]
    lead_filter = held_lag(true["gyro.lead_filter"], period) - 0.5 * period
    found = loop_gains(
        record, input="r", output="servo_tail", band=sweep.band, noisy="input", lead=True
    )
    k_a = true["gyro.k_a"]
    return RigTest(
        rig="turntable",
        findings=(
            Finding(
                name="k_p k_a",
                unit="s",
                value=-found.proportional,
                truth=true["gyro.k_p"] * k_a,
                standard_error=found.proportional_error,
                how="ped / r, proportional part",
            ),
            Finding(
                name="k_I k_a",
                unit="1",
                value=-found.integral,
                truth=true["gyro.k_i"] * k_a,
                standard_error=found.integral_error,
                how="ped / r, integral part",
            ),
            Finding(
                name="k_I / k_p",
                unit="1/s",
                value=found.ratio,
                truth=true["gyro.k_i"] / true["gyro.k_p"],
                how="the bench's ratio once more, from another test",
            ),
            Finding(
                name="k_a",
                unit="s",
                value=-found.integral / k_i.value,
                truth=k_a,
                standard_error=_ratio_error(found.integral, found.integral_error, k_i),
                how=f"integral part over the bench's k_I = {k_i.value:.5g}",
            ),
            Finding(
                name="k_a by k_p",
                unit="s",
                value=-found.proportional / k_p.value,
                truth=k_a,
                standard_error=_ratio_error(found.proportional, found.proportional_error, k_p),
                how=f"proportional part over the bench's k_p = {k_p.value:.5g}",
            ),
            Finding(
                name="lead",
                unit="s",
                value=found.lead,
                truth=true["gyro.lead"],
                standard_error=found.lead_error,
                how="from the gain, which grows with frequency",
            ),
            Finding(
                name="lead_filter",
                unit="s",
                value=found.lead_filter,
                truth=lead_filter,
                standard_error=found.lead_filter_error,
                how="from the gain, which grows less the higher the frequency",
            ),
            Finding(
                name="tau_r",
                unit="s",
                value=-found.delay,
                truth=recorder.late("r") - true["gyro.latency"],
                standard_error=found.delay_error,
                how="by how much the rate is recorded late, beside the servo command it causes",
            ),
        ),
    )


def _ratio_error(part: float, error: float, over: Finding) -> float:
    """Return the standard error of a part over a finding, both in error on their own."""
    own = error / over.value
    of_bench = part / over.value**2 * (over.standard_error or 0.0)
    return math.hypot(own, of_bench)


def _check_servo(record: FlightRecord) -> None:
    furthest = float(np.max(np.abs(record["servo_tail"])))
    if furthest > 0.99 * _SERVO_RANGE:
        raise RecordError(
            f"the tail servo's command reached {furthest:.3f} of {_SERVO_RANGE}: its limit "
            "hides the gyro's answer; step or sweep less"
        )
