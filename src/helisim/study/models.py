"""The experiment's models: their sweeps, responses, structures, bands, and tolerances with reasons.

`MODELS` are the paper's, which have a delay in place of the servos and leave out what else stands
between a structure and the recorded motion. `KNOWN_MODELS` have in them what a bench tells of it,
and are judged by the vehicle alone: the paper has no such values.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

from helisim import ident
from helisim.vehicle import Vehicle


@dataclass(frozen=True)
class Tolerance:
    """How far an identified parameter may be from the truth, percent, and why."""

    percent: float
    reason: str


TIGHT = Tolerance(
    3.0, "below 3.9 %, the smallest Cramér-Rao bound that the paper prints for a derivative"
)
ROTOR_LAG = Tolerance(
    3.0, "a main parameter as the derivatives are, with whose tolerance it is judged"
)
LOOSE = Tolerance(10.0, "couplings and delays: the paper's own bounds on them run from 5.6 to 36 %")
UNBOUNDED = Tolerance(
    3.0, "the paper gives no bound; those that it gives for derivatives begin at 3.9 %"
)
SLOW_POLE = Tolerance(
    5.0, "the paper gives no bound; this pole lies at the lower edge of what a sweep excites"
)
COMPUTED = Tolerance(
    5.0, "the paper computed eq. (8) from Table 2; servo and lead are in what is identified"
)


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
    given: dict[str, Given] = field(default_factory=dict)
    servos_known: bool = False
    estimator: str = "windows"
    behind: tuple[Given, ...] = ()
    verified_by: tuple[str, ...] = ()
    tolerances: dict[str, Tolerance] = field(default_factory=dict)
    paper_tolerances: dict[str, Tolerance] = field(default_factory=dict)
    note: str = ""

    @property
    def weighting(self) -> Literal["error", "coherence"]:
        """Of the fit: CIFER's own for an equivalent, which depends on how errors are shared out."""
        return "coherence" if self.truth_kind == "equivalent" else "error"

    def paper_tolerance(self, name: str, cr_percent: float | None) -> Tolerance:
        """Return how far a parameter may be from the paper's, whose bound is given or None."""
        if cr_percent is not None:
            return Tolerance(percent=cr_percent, reason="the paper's Cramér-Rao bound")
        return self.paper_tolerances.get(name, UNBOUNDED)


