"""The experiment's models, read from `models.toml`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from helisim import ident
from helisim.base.files import read_toml
from helisim.base.settings import from_plain
from helisim.vehicle import Vehicle


@dataclass(frozen=True)
class Tolerance:
    """Largest accepted distance of a parameter from its reference, percent, and the reason."""

    percent: float
    reason: str


@dataclass(frozen=True)
class Given:
    """A given value: the identified table or rig that it comes from, and its name there."""

    source: str
    name: str


@dataclass(frozen=True, kw_only=True)
class ModelSpec:
    """One model of the paper and how it is identified from records.

    Sweeps of its control axes are pooled, the effect of `conditioning` channels removed;
    `reference` channels are outside the loop, for the joint input-output method; `band` is in
    rad/s. The truth's source is the vehicle's "derivatives", its "gyro", or the "equivalent" fitted
    to the exact response. The estimator is as of `ident.frequency_response`, CIFER's windows as in
    the paper. `behind` needed ground tests. It must predict doublets of the axes `verified_by` (the
    paper's Figures 7 and 8). A parameter without a tolerance isn't judged; `paper_tolerances` are
    for those without a bound in the paper.
    """

    name: str
    input: str
    sweeps: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    conditioning: tuple[str, ...] = ()
    reference: tuple[str, ...] = ()
    band: tuple[float, float]
    structure: ident.Structure
    truth_kind: Literal["derivatives", "gyro", "equivalent"] = "derivatives"
    given: Mapping[str, Given] = field(default_factory=dict)
    servos_known: bool = False
    estimator: str = "windows"
    behind: tuple[Given, ...] = ()
    verified_by: tuple[str, ...] = ()
    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    paper_tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    note: str = ""

    @property
    def weighting(self) -> Literal["error", "coherence"]:
        """Weighting of the fit; CIFER's own for an equivalent."""
        return "coherence" if self.truth_kind == "equivalent" else "error"

    def paper_tolerance(self, name: str, cr_percent: float | None) -> Tolerance:
        """Return the tolerance by the paper's Cramér-Rao bound, or the model's own without one."""
        return (
            Tolerance(percent=cr_percent, reason="the paper's Cramér-Rao bound")
            if cr_percent is not None
            else self.paper_tolerances.get(name, _TOLERANCES["unbounded"])
        )


SERVOS = "servos"  # the bench test's name

_DATA = read_toml(Path(__file__).with_suffix(".toml"))
_TOLERANCES = {
    name: from_plain(Tolerance, one, f"tolerances.{name}")
    for name, one in _DATA["tolerances"].items()
}


def _judged(by_tolerance: Mapping[str, Sequence[str]]) -> dict[str, Tolerance]:
    return {name: _TOLERANCES[word] for word, names in by_tolerance.items() for name in names}


def _spec(table: Mapping[str, Any]) -> ModelSpec:
    like = {one["name"]: one for one in _DATA["models"]}.get(table.get("like", ""), {})
    data = {**like, **table}
    structure = ident.structures.named(data.pop("structure"))
    servos, renamed = data.pop("servos", {}), data.pop("renamed", {})
    structure = structure.with_free(*data.pop("free", ()))
    if renamed:
        structure = structure.renamed(renamed, name=like.get("name", data["name"]))
    if servos:
        blocks = {  # what they are replaces the numbers
            control: ident.blocks.second_order(which, omega=200.0, zeta=0.7)
            for control, which in servos.items()
        }
        structure = ident.in_series(structure, inputs=blocks, name=data["name"])
        found = [f"{which}_{number}" for which in servos.values() for number in ("omega", "zeta")]
        data["given"] = {name: Given(SERVOS, name) for name in found}
    data.pop("like", None)
    judged = {name: _judged(data.get(name, {})) for name in ("tolerances", "paper_tolerances")}
    return from_plain(ModelSpec, {**data, **judged, "structure": structure}, data["name"])


MODELS = tuple(map(_spec, _DATA["models"]))  # the paper's, with a delay in place of the servos
KNOWN_MODELS = tuple(map(_spec, _DATA["known"]))  # judged by the vehicle alone
YAW_BASE, YAW_GYRO, YAW_OVERALL, ROLLPITCH_IN1, ROLLPITCH_IN2, HEAVE = MODELS
YAW_BASE_SERVO, _, ROLLPITCH_SERVO, _, HEAVE_SERVO = KNOWN_MODELS


def base_models(vehicle: Vehicle) -> tuple[ModelSpec, ...]:
    """Return the base helicopter's models, each in the vehicle's own band or the JR700's."""
    models, own = [], vehicle.parameters
    for model in (YAW_BASE, ROLLPITCH_IN1, HEAVE):
        edges = (f"band.{model.name}_low", f"band.{model.name}_high")
        band = (own[edges[0]], own[edges[1]]) if edges[0] in own else model.band
        names, known = (one.name for one in model.structure.free), _judged(_DATA["own"])
        judged = {name: known[name] for name in names if name in known}
        changes = {"band": band, "tolerances": judged, "paper_tolerances": judged}
        models.append(replace(model, **changes, verified_by=()))
    return tuple(models)
