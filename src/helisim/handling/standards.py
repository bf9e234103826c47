"""Sets of specifications by name: what usual documents ask of a helicopter."""

from collections.abc import Callable, Mapping, Sequence

from helisim.base.errors import UnknownNameError
from helisim.handling.axis import axis_of
from helisim.handling.criteria import (
    AttitudeBandwidth,
    AttitudeHold,
    AttitudeQuickness,
    Coupling,
    Damping,
    DiskMargin,
    DisturbanceRejection,
    NicholsExclusion,
    PoleLimits,
    StabilityMargins,
)
from helisim.handling.spec import Spec

ATTITUDES = ("lat", "lon", "ped")


def _margins(axes: Sequence[str]) -> list[Spec]:
    hard = [Spec(StabilityMargins(axis=axis), "hard") for axis in axes]
    rest = [NicholsExclusion(axis=axis) for axis in axes] + [DiskMargin(axis=axis) for axis in axes]
    return [Spec(PoleLimits(), "hard"), *hard, *(Spec(one, "check") for one in rest)]


def _rejection(axes: Sequence[str]) -> list[Spec]:
    return [Spec(DisturbanceRejection(axis=axis)) for axis in axes]


def _ads33(task: str) -> Callable[[Sequence[str]], list[Spec]]:
    def asked(axes: Sequence[str]) -> list[Spec]:
        attitudes = [axis for axis in axes if axis in ATTITUDES]
        found = [Spec(AttitudeBandwidth(axis=axis, task=task)) for axis in attitudes]
        found += [Spec(AttitudeQuickness(axis=axis), "check") for axis in attitudes]
        found += [Spec(AttitudeHold(axis=axis), "check") for axis in attitudes]
        cyclic = [axis for axis in axes if axis in ("lat", "lon")]
        found += [Spec(Coupling(axis=axis), "check") for axis in cyclic if len(cyclic) == 2]
        return [*found, Spec(Damping())]

    return asked


STANDARDS: Mapping[str, Callable[[Sequence[str]], list[Spec]]] = {
    "margins": _margins,
    "disturbance_rejection": _rejection,
    "ads33e_target_acquisition": _ads33("target_acquisition"),
    "ads33e_other": _ads33("other"),
    "ads33e_other_divided": _ads33("other_divided"),
}
"""Name -> what it asks of axes. `margins`: MIL-DTL-9490E and AS94900, hard;
`disturbance_rejection`: the US Army's guidelines; the rest: ADS-33E-PRF in hover and at low speed,
for tasks."""


def standard(name: str, *, axes: Sequence[str] = ATTITUDES, scale: float = 1.0) -> tuple[Spec, ...]:
    """Return a set of specifications.

    Args:
        name: of a standard; see `STANDARDS`.
        axes: by their commands or words.
        scale: N of `froude`, for vehicles smaller than those that documents speak of.

    Raises:
        UnknownNameError: there is no such standard or axis.
    """
    if name not in STANDARDS:
        raise UnknownNameError("standard", name, STANDARDS)
    asked = STANDARDS[name]([axis_of(axis).name for axis in axes])
    return tuple(one.scaled(scale) for one in asked)
