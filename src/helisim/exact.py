"""What an identification must find: the exact responses of a vehicle, and its true parameters."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim import ident
from helisim.experiment import Model
from helisim.sim import Recorder
from helisim.vehicle import Vehicle

_GAINS = ("k_p", "k_I", "k_delta", "k_a")


def true_values(
    vehicle: Vehicle,
    model: Model,
    recorder: Recorder,
    *,
    like: ident.FrequencyResponse | None = None,
) -> dict[str, float]:
    """Return the true parameters of a model from the exact linearisation of the vehicle.

    Delays are the servos' equivalent delay and the recorder's latencies. A low-order equivalent
    has no parameters of its own in the vehicle: its truth is the structure fitted to the exact
    frequency response.

    Args:
        vehicle: that flew.
        model: what was identified.
        recorder: that recorded.
        like: of an equivalent, the estimate at whose frequencies, and with whose coherences as
            weights, the exact response is fitted too; evenly over the band if None.
    """
    if model.truth == "gyro":
        return _gyro_values(vehicle)
    if model.truth == "equivalent":
        return _equivalent_values(vehicle, model, recorder, like)
    late = recorder.latency
    true = dict(vehicle.derivatives)
    for delay, axis, motion in (
        ("tau_r_base", "ped", "r"),
        ("tau_lat", "lat", "p"),
        ("tau_lon", "lon", "q"),
        ("tau_col", "col", "w"),
    ):
        true[delay] = vehicle.servo_delay(axis) + late.get(motion, 0.0) - late.get(axis, 0.0)
    return true


def _gyro_values(vehicle: Vehicle) -> dict[str, float]:
    gains = {name: vehicle.parameters[f"gyro.{name.lower()}"] for name in _GAINS}
    base = vehicle.derivatives
    # the tail's thrust moves the helicopter sideways by Y_ped/N_ped of what it turns it
    slip = base["N_r"] + base["N_v"] * base["Y_ped"] / base["N_ped"]
    return {**gains, "tau_PED": vehicle.parameters["gyro.ped_latency"], "N_r_slip": slip}


def _equivalent_values(
    vehicle: Vehicle, model: Model, recorder: Recorder, like: ident.FrequencyResponse | None
) -> dict[str, float]:
    omega = np.geomspace(*model.band, 200) if like is None else like.frequency
    exact = exact_response(vehicle, model, recorder, omega)
    if like is not None:
        exact = replace(exact, coherence=like.coherence)
    return dict(ident.identify(exact, model.structure, weighting=model.weighting).values)


def exact_response(
    vehicle: Vehicle, model: Model, recorder: Recorder, omega: NDArray[np.float64]
) -> ident.FrequencyResponse:
    """Return the exact response of a model's channels, recorder latencies included."""
    linear = vehicle.linearize("IN2" if model.input == "IN2" else "IN1")
    rows = [linear.system.output_labels.index(name) for name in model.outputs]
    columns = [linear.system.input_labels.index(name) for name in model.inputs]
    response = linear.response(omega)[np.ix_(rows, columns)]
    for i, output in enumerate(model.outputs):
        for j, input_ in enumerate(model.inputs):
            late = recorder.latency.get(output, 0.0) - recorder.latency.get(input_, 0.0)
            response[i, j] *= np.exp(-1j * omega * late)
    return ident.FrequencyResponse.exact(
        omega, response, inputs=model.inputs, outputs=model.outputs
    )
