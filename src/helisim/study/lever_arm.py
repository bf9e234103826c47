"""What the lever arm of the IMU does to identified parameters when nobody corrects it.

The paper hangs the helicopter to find its centre of gravity and corrects velocity and
acceleration (section 2). The same flights are recorded here with and without that correction.
"""

from dataclasses import asdict, dataclass, replace
from typing import Any

from helisim.errors import InputError
from helisim.sim import FlightPlan, Recorder, Sweep, fly
from helisim.study.flights import Flights
from helisim.study.identification import identify_model
from helisim.study.models import HEAVE, ROLLPITCH_IN1, YAW_BASE
from helisim.vehicle import Vehicle

MODELS = (YAW_BASE, ROLLPITCH_IN1, HEAVE)
"""Those of the base helicopter."""


@dataclass(frozen=True, kw_only=True)
class Shift:
    """One parameter with the correction and without.

    Attributes:
        model: its table.
        name: of the parameter.
        unit: of both values.
        corrected: identified from velocities at the centre of gravity.
        uncorrected: identified from velocities at the IMU.
    """

    model: str
    name: str
    unit: str
    corrected: float
    uncorrected: float

    @property
    def percent(self) -> float:
        """By how much the parameter moves, percent of its size."""
        return 100.0 * (self.uncorrected - self.corrected) / abs(self.corrected)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {**asdict(self), "percent": self.percent}


def lever_arm_study(
    vehicle: Vehicle, *, flights: int = 4, seed: int = 1, jobs: int | None = None
) -> tuple[Shift, ...]:
    """Identify the base models with the lever arm corrected and not, from the same flights.

    Args:
        vehicle: to fly.
        flights: on each axis.
        seed: of pilots and sensors.
        jobs: threads; all processors if None.

    Raises:
        InputError: a number is out of range.
        DivergedError: a flight left the validity of the model.
    """
    if flights < 1:
        raise InputError(f"flights must be 1 or more, got {flights}")
    right = Recorder.of(vehicle)
    axes = dict.fromkeys(axis for model in MODELS for axis in model.sweeps)

    def flown(recorder: Recorder) -> Flights:
        return {
            axis: fly(
                vehicle,
                FlightPlan(excitation=Sweep(axis=axis), recorder=recorder),
                count=flights,
                seed=seed,
                jobs=jobs,
            )
            for axis in axes
        }

    both = [flown(recorder) for recorder in (right, replace(right, lever_arm_corrected=False))]
    shifts = []
    for model in MODELS:
        corrected, uncorrected = (identify_model(model, records) for records in both)
        shifts += [
            Shift(
                model=model.name,
                name=name,
                unit=one.unit,
                corrected=one.value,
                uncorrected=uncorrected[name].value,
            )
            for name, one in corrected.parameters.items()
        ]
    return tuple(shifts)