YAW_BASE = ModelSpec(
    name="yaw_base",
    input="IN1",
    sweeps=("ped",),
    inputs=("ped",),
    outputs=("r",),
    conditioning=("v", "col"),
    reference=("PED", "LAT", "COL"),
    band=(0.6, 25.0),
    structure=ident.structures.yaw_base,
    tolerances={"N_r": TIGHT, "N_ped": TIGHT, "tau_r_base": TIGHT},
    paper_tolerances={"N_r": SLOW_POLE},
    note=(
        "The tail sees sideslip, and its thrust makes some: without conditioning on v the "
        "first-order N_r is 6 % too large (the share I_zz / (m l^2)), and the lightly damped "
        "lateral mode near 0.5 rad/s leaks into the band. The sticks as reference, because the "
        "gyro feeds every disturbance of the yaw rate back to the pedal."
    ),
)
YAW_GYRO = ModelSpec(
    name="yaw_gyro",
    input="IN2",
    sweeps=("ped",),
    inputs=("PED",),
    outputs=("ped",),
    conditioning=("LAT", "COL"),
    band=(1.5, 30.0),
    structure=ident.structures.yaw_gyro,
    truth_kind="gyro",
    given={
        "N_ped": Given("yaw_base", "N_ped"),
        "tau_r_base": Given("yaw_base", "tau_r_base"),
        "tau_r": Given("turntable", "tau_r"),
        "lead": Given("turntable", "lead"),
        "lead_filter": Given("turntable", "lead_filter"),
        "k_I": Given("bench", "k_I"),
    },
    behind=(Given("bench", "k_delta"),),
    tolerances={
        **dict.fromkeys(("k_I", "k_p", "k_delta", "k_a", "tau_PED"), TIGHT),
        "N_r_slip": LOOSE,
    },
    note=(
        "Stage two of three: the gyro around the base helicopter that stage one found, with the "
        "servo's share of the delay inside the loop and the recorder's, which the turntable tells, "
        "outside. The damping is fitted again, because the helicopter slips sideways here and "
        "stage one had taken the sideslip out; from 1.5 rad/s up, above the lateral mode near "
        "0.5 rad/s. From all signals together the four gains follow only up to one factor: "
        "multiply k_p and k_I, divide k_delta and k_a. The convention is that k_delta has the "
        "value that the gyro shows as its setting; the bench then gives k_I, and k_I fixes the "
        "other three here."
    ),
)
YAW_OVERALL = ModelSpec(
    name="yaw_overall",
    input="IN2",
    sweeps=("ped",),
    inputs=("PED",),
    outputs=("r",),
    conditioning=("LAT", "COL"),
    band=(0.6, 25.0),
    structure=ident.structures.yaw_overall,
    truth_kind="equivalent",
    tolerances=dict.fromkeys(("b1", "b0", "a1", "a0", "tau_r_all"), TIGHT),
    paper_tolerances=dict.fromkeys(("b1", "b0", "a1", "a0"), COMPUTED),
    note=(
        "Truth is this structure fitted to the exact response of the vehicle with its gyro: "
        "servo, lead and filters are folded into five numbers."
    ),
)
ROLLPITCH_IN1 = ModelSpec(
    name="rollpitch_in1",
    input="IN1",
    sweeps=("lat", "lon"),
    inputs=("lat", "lon"),
    outputs=("p", "q"),
    conditioning=("col", "ped"),
    verified_by=("lon", "lat"),
    band=(3.0, 42.0),
    structure=ident.structures.rollpitch,
    tolerances={
        **dict.fromkeys(("L_b", "M_a", "A_lon", "B_lat"), TIGHT),
        "tau_f": ROTOR_LAG,
        **dict.fromkeys(("A_b", "B_a", "A_lat", "B_lon", "tau_lat", "tau_lon"), LOOSE),
    },
    note=(
        "From 3 rad/s, below which flap-back with airspeed is felt and the structure has no "
        "speeds; to 42 rad/s, past the rotor's modes near 15 and 27 rad/s."
    ),
)
ROLLPITCH_IN2 = ModelSpec(
    name="rollpitch_in2",
    input="IN2",
    sweeps=("lat", "lon"),
    inputs=("LAT", "LON"),
    outputs=("p", "q"),
    conditioning=("COL", "PED"),
    verified_by=("lon", "lat"),
    band=(3.0, 42.0),
    structure=ident.structures.rollpitch_tied.renamed(
        {"lat": "LAT", "lon": "LON"}, name="rollpitch_in2"
    ),
    truth_kind="equivalent",
    tolerances={
        **dict.fromkeys(("L_b", "M_a", "A_lon", "B_lat"), TIGHT),
        "tau_f": ROTOR_LAG,
        **dict.fromkeys(("B_a", "A_lat", "B_lon", "tau_lat", "tau_lon"), LOOSE),
    },
    note=(
        "The gyro is inside, so the parameters describe the whole and are no rotor's. Truth is "
        "this structure fitted to the exact response of the vehicle with its gyro, at the same "
        "frequencies and with the same weights: where a low-order model can't follow, the weights "
        "decide what it gives up, and p/LON, less coherent around its dip at 17 rad/s, moves "
        "tau_lon by about a tenth."
    ),
)
HEAVE = ModelSpec(
    name="heave",
    input="IN1",
    sweeps=("col",),
    inputs=("col",),
    outputs=("w",),
    band=(0.3, 12.0),
    structure=ident.structures.heave,
    tolerances={"Z_w": TIGHT, "Z_col": TIGHT},
    note=(
        "No conditioning: other inputs reach w only through small angles, and the gyro makes "
        "the pedal follow the collective so closely that conditioning on it costs more."
    ),
)

MODELS = (YAW_BASE, YAW_GYRO, YAW_OVERALL, ROLLPITCH_IN1, ROLLPITCH_IN2, HEAVE)

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

_OWN_TIGHT = Tolerance(
    3.0,
    "below 3.9 %, the least Cramér-Rao bound that Wu and Chen print for a derivative of a "
    "helicopter of this kind; where a vehicle's own bounds are known they are wider",
)
_OWN_LOOSE = Tolerance(10.0, "couplings and delays: Wu and Chen's bounds run from 5.6 to 36 %")
_TOLERANCES = {
    **dict.fromkeys(
        ("N_r", "N_ped", "Z_w", "Z_col", "L_b", "M_a", "A_lon", "B_lat", "tau_f"), _OWN_TIGHT
    ),
    **dict.fromkeys(
        ("A_b", "B_a", "A_lat", "B_lon", "tau_r_base", "tau_lat", "tau_lon", "tau_col"), _OWN_LOOSE
    ),
}


def base_models(vehicle: Vehicle) -> tuple[ModelSpec, ...]:
    """Return the models of the base helicopter, each in the band that the vehicle states.

    A vehicle without `band.yaw_base_low`, `band.yaw_base_high` and so on has the JR700's.
    """
    return tuple(_adapted(model, vehicle.parameters) for model in (YAW_BASE, ROLLPITCH_IN1, HEAVE))


def _adapted(model: ModelSpec, own: Mapping[str, float]) -> ModelSpec:
    edges = (f"band.{model.name}_low", f"band.{model.name}_high")
    band = (own[edges[0]], own[edges[1]]) if edges[0] in own else model.band
    names = [parameter.name for parameter in model.structure.free]
    judged = {name: _TOLERANCES[name] for name in names if name in _TOLERANCES}
    return replace(model, band=band, tolerances=judged, paper_tolerances=judged, verified_by=())
