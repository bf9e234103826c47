"""The experiment: which models are identified, from which flights, and how well they must fit.

Data only. Each `Model` names the sweeps that are pooled, the responses that are fitted, the
structure, the band, and the tolerances with their reasons.
"""

from dataclasses import dataclass, field
from typing import Literal

from helisim import ident


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """How far an identified parameter may be from the truth, percent, and why."""

    percent: float
    reason: str


TIGHT = Tolerance(
    percent=3.0,
    reason="below 3.9 %, the smallest Cramér-Rao bound that the paper prints for a derivative",
)
LOOSE = Tolerance(
    percent=10.0,
    reason="couplings and delays: the paper's own bounds on them run from 5.6 to 36 %",
)


@dataclass(frozen=True, kw_only=True)
class Model:
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
        weighting: of the fit; "coherence", CIFER's own, where the structure is a low-order
            equivalent, whose parameters depend on how the misfit is shared out.
        known: parameter -> the table whose identified value it is given.
        settings: parameter -> the setting of the gyro whose value it is given.
        verified_by: axes whose doublets it must predict (the paper's Figures 7 and 8).
        tolerances: by parameter name; a parameter without one is reported, not judged.
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
    weighting: Literal["error", "coherence"] = "error"
    known: dict[str, str] = field(default_factory=dict)
    settings: dict[str, str] = field(default_factory=dict)
    verified_by: tuple[str, ...] = ()
    tolerances: dict[str, Tolerance] = field(default_factory=dict)
    note: str = ""


YAW_BASE = Model(
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
    note=(
        "The tail sees sideslip, and its thrust makes some: without conditioning on v the "
        "first-order N_r is 6 % too large (the share I_zz / (m l^2)), and the lightly damped "
        "lateral mode near 0.5 rad/s leaks into the band. The sticks as reference, because the "
        "gyro feeds every disturbance of the yaw rate back to the pedal."
    ),
)
YAW_GYRO = Model(
    name="yaw_gyro",
    input="IN2",
    sweeps=("ped",),
    inputs=("PED",),
    outputs=("ped",),
    conditioning=("LAT", "COL"),
    band=(0.6, 30.0),
    structure=ident.structures.yaw_gyro,
    weighting="coherence",
    known={"N_r": "yaw_base", "N_ped": "yaw_base"},
    settings={"k_I": "gyro.k_i"},
    tolerances=dict.fromkeys(("k_p", "k_delta", "k_a"), TIGHT),
    note=(
        "Stage two of three: the gyro around the base helicopter that stage one found. From the "
        "signals the four gains follow only up to one factor, so k_I is the ground test's."
    ),
)
YAW_OVERALL = Model(
    name="yaw_overall",
    input="IN2",
    sweeps=("ped",),
    inputs=("PED",),
    outputs=("r",),
    conditioning=("LAT", "COL"),
    band=(0.6, 25.0),
    structure=ident.structures.yaw_overall,
    weighting="coherence",
    tolerances=dict.fromkeys(("b1", "b0", "a1", "a0", "tau_r_all"), LOOSE),
    note=(
        "Truth is this structure fitted to the exact response of the vehicle with its gyro: "
        "servo, lead and filters are folded into five numbers."
    ),
)
ROLLPITCH_IN1 = Model(
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
        **dict.fromkeys(("tau_f", "A_b", "B_a", "A_lat", "B_lon", "tau_lat", "tau_lon"), LOOSE),
    },
    note=(
        "From 3 rad/s, below which flap-back with airspeed is felt and the structure has no "
        "speeds; to 42 rad/s, past the rotor's modes near 15 and 27 rad/s."
    ),
)
ROLLPITCH_IN2 = Model(
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
    weighting="coherence",
    tolerances={
        **dict.fromkeys(("L_b", "M_a", "A_lon", "B_lat"), TIGHT),
        **dict.fromkeys(("tau_f", "B_a", "A_lat", "B_lon", "tau_lat", "tau_lon"), LOOSE),
    },
    note=(
        "The gyro is inside, so the parameters describe the whole and are no rotor's. Truth is "
        "this structure fitted to the exact response of the vehicle with its gyro."
    ),
)
HEAVE = Model(
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
