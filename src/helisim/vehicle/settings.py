"""What a pilot sets on the gyro before a flight (Wu and Chen, section 2)."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from helisim.errors import InputError

_CHOICES = {
    "gyro.flight_mode": (1, 2, 3),
    "gyro.heading_lock": (0, 1),
    "gyro.anti_windup": (0, 1),
}
_RATES = tuple(
    f"{section}.{rate}"
    for section in ("gyro", "gyro_tuned")
    for rate in ("pitch_rate", "elevator_rate", "aileron_rate")
)


def check_settings(values: Mapping[str, float]) -> None:
    """Check what a pilot can set on the gyro, by dotted names; other names are not looked at.

    Raises:
        InputError: a setting that the gyro does not have.
    """
    for name, choices in _CHOICES.items():
        if name in values and values[name] not in choices:
            listed = ", ".join(map(str, choices))
            raise InputError(f"{name} must be one of {listed}, got {values[name]:g}")
    for name in _RATES:
        if name in values and not 0.0 < values[name] <= 1.0:
            raise InputError(
                f"{name} must be above 0 and at most 1, the whole travel, got {values[name]:g}"
            )


@dataclass(frozen=True, kw_only=True)
class GyroSettings:
    """Settings of a three-axis gyro such as the CGY750; the defaults are the paper's.

    The paper names them and gives no meaning. The CGY750's manual has "Swash AFR (rate)" among
    the basic settings of the swashplate: travel of aileron, elevator and pitch, as share of the
    whole. Its flight modes are F3C, sports and 3D; that they count 1, 2, 3 in this order, and
    what they do inside, is chosen here.

    Attributes:
        flight_mode: how firmly roll and pitch attitude are kept. The cyclic integral is
            multiplied by (flight_mode - 1) / 2: 3 (3D) locks the attitude, 2 (sports) does so
            with half the gain, 1 (F3C) only damps the rates, as a stabilizer bar does, and
            keeps the swashplate's trim.
        pitch_rate: travel of the collective, above 0 to 1. Collective at the swashplate is the
            stick times pitch_rate over the rate at which the gains hold, 0.4.
        elevator_rate: travel of the longitudinal stick, above 0 to 1. The roll and pitch rates
            that it commands are multiplied by elevator_rate / 0.6.
        aileron_rate: travel of the lateral stick, above 0 to 1; likewise.
        heading_lock: True keeps the heading (AVCS), False only damps the yaw rate.

    Raises:
        InputError: a setting that the gyro does not have.
    """

    flight_mode: int = 3
    pitch_rate: float = 0.4
    elevator_rate: float = 0.6
    aileron_rate: float = 0.6
    heading_lock: bool = True

    def __post_init__(self) -> None:
        check_settings(self.as_parameters())

    @classmethod
    def of(cls, parameters: Mapping[str, float]) -> "GyroSettings":
        """Return the settings that a vehicle's parameters carry."""
        return cls(
            flight_mode=int(parameters["gyro.flight_mode"]),
            pitch_rate=parameters["gyro.pitch_rate"],
            elevator_rate=parameters["gyro.elevator_rate"],
            aileron_rate=parameters["gyro.aileron_rate"],
            heading_lock=bool(parameters["gyro.heading_lock"]),
        )

    def as_parameters(self) -> dict[str, float]:
        """Return them by parameter name, such as "gyro.aileron_rate"."""
        return {f"gyro.{name}": float(value) for name, value in asdict(self).items()}
