"""Fits of exact responses: models whose parameters are known."""

import numpy as np

from helisim import ident

OMEGA = np.geomspace(1.0, 60.0, 40)
SERVO = ident.blocks.second_order("servo", omega=200.0, zeta=1.0)
ROLLPITCH = ident.in_series(ident.structures.rollpitch_speeds, inputs={"lat": SERVO, "lon": SERVO})
ROLL = {
    **{"tau_f": 0.045, "L_b": 540.0, "M_a": 315.0, "A_b": -0.35, "B_a": 0.53, "A_lat": 0.066},
    **{"A_lon": 0.37, "B_lat": 0.38, "B_lon": -0.06, "A_u": 1.1e-3, "A_v": -5e-3},
    **{"L_p": -0.02, "M_q": -0.02},
}
"""The JR700's, about, but for its delays."""


def found(structure: ident.Structure, **values: float) -> ident.Fit:
    """Return a fit that found the values, for nothing else was free."""
    known = structure.with_fixed(values)
    at = ident.evaluate.response(known, known.starts, OMEGA)
    names = {"inputs": structure.inputs, "outputs": structure.outputs}
    exact = ident.FrequencyResponse.exact(OMEGA, at, **names)
    return ident.identify(exact, known)
