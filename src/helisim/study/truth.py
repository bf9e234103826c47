"""Exact responses and true parameters of a vehicle, as means over the air that it met."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim import ident
from helisim.base.linear import responses
from helisim.design.exact import Air
from helisim.sim import Recorder
from helisim.study.models import ModelSpec
from helisim.vehicle import Linearization, Vehicle

_GAINS = ("k_p", "k_I", "k_delta", "k_a")
_DELAYS = {
    "tau_r_base": ("ped", "r"),
    "tau_lat": ("lat", "p"),
    "tau_lon": ("lon", "q"),
    "tau_col": ("col", "w"),
}  # delay -> servo command and motion that it lies between


def mean_derivatives(air: Air) -> dict[str, float]:
    """Return the mean of the stability and control derivatives over the air met, by name."""
    return {
        name: sum(share * there.derivatives[name] for share, there in air)
        for name in air[0][1].derivatives
    }


def true_values(
    vehicle: Vehicle,
    model: ModelSpec,
    recorder: Recorder,
    *,
    like: ident.FrequencyResponse | None = None,
    air: Air | None = None,
) -> dict[str, float]:
    """Return a model's true parameters by the exact linearisation, the mean over `air` if given.

    Delays are the recorder's latencies and the servos' equivalent delay; with servos in the
    structure, half the period of their commands replaces the latter. The truth of a low-order
    equivalent is the structure fitted to the exact response, weighted as the estimate `like`.
    """
    air = air or ((1.0, vehicle),)
    true, own = mean_derivatives(air), vehicle.parameters
    if model.truth_kind == "gyro":
        gains = {name: own[f"gyro.{name.lower()}"] for name in _GAINS}
        # the tail's thrust moves the helicopter sideways by Y_ped/N_ped of what it turns it
        slip = true["N_r"] + true["N_v"] * true["Y_ped"] / true["N_ped"]
        return {**gains, "tau_PED": own["gyro.ped_latency"], "N_r_slip": slip}
    if model.truth_kind == "equivalent":
        return _equivalent_values(air, model, recorder, like)
    for name, (axis, motion) in _DELAYS.items():
        servo = (0.5 * own["gyro.period"]) if model.servos_known else vehicle.servo_delay(axis)
        true[name] = servo + recorder.late(motion) - recorder.late(axis)
    true |= {f"A_{way}": true[f"Q_{way}"] * true["tau_f"] for way in "uv"}
    if "L_p" in model.structure.names:  # what opposes roll and pitch beside the tilted rotor
        for name, rate in (("L_p", "p"), ("M_q", "q")):
            dampings = (
                share * there.linearize("IN1").derivative(rate, rate) for share, there in air
            )
            true[name] = sum(dampings, 0.0)
    return true


def _equivalent_values(
    air: Air, model: ModelSpec, recorder: Recorder, like: ident.FrequencyResponse | None
) -> dict[str, float]:
    omega = np.geomspace(*model.band, 200) if like is None else like.frequency
    each = [exact_response(there, model, recorder, omega) for _, there in air]
    mean = np.array(sum(share * one.response for (share, _), one in zip(air, each)))
    coherence = each[0].coherence if like is None else like.coherence
    exact = replace(each[0], response=mean, coherence=coherence)
    return dict(ident.identify(exact, model.structure, weighting=model.weighting).values)


def exact_response(
    vehicle: Vehicle, model: ModelSpec, recorder: Recorder, omega: NDArray[np.float64]
) -> ident.FrequencyResponse:
    """Return the exact response of a model's channels at omega, (n_freq,) rad/s, with latencies.

    With a reference it is the joint input-output method's limit: conditioning channels are held.
    """
    linear = vehicle.linearize("IN2" if model.reference or model.input == "IN2" else "IN1")
    driving = model.reference or model.inputs
    response = _recorded(linear, model.outputs, driving, recorder, omega)
    if model.reference:
        driven = _recorded(linear, (*model.inputs, *model.conditioning), driving, recorder, omega)
        # H U = Y at each frequency, axes (outputs, inputs, frequencies)
        response = np.linalg.solve(driven.T, response.T).T[:, : len(model.inputs)]
    else:
        delays = np.array([recorder.late(name) for name in model.inputs])
        response = response * np.exp(1j * delays[None, :, None] * omega)
    return ident.FrequencyResponse.exact(
        omega, response, inputs=model.inputs, outputs=model.outputs
    )


def _recorded(
    linear: Linearization,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    recorder: Recorder,
    omega: NDArray[np.float64],
) -> NDArray[np.complex128]:
    delays = np.array([recorder.late(name) for name in outputs])
    return responses(linear, omega, outputs, inputs) * np.exp(-1j * delays[:, None, None] * omega)
