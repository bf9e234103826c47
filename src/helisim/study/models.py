"""The experiment's models, whose data stand in `models.toml`.

`MODELS` are the paper's, which have a delay in place of the servos and leave out what else stands
between a structure and the recorded motion. `KNOWN_MODELS` have in them what a bench tells of it,
and are judged by the vehicle alone: the paper has no such values.
"""

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
    """How far an identified parameter may be from the truth, percent, and why."""

    percent: float
    reason: str


@dataclass(frozen=True)
class Given:
    """A value that a model is given, and from where.

    Attributes:
        source: a table that was identified before, or a rig of the ground tests.
        name: the parameter in that table, or the rig's finding.
    """

    source: str
    name: str


@dataclass(frozen=True, kw_only=True)
class ModelSpec:
    """One model of the paper and how it is identified from records.

    Attributes:
        name: of the table, as in the reference.
        input: "IN1" or "IN2".
        sweeps: control axes whose sweeps are pooled.
        inputs: channels that drive the model.
        outputs: channels that it must explain.
        conditioning: further channels whose effect is removed.
        reference: channels outside the loop, for the joint input-output method.
        band: rad/s.
        structure: of the model.
        truth_kind: where its true parameters are: in the vehicle's "derivatives", in its "gyro", or
            nowhere, where the structure is a low-order "equivalent" of more than it has states
            for; the truth is then the structure fitted to the exact response.
        given: parameter -> where its value is from; it is not fitted.
        servos_known: the servos are in the structure, so no delay holds them.
        estimator: of the response, by `ident.frequency_response`: CIFER's windows, as in the paper.
        behind: what the ground tests needed to know for that.
        verified_by: axes whose doublets it must predict (the paper's Figures 7 and 8).
        tolerances: by parameter name; a parameter without one is reported, not judged.
        paper_tolerances: by parameter name, where the paper gives no bound and `UNBOUNDED` is
            not meant.
        note: why this band and these channels.
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
        """Of the fit: CIFER's own for an equivalent, which depends on how errors are shared out."""
        return "coherence" if self.truth_kind == "equivalent" else "error"

    def paper_tolerance(self, name: str, cr_percent: float | None) -> Tolerance:
        """Return how far a parameter may be from the paper's, whose bound is given or None."""
        if cr_percent is not None:
            return Tolerance(percent=cr_percent, reason="the paper's Cramér-Rao bound")
        return self.paper_tolerances.get(name, _TOLERANCES["unbounded"])


SERVOS = "servos"
"""The ground test that finds what models with known servos are given."""

_DATA = read_toml(Path(__file__).with_suffix(".toml"))
_TOLERANCES = {
    name: from_plain(Tolerance, one, f"tolerances.{name}")
    for name, one in _DATA["tolerances"].items()
}


def _judged(by_tolerance: Mapping[str, Sequence[str]]) -> dict[str, Tolerance]:
    return {name: _TOLERANCES[word] for word, names in by_tolerance.items() for name in names}


def _spec(table: Mapping[str, Any]) -> ModelSpec:
    """Return the model of a table of `models.toml`."""
    like = {one["name"]: one for one in _DATA["models"]}.get(table.get("like", ""), {})
    data = {**like, **table}
    structure = ident.structures.named(data.pop("structure"))
    servos, renamed = data.pop("servos", {}), data.pop("renamed", {})
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


MODELS = tuple(map(_spec, _DATA["models"]))
"""The paper's."""
KNOWN_MODELS = tuple(map(_spec, _DATA["known"]))
"""Those with known servos, in the order of the experiment's."""
YAW_BASE, YAW_GYRO, YAW_OVERALL, ROLLPITCH_IN1, ROLLPITCH_IN2, HEAVE = MODELS
YAW_BASE_SERVO, _, ROLLPITCH_SERVO, _, HEAVE_SERVO = KNOWN_MODELS


def base_models(vehicle: Vehicle) -> tuple[ModelSpec, ...]:
    """Return the models of the base helicopter, each in the band that the vehicle states.

    A vehicle without `band.yaw_base_low`, `band.yaw_base_high` and so on has the JR700's.
    """
    models, own = [], vehicle.parameters
    for model in (YAW_BASE, ROLLPITCH_IN1, HEAVE):
        edges = (f"band.{model.name}_low", f"band.{model.name}_high")
        band = (own[edges[0]], own[edges[1]]) if edges[0] in own else model.band
        names, known = (one.name for one in model.structure.free), _judged(_DATA["own"])
        judged = {name: known[name] for name in names if name in known}
        changes = {"band": band, "tolerances": judged, "paper_tolerances": judged}
        models.append(replace(model, **changes, verified_by=()))
    return tuple(models)
