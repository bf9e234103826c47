"""Published numbers (`paper.toml`) and checks of the paper's claims."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from helisim.base.errors import item_of, named
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
    """One published number as printed, unless `source` says otherwise; None where none is printed.

    The unit is SI or as printed; Cramér-Rao bound and insensitivity are in percent of the value.
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

    The input is "IN1", "IN2", or "" where nothing is fitted; the cost is an average.
    """

    name: str
    input: str = ""
    cost: float | None = None
    values: tuple[ReferenceValue, ...] = ()

    def __getitem__(self, name: str) -> ReferenceValue:
        """Return the value of that name. Raises UnknownNameError."""
        return named(self.values, name, f"parameter of {self.name}")

    def __iter__(self) -> Iterator[ReferenceValue]:
        return iter(self.values)

    def get(self, name: str) -> ReferenceValue | None:
        """Return the value of that name, or None."""
        return next((value for value in self.values if value.name == name), None)


@dataclass(frozen=True, kw_only=True)
class Published:
    """Published tables of a vehicle by name; physical parameters are solved from `calibration`."""

    source: str
    tables: tuple[ReferenceTable, ...] = ()
    calibration: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> ReferenceTable:
        """Return a table. Raises UnknownNameError."""
        return named(self.tables, name, "reference table")

    def get(self, name: str) -> ReferenceTable:
        """Return a table, without values if nothing is published."""
        return next((one for one in self.tables if one.name == name), ReferenceTable(name=name))

    @property
    def targets(self) -> dict[str, float]:
        """Calibration targets by name, SI."""
        return {one.name: one.value for name in self.calibration for one in self[name]}


@cache
def _all() -> Mapping[str, Published]:
    return {
        vehicle: from_plain(Published, one, vehicle)
        for vehicle, one in read_toml(Path(__file__).with_suffix(".toml")).items()
    }


def published(vehicle: str) -> Published:
    """Return the published tables of a vehicle. Raises UnknownNameError."""
    return item_of(_all(), vehicle, "vehicle with published numbers")


def published_of(vehicle: "Vehicle") -> Published:
    """Return the published tables of a vehicle, none of one that isn't shipped."""
    from helisim.vehicle.parameters import is_shipped

    return published(vehicle.name) if is_shipped(vehicle.folder) else Published(source="")


def _ratio(number: float, whole: float) -> float:
    return number / whole if whole else math.copysign(math.inf, number)


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """A coefficient of eq. (8), SI: printed, from parts by eq. (5), and direct from [IN2 OUT]."""

    derived: ClassVar = ("difference_percent",)
    name: str
    unit: str
    paper: float
    parts: float
    direct: float

    @property
    def difference_percent(self) -> float:
        """Parts less direct, percent of direct."""
        return _ratio(100.0 * (self.parts - self.direct), abs(self.direct))


@dataclass(frozen=True, kw_only=True)
class OverallCheck:
    """Largest differences of the overall yaw model from its parts and direct, dB and degrees."""

    coefficients: tuple[Coefficient, ...]
    band_rad_s: tuple[float, float]
    gain_db: float
    gain_at_rad_s: float
    phase_deg: float
    phase_at_rad_s: float


def overall_from_parts(base: Mapping[str, float], gyro: Mapping[str, float]) -> dict[str, float]:
    """Return the coefficients of eq. (8) by eq. (5), from identified base and gyro values, SI.

    The delay is the sum of both: pedal to gyro, and servo to recorded rate.
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
    """Return differences of the overall yaw model from its parts (SI, by parameter) and direct."""
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
    """One parameter of Table 3 before (IN1) and after (IN2) the gyro, printed and identified."""

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
        return _ratio(self.paper_after, self.paper_before)

    @property
    def ratio(self) -> float:
        """Identified IN2 over IN1."""
        return _ratio(self.after, self.before)


@dataclass(frozen=True, kw_only=True)
class GyroEffect:
    """Changes of the roll-pitch model by the gyro, of parameters in both columns."""

    changes: tuple[Change, ...]


def gyro_effect(before: Mapping[str, float], after: Mapping[str, float]) -> GyroEffect:
    """Compare the roll-pitch models from IN1 and IN2, SI (Wu and Chen, section 3.2).

    Delays are left out, since they contain the recorder's latencies.
    """
    paper = published("jr700")
    second = paper["rollpitch_in2"]
    return GyroEffect(
        changes=tuple(
            Change(
                name=one.name,
                unit=one.unit,
                paper_before=one.value,
                paper_after=second[one.name].value,
                before=before[one.name],
                after=after[one.name],
            )
            for one in paper["rollpitch_in1"]
            if not one.name.startswith("tau_l") and one.name in before and one.name in after
        )
    )
