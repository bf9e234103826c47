"""The experiment's models as an engineer with a bench would identify them: servos are known.

The paper's structures have a delay in place of the servos, and leave out what else stands between
a structure and the recorded motion. These have in them what is known of it, and are judged by the
vehicle alone: the paper has no such values.
"""

from dataclasses import replace

from helisim import ident
from helisim.study.models import HEAVE, ROLLPITCH_IN1, ROLLPITCH_IN2, YAW_BASE, YAW_OVERALL, Given

SERVOS = "servos"
"""The ground test that finds what these models are given."""

_SWASH = ident.blocks.second_order("swash", omega=200.0, zeta=0.7)
_TAIL = ident.blocks.second_order("tail", omega=200.0, zeta=0.7)
"""What they are replaces the numbers."""


def _known(which: str) -> dict[str, Given]:
    names = (f"{which}_omega", f"{which}_zeta")
    return {name: Given(SERVOS, name) for name in names}


YAW_BASE_SERVO = replace(
    YAW_BASE,
    name="yaw_base_servo",
    structure=ident.in_series(YAW_BASE.structure, inputs={"ped": _TAIL}, name="yaw_base_servo"),
    given=_known("tail"),
    servos_known=True,
    estimator="local",
    verified_by=(),
)
ROLLPITCH_SERVO = replace(
    ROLLPITCH_IN1,
    name="rollpitch_servo",
    sweeps=("lat", "lon", "ped", "col"),
    conditioning=("ped", "col"),
    band=(6.0, 42.0),
    structure=ident.in_series(
        ident.structures.rollpitch_speeds,
        inputs={"lat": _SWASH, "lon": _SWASH},
        name="rollpitch_servo",
    ),
    given=_known("swash"),
    servos_known=True,
    estimator="local",
    verified_by=(),
    note=(
        "The gyro moves the pedal as the cyclic is swept, and the tail's torque pitches: without "
        "conditioning on pedal and collective, by sweeps of theirs, q/lat is up to 3 % off. From "
        "6 rad/s, since large slow motions aren't linear: q/lat and p/lon are 3 to 5 % off near "
        "4 rad/s."
    ),
)
HEAVE_SERVO = replace(
    HEAVE,
    name="heave_servo",
    conditioning=("phi",),
    structure=ident.in_series(HEAVE.structure, inputs={"col": _SWASH}, name="heave_servo"),
    given=_known("swash"),
    servos_known=True,
    estimator="local",
    note=(
        "A hover is banked, so the velocity along the body's own axis feels gravity by the bank "
        "angle: conditioning on it, as on v in yaw, takes 0.9 % off Z_w. Heave bends with the "
        "velocity: a sweep of 0.03 is 2 % off the derivatives near 2 rad/s, one of 0.01 a tenth."
    ),
)
YAW_OVERALL_LOCAL = replace(
    YAW_OVERALL, name="yaw_overall_local", estimator="local", verified_by=()
)
ROLLPITCH_IN2_LOCAL = replace(
    ROLLPITCH_IN2, name="rollpitch_in2_local", estimator="local", verified_by=()
)

KNOWN_MODELS = (
    YAW_BASE_SERVO,
    YAW_OVERALL_LOCAL,
    ROLLPITCH_SERVO,
    ROLLPITCH_IN2_LOCAL,
    HEAVE_SERVO,
)
"""In the order of the experiment's. The low-order equivalents have no servo of their own."""
