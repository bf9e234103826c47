"""The consistency check of eq. (8): the overall yaw model from its parts against the direct one.

The parts are the base helicopter (stage one), the gyro (stage two) and the ground tests; eq. (5)
of Wu and Chen makes the overall model of them. Stage three identifies it from [IN2 OUT] directly.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from helisim.base.units import DB_PER_NEPER
from helisim.ident import structures
from helisim.ident.evaluate import response
from helisim.study.paper import jr700

_POINTS = 200


@dataclass(frozen=True, kw_only=True)
class Coefficient:
    """One coefficient of eq. (8).

    Attributes:
        name: as in the structure `yaw_overall`.
        unit: SI.
        paper: as printed in eq. (8).
        parts: by eq. (5), from the identified parts.
        direct: identified from [IN2 OUT].
    """

    name: str
    unit: str
    paper: float
    parts: float
    direct: float

    @property
    def difference_percent(self) -> float:
        """Parts less direct, percent of direct."""
        return 100.0 * (self.parts - self.direct) / abs(self.direct)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {**asdict(self), "difference_percent": self.difference_percent}


@dataclass(frozen=True, kw_only=True)
class OverallCheck:
    """How the two overall models differ.

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

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON data."""
        return {
            **asdict(self),
            "band_rad_s": list(self.band_rad_s),
            "coefficients": [one.to_dict() for one in self.coefficients],
        }


def overall_from_parts(base: Mapping[str, float], gyro: Mapping[str, float]) -> dict[str, float]:
    """Return the coefficients of eq. (8) by eq. (5), from identified parts.

    The delay is the sum of the two that the parts have: pedal to gyro, and servo to recorded rate.

    Args:
        base: N_r, N_ped and tau_r_base by name, SI.
        gyro: k_p, k_I, k_delta, k_a and tau_PED by name, SI.
    """
    n_r, n_ped = base["N_r"], base["N_ped"]
    k_p, k_i = gyro["k_p"], gyro["k_I"]
    k_delta, k_a = gyro["k_delta"], gyro["k_a"]
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

    Args:
        base: parameter -> value of stage one, SI.
        gyro: parameter -> value of stage two, with what the ground tests gave, SI.
        overall: parameter -> value of stage three, SI.
        band_rad_s: in which the responses are compared.
    """
    parts = overall_from_parts(base, gyro)
    direct = {name: overall[name] for name in parts}
    omega = np.geomspace(*band_rad_s, _POINTS)
    each = [response(structures.yaw_overall, values, omega)[0, 0] for values in (parts, direct)]
    gap = np.asarray(np.log(each[0] / each[1]), dtype=np.complex128)
    gain, phase = DB_PER_NEPER * gap.real, np.degrees(gap.imag)
    worst, latest = int(np.argmax(np.abs(gain))), int(np.argmax(np.abs(phase)))
    published = jr700.YAW_OVERALL
    return OverallCheck(
        coefficients=tuple(
            Coefficient(
                name=name,
                unit=published[name].unit,
                paper=published[name].value,
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
