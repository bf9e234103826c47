"""What an identification must find: the exact responses of a vehicle, and its true parameters.

Slow gusts move the point that is linearised about: a helicopter that holds its place in them
flies forwards, sideways, up and down through the air. What is to be found then is the mean over
that air, not the hover in calm air.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from helisim import ident
from helisim.design.exact import Air
from helisim.sim import Recorder
from helisim.study.models import ModelSpec
from helisim.vehicle import Linearization, Vehicle

_GAINS = ("k_p", "k_I", "k_delta", "k_a")


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
    """Return the true parameters of a model from the exact linearisation of the vehicle.

    Delays are the recorder's latencies and the servos' equivalent delay, of which half the period
    of their commands is left where the servos are in the structure. A low-order equivalent
    has no parameters of its own in the vehicle: its truth is the structure fitted to the exact
    frequency response.

    Args:
        vehicle: that flew.
        model: what was identified.
        recorder: that recorded.
        like: of an equivalent, the estimate at whose frequencies, and with whose coherences as
            weights, the exact response is fitted too; evenly over the band if None.
        air: of `air_met`, over which the truth is the mean; the vehicle's own trim if None.
    """
    air = air or ((1.0, vehicle),)
    if model.truth_kind == "gyro":
        return _gyro_values(vehicle, mean_derivatives(air))
    if model.truth_kind == "equivalent":
        return _equivalent_values(air, model, recorder, like)
    late = recorder.late
    true = mean_derivatives(air)
    for delay, axis, motion in (
        ("tau_r_base", "ped", "r"),
        ("tau_lat", "lat", "p"),
        ("tau_lon", "lon", "q"),
        ("tau_col", "col", "w"),
    ):
        held = 0.5 * vehicle.parameters["gyro.period"]
        servo = held if model.servos_known else vehicle.servo_delay(axis)
        true[delay] = servo + late(motion) - late(axis)
    true["A_u"] = true["Q_u"] * true["tau_f"]
    if "L_p" in model.structure.names:
        true |= _dampings(air)
    return true


def _dampings(air: Air) -> dict[str, float]:
    """Return what opposes roll and pitch beside the tilted rotor, the mean over the air met."""
    mean = {"L_p": 0.0, "M_q": 0.0}
    for share, there in air:
        system = there.linearize("IN1").system
        for name, rate in (("L_p", "p"), ("M_q", "q")):
            place = system.state_labels.index(rate)
            mean[name] += share * float(np.asarray(system.A)[place, place])
    return mean


def _gyro_values(vehicle: Vehicle, base: dict[str, float]) -> dict[str, float]:
    gains = {name: vehicle.parameters[f"gyro.{name.lower()}"] for name in _GAINS}
    # the tail's thrust moves the helicopter sideways by Y_ped/N_ped of what it turns it
    slip = base["N_r"] + base["N_v"] * base["Y_ped"] / base["N_ped"]
    return {**gains, "tau_PED": vehicle.parameters["gyro.ped_latency"], "N_r_slip": slip}


def _equivalent_values(
    air: Air, model: ModelSpec, recorder: Recorder, like: ident.FrequencyResponse | None
) -> dict[str, float]:
    omega = np.geomspace(*model.band, 200) if like is None else like.frequency
    each = [exact_response(there, model, recorder, omega) for _, there in air]
    mean = np.array(sum(share * one.response for (share, _), one in zip(air, each)))
    exact = replace(each[0], response=mean)
    if like is not None:
        exact = replace(exact, coherence=like.coherence)
    return dict(ident.identify(exact, model.structure, weighting=model.weighting).values)


def exact_response(
    vehicle: Vehicle, model: ModelSpec, recorder: Recorder, omega: NDArray[np.float64]
) -> ident.FrequencyResponse:
    """Return the exact response of a model's channels, recorder latencies included.

    It is what the estimate tends to. With a reference, that is the joint input-output method's:
    the sticks drive the closed loop, and outputs over inputs have the conditioning channels held.

    Args:
        vehicle: that flies.
        model: whose inputs and outputs the response has.
        recorder: whose latencies are in it.
        omega: (n_freq,) rad/s.
    """
    if model.reference:
        linear, given = vehicle.linearize("IN2"), (*model.inputs, *model.conditioning)
        driven = _recorded(linear, given, model.reference, recorder, omega)
        answer = _recorded(linear, model.outputs, model.reference, recorder, omega)
        # H U = Y at each frequency, axes (outputs, inputs, frequencies)
        response = np.linalg.solve(driven.T, answer.T).T[:, : len(model.inputs)]
    else:
        linear = vehicle.linearize("IN2" if model.input == "IN2" else "IN1")
        late = np.array([recorder.late(name) for name in model.inputs])
        response = _recorded(linear, model.outputs, model.inputs, recorder, omega)
        response = response * np.exp(1j * late[None, :, None] * omega)
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
    """Return the response of outputs, as late as they are recorded, (n_out, n_in, n_freq)."""
    rows = [linear.system.output_labels.index(name) for name in outputs]
    columns = [linear.system.input_labels.index(name) for name in inputs]
    late = np.array([recorder.late(name) for name in outputs])
    response = linear.response(omega)[np.ix_(rows, columns)]
    return response * np.exp(-1j * late[:, None, None] * omega)
