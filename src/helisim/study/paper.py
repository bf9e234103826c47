"""Published numbers, read from `paper.toml`, and what an experiment finds of the paper's claims.

They are compared with, and never fed to an identification.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from helisim.base.errors import ModelError, UnknownNameError
from helisim.base.files import read_toml
from helisim.base.settings import from_plain
from helisim.base.units import DB_PER_NEPER
from helisim.ident import structures
from helisim.ident.evaluate import response

if TYPE_CHECKING:  # a table of numbers needs no simulator
    from helisim.vehicle import Vehicle

_POINTS = 200


@dataclass(frozen=True)
class ReferenceValue:
    """One published number.

    Attributes:
        name: the parameter's name in this project.
        value: in `unit`, as printed unless `source` says how it was derived.
        unit: SI, except for values kept as printed.
        cr_percent: published Cramér-Rao bound, percent of the value; None where none is printed.
        insensitivity_percent: published insensitivity, percent; None where none is printed.
        source: table or equation, and what is known to be wrong with it.
    """

    name: str
    value: float
    unit: str
    cr_percent: float | None = None
    insensitivity_percent: float | None = None
    source: str = ""


@dataclass(frozen=True, kw_only=True)
class ReferenceTable:
    """The published numbers of one model, addressed by name.

    Attributes:
        name: the table's name in this project.
        input: the signals that drive the model: "IN1", "IN2", or "" where nothing is fitted.
        cost: published average cost of the fit; None where none is printed.
        values: in the order of the paper.
    """

    name: str
    input: str = ""
    cost: float | None = None
    values: tuple[ReferenceValue, ...] = ()

    def __getitem__(self, name: str) -> ReferenceValue:
        """Return the value of that name. Raises UnknownNameError."""
        if name not in self:
            raise UnknownNameError(f"parameter of {self.name}", name, self.names)
        return self.values[self.names.index(name)]

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[ReferenceValue]:
        return iter(self.values)

    def get(self, name: str) -> ReferenceValue | None:
        """Return the value of that name, or None."""
        return next((value for value in self.values if value.name == name), None)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameter names, in the order of the paper."""
        return tuple(value.name for value in self.values)


@dataclass(frozen=True, kw_only=True)
class Claim:
    """What the paper says in words about how parameters change from IN1 to IN2.

    Attributes:
        said: the paper's words, shortened.
        names: of the parameters; empty for all.
        ratio: of IN2 to IN1 that is to hold for each; None where the words are of a trend.
        rise_percent: claimed rise; None where the words give no number.
    """

    said: str
    names: tuple[str, ...] = ()
    ratio: float | None = None
    rise_percent: float | None = None


@dataclass(frozen=True, kw_only=True)
class Published:
    """What is published of one vehicle; its tables are addressed by name.

    Attributes:
        source: what the calibration's tables are called in the provenance.
        tables: models have the names of helisim's own.
        calibration: the tables that the physical parameters are solved from.
        claims: what is said of them in words.
    """

    source: str
    tables: tuple[ReferenceTable, ...] = ()
    calibration: tuple[str, ...] = ()
    claims: tuple[Claim, ...] = ()

    def __getitem__(self, name: str) -> ReferenceTable:
        """Return a table. Raises UnknownNameError; the message lists those that exist."""
        for table in self.tables:
            if table.name == name:
                return table
        raise UnknownNameError("reference table", name, [table.name for table in self.tables])

    def get(self, name: str) -> ReferenceTable:
        """Return a table, one without values where nothing is published."""
        named = (table for table in self.tables if table.name == name)
        return next(named, ReferenceTable(name=name))

    @property
    def targets(self) -> dict[str, float]:
        """The calibration's values by name, SI."""
        return {one.name: one.value for name in self.calibration for one in self[name]}


@cache
def _all() -> Mapping[str, Published]:
    tables = read_toml(Path(__file__).with_suffix(".toml"))
    return {vehicle: from_plain(Published, one, vehicle) for vehicle, one in tables.items()}


def published(vehicle: str) -> Published:
    """Return what is published of a vehicle.

    Raises:
        UnknownNameError: nothing is; the message lists the vehicles that have something.
    """
    if vehicle not in _all():
        raise UnknownNameError("vehicle with published numbers", vehicle, _all())
    return _all()[vehicle]


def published_of(folder: Path, *, instead: str) -> Published:
    """Return what is published of the vehicle in a folder: of a shipped one only.

    A folder's name alone says nothing. Raises ModelError, which says what to do `instead`.
    """
    from helisim.vehicle.folder import is_shipped

    if not is_shipped(folder):
        raise ModelError(f"nothing is published of {folder.name!r}: {instead}")
    return published(folder.name)


