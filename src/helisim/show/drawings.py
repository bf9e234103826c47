"""Which figures belong to a fit and to a run."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from helisim.ident import Fit
from helisim.show.bode_drawing import draw_bode
from helisim.show.plots import draw_flight, draw_verification
from helisim.show.svg import Drawing
from helisim.study.identified import IdentifiedModel

if TYPE_CHECKING:
    from helisim.study.run import Run

_SWEPT = {
    "col": ("COL", "col", "w", "phi", "theta"),
    "lon": ("LON", "lon", "q", "theta", "u"),
    "lat": ("LAT", "lat", "p", "phi", "v"),
    "ped": ("PED", "ped", "r", "psi", "v"),
}
"""Axis -> what is shown of its sweep: stick, swashplate or tail, motion."""

_AXIS_NAMES = {"col": "collective", "lon": "longitudinal", "lat": "lateral", "ped": "pedal"}


def run_drawings(run: "Run") -> dict[str, Sequence[Drawing]]:
    """Return all figures of a run: by model, "time MODEL" for verifications, and "sweeps"."""
    groups: dict[str, Sequence[Drawing]] = {}
    for item in run.models:
        groups[item.name] = bode_drawings(item)
        groups[f"time {item.name}"] = verification_drawings(item)
    groups["sweeps"] = [
        draw_flight(
            f"sweep_{axis}",
            f"{_AXIS_NAMES[axis]} sweep",
            record,
            [name for name in _SWEPT[axis] if name in record],
        )
        for axis, record in run.sweeps.items()
    ]
    return groups


def bode_drawings(item: IdentifiedModel) -> tuple[Drawing, ...]:
    """Return one figure for each pair of a model."""
    structure = item.fit.structure
    return tuple(
        pair_drawing(item, output, input_)
        for output in structure.outputs
        for input_ in structure.inputs
    )


def pair_drawing(item: IdentifiedModel, output: str, input_: str) -> Drawing:
    """Return the figure of one pair of a model."""
    fit, pair = item.fit, f"{output}/{input_}"
    return draw_bode(
        f"bode_{item.name}_{output}_{input_}",
        output,
        input_,
        data=fit.data,
        identified=fit.response(fit.data.frequency),
        truth=item.exact,
        used=fit.bands.get(pair),
        caption=_pair_caption(fit, pair),
    )


def verification_drawings(item: IdentifiedModel) -> tuple[Drawing, ...]:
    """Return one figure for each flight that verified a model."""
    if item.verification is None:
        return ()
    names = item.verified_on or tuple(
        f"flight {k + 1}" for k in range(len(item.verification.traces))
    )
    return tuple(
        draw_verification(f"time_{item.name}_{k + 1}", item.verification, k, name)
        for k, name in enumerate(names)
    )


def _pair_caption(fit: Fit, pair: str) -> str:
    if pair not in fit.costs:
        return f"{pair}: not enough coherent points, left out of the fit"
    low, high = fit.bands[pair]
    return f"{pair}: cost {fit.costs[pair]:.3g} over {low:.3g} to {high:.3g} rad/s"
