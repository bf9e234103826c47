"""The servos on the bench, rotor off: an encoder tells what a sweep of their commands makes."""

from dataclasses import replace

from helisim.ident import Fit, blocks, frequency_response, identify, in_series
from helisim.records.channels import SERVO_POSITIONS
from helisim.records.record import FlightRecord
from helisim.sim import Recorder
from helisim.sim.rigs import Finding, RigTest, StickSweep, hold, sweep_stick
from helisim.vehicle import Vehicle

_ENCODER = 0.001
"""Standard deviation of the encoder on a servo's horn, of its unitised travel."""

_TESTS = (("swash", "COL", "servo_front", 2.5), ("tail", "PED", "servo_tail", 1.0))
"""Whose numbers, the stick that is swept, the servo that is looked at, and how much more the stick
moves than the `StickSweep` says: the gyro makes several times as much of the pedal's."""


def servo_test(
    vehicle: Vehicle,
    *,
    sweep: StickSweep | None = None,
    seed: int = 1,
    recorder: Recorder | None = None,
) -> RigTest:
    """Find natural frequency and damping of the swashplate's and of the tail's servos.

    The three servos of the swashplate are of one kind; the front one is looked at. The encoder
    reads its position beside the command that the flight computer records.

    Args:
        vehicle: to test.
        sweep: the default `StickSweep` if None.
        seed: of the sensors.
        recorder: the vehicle's own if None.
    """
    recorder = recorder or Recorder.of(vehicle)
    encoders = dict.fromkeys(SERVO_POSITIONS, _ENCODER)
    reading = replace(recorder, rotor=True, noise={**recorder.noise, **encoders})
    sweep = sweep or StickSweep()
    held = hold(vehicle, "bench")
    findings: list[Finding] = []
    for which, stick, servo, more in _TESTS:
        larger = replace(sweep, amplitude=more * sweep.amplitude)
        record = sweep_stick(held, larger, stick, seed=seed, recorder=reading)
        fit = fit_servo(record, servo)
        truth = vehicle.parameters
        findings += [
            Finding(
                name=f"{which}_{name}",
                unit=fit[f"servo_{name}"].unit,
                value=fit[f"servo_{name}"].value,
                truth=truth[f"servo.{which}_{long}"],
                standard_error=fit[f"servo_{name}"].standard_error,
                how=f"position over command of {servo}, to {fit.band[1]:.0f} rad/s",
            )
            for name, long in (("omega", "frequency"), ("zeta", "damping"))
        ]
    return RigTest(rig="servos", findings=tuple(findings))


def fit_servo(record: FlightRecord, servo: str) -> Fit:
    """Return a servo's natural frequency, damping and delay from a record of its sweep.

    Args:
        record: with the channels of its command ("servo_tail") and position.
        servo: its name.

    Raises:
        IdentificationError: position does not follow command.
    """
    position = f"{servo}_position"
    found = frequency_response(record, inputs=servo, outputs=position, band=(10.0, 190.0))
    known = blocks.second_order("servo")
    late = in_series(known, inputs={"u": blocks.delay("late")}).renamed(
        {"u": servo, "y": position}, name=servo
    )
    return identify(found, late)