def paper_table(vehicle: "Vehicle", model: str) -> ReferenceTable:
    """Return the published table of a model, without values where nothing is published."""
    from helisim.vehicle.folder import is_shipped

    if not is_shipped(vehicle.folder):
        return ReferenceTable(name=model)
    return published(vehicle.name).get(model)


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One coefficient of eq. (8), the overall yaw model.

    Attributes:
        name: as in the structure `yaw_overall`.
        unit: SI.
        paper: as printed in eq. (8).
        parts: by eq. (5), from the identified parts.
        direct: identified from [IN2 OUT].
    """

    derived: ClassVar = ("difference_percent",)
    name: str
    unit: str
    paper: float
    parts: float
    direct: float

    @property
    def difference_percent(self) -> float:
        """Parts less direct, percent of direct."""
        return 100.0 * (self.parts - self.direct) / abs(self.direct)


@dataclass(frozen=True, kw_only=True)
class OverallCheck:
    """How the overall yaw model from its parts differs from the one identified directly.

    Attributes:
        coefficients: one each.
        band_rad_s: in which the responses are compared.
        gain_db: largest difference of the gains, dB.
        gain_at_rad_s: where.
        phase_deg: largest difference of the phases, degrees.
        phase_at_rad_s: where.
    """

    coefficients: tuple[Coefficient, ...]
    band_rad_s: tuple[float, float]
    gain_db: float
    gain_at_rad_s: float
    phase_deg: float
    phase_at_rad_s: float


def overall_from_parts(base: Mapping[str, float], gyro: Mapping[str, float]) -> dict[str, float]:
    """Return the coefficients of eq. (8) by eq. (5), from identified parts.

    The delay is the sum of the two that the parts have: pedal to gyro, and servo to recorded rate.

    Of the base N_r, N_ped and tau_r_base by name, of the gyro k_p, k_I, k_delta, k_a and tau_PED.
    """
    n_r, n_ped = base["N_r"], base["N_ped"]
    k_p, k_i, k_delta, k_a = (gyro[name] for name in ("k_p", "k_I", "k_delta", "k_a"))
    return {
        "b1": k_p * n_ped * k_delta,
        "b0": k_i * n_ped * k_delta,
        "a1": k_p * k_a * n_ped - n_r,
        "a0": k_i * k_a * n_ped,
        "tau_r_all": gyro["tau_PED"] + base["tau_r_base"],
    }


def check_overall(
    base: Mapping[str, float],
    gyro: Mapping[str, float],
    overall: Mapping[str, float],
    *,
    band_rad_s: tuple[float, float],
) -> OverallCheck:
    """Compare the overall yaw model from its parts with the one identified directly.

    Values are by parameter, SI: of the stages one, two (with what the ground tests gave) and three.
    """
    parts = overall_from_parts(base, gyro)
    direct = {name: overall[name] for name in parts}
    omega = np.geomspace(*band_rad_s, _POINTS)
    each = [response(structures.yaw_overall, values, omega)[0, 0] for values in (parts, direct)]
    gap = np.asarray(np.log(each[0] / each[1]), dtype=np.complex128)
    gain, phase = DB_PER_NEPER * gap.real, np.degrees(gap.imag)
    worst, latest = int(np.argmax(np.abs(gain))), int(np.argmax(np.abs(phase)))
    printed = published("jr700")["yaw_overall"]
    return OverallCheck(
        coefficients=tuple(
            Coefficient(
                name=name,
                unit=printed[name].unit,
                paper=printed[name].value,
                parts=parts[name],
                direct=direct[name],
            )
            for name in parts
        ),
        band_rad_s=band_rad_s,
        gain_db=float(gain[worst]),
        gain_at_rad_s=float(omega[worst]),
        phase_deg=float(phase[latest]),
        phase_at_rad_s=float(omega[latest]),
    )


@dataclass(frozen=True, kw_only=True)
class Change:
    """One parameter of Table 3 before and after the gyro.

    Attributes:
        name: of the parameter.
        unit: of all four values.
        paper_before: Table 3, IN1.
        paper_after: Table 3, IN2.
        before: identified from IN1, the base helicopter.
        after: identified from IN2, the helicopter with its gyro.
    """

    derived: ClassVar = ("paper_ratio", "ratio")
    name: str
    unit: str
    paper_before: float
    paper_after: float
    before: float
    after: float

    @property
    def paper_ratio(self) -> float:
        """The paper's IN2 over IN1."""
        return self.paper_after / self.paper_before

    @property
    def ratio(self) -> float:
        """The identified IN2 over IN1."""
        return self.after / self.before


@dataclass(frozen=True, kw_only=True)
class Statement:
    """What the paper says, and what is so.

    Attributes:
        said: by the paper.
        paper: what its own table says.
        identified: what was identified from the records.
    """

    said: str
    paper: str
    identified: str


@dataclass(frozen=True, kw_only=True)
class GyroEffect:
    """What the gyro does to the roll-pitch model.

    Attributes:
        changes: one a parameter that both columns have.
        statements: one for each thing that the paper says of them.
    """

    changes: tuple[Change, ...]
    statements: tuple[Statement, ...]


def gyro_effect(before: Mapping[str, float], after: Mapping[str, float]) -> GyroEffect:
    """Compare the roll-pitch model from IN1 with the one from IN2 (Wu and Chen, section 3.2).

    Values are by parameter, SI, from IN1 and from IN2. Delays are left out: a recorder's latencies
    are in them.
    """
    paper = published("jr700")
    first, second = paper["rollpitch_in1"], paper["rollpitch_in2"]
    changes = {
        one.name: Change(
            name=one.name,
            unit=one.unit,
            paper_before=one.value,
            paper_after=second[one.name].value,
            before=before[one.name],
            after=after[one.name],
        )
        for one in first
        if not one.name.startswith("tau_l") and one.name in before and one.name in after
    }
    statements = []
    for claim in paper.claims:
        meant = [changes[name] for name in claim.names or changes]
        printed = _ratios(claim, {one.name: one.paper_ratio for one in meant})
        found = _ratios(claim, {one.name: one.ratio for one in meant})
        statements.append(Statement(said=claim.said, paper=printed, identified=found))
    return GyroEffect(changes=tuple(changes.values()), statements=tuple(statements))


def _ratios(claim: Claim, ratios: Mapping[str, float]) -> str:
    """Return ratios in words: beside the one that is claimed, or as trends."""
    if claim.ratio is None:
        return ", ".join(f"{name} {_percent(abs(ratio))}" for name, ratio in ratios.items())
    return ", ".join(
        f"{name} {ratio:.3f}, {_percent(ratio / claim.ratio)} from {claim.ratio:g}"
        for name, ratio in ratios.items()
    )


def _percent(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):+.1f} %"
