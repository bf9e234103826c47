"""Frequency responses of known models, exact or with noise, and fits of them."""

import numpy as np
from scipy.signal import lfilter

from helisim import ident
from helisim.ident import Fit, FrequencyResponse, Structure, identify
from helisim.ident.evaluate import Sensitivity, response
from helisim.records.record import FlightRecord, channel

GRID = np.geomspace(0.5, 20.0, 60)
YAW = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
HEAVE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}
ROLLPITCH = {
    "tau_f": 0.045, "L_b": 540.0, "M_a": 315.0, "A_b": -0.35, "B_a": 0.53, "A_lat": 0.066,
    "A_lon": 0.37, "B_lat": 0.38, "B_lon": -0.061, "tau_lat": 0.0115, "tau_lon": -0.0083,
}  # fmt: skip


def record(step=0.05, provenance=None, **columns):
    values = np.stack(list(columns.values()), axis=1)
    channels = tuple(map(channel, columns))
    return FlightRecord(np.arange(len(values)) * step, values, channels, provenance or {})


def heave(seed, n=3000):
    """Return a record of vertical speed, noisy, over a coloured collective."""
    rng = np.random.default_rng(seed)
    col = np.convolve(rng.standard_normal(n), np.ones(9) / 9.0, "same")
    w = lfilter([0.0, -0.4], [1.0, -0.99], col)
    return record(0.01, col=col, w=w + 0.01 * rng.standard_normal(n))


def data(found, frequency=GRID, *, inputs=("u",), outputs=("y",), noise=0.0, seed=0, **units):
    """Return a response, (n_freq,) or (n_out, n_in, n_freq), times noise of log-normal size."""
    found = np.reshape(found, (len(outputs), len(inputs), -1))
    wobble = np.random.default_rng(seed).normal(size=(2, *found.shape))
    noisy = found * np.exp(noise * (wobble[0] + 1j * wobble[1]))
    return FrequencyResponse.exact(frequency, noisy, inputs=inputs, outputs=outputs, **units)


def of_model(structure: Structure, values, frequency=GRID, **options) -> FrequencyResponse:
    found = response(structure, values, frequency)
    names = {"inputs": structure.inputs, "outputs": structure.outputs}
    return data(found, frequency, **names, **options)


def fitted(structure: Structure, values, frequency=GRID, *, noise=0.0, seed=0, **options) -> Fit:
    frf = of_model(structure, values, frequency, noise=noise, seed=seed)
    return identify(frf, structure, **options)


def slopes(structure: Structure, values, frequency, names=None, step=1e-6):
    """Return the response's derivatives by central differences, (n_name, n_out, n_in, n_freq)."""
    found = []
    for name in names or [one.name for one in structure.free]:
        size = step * max(abs(values[name]), 1e-2)
        ends = (
            response(structure, {**values, name: values[name] + sign * size}, frequency)
            for sign in (1.0, -1.0)
        )
        found.append(-np.diff(list(ends), axis=0)[0] / (2.0 * size))
    return np.array(found)


def response_and_slope(structure: Structure, values, frequency):
    """Return the response, (n_out, n_in, n_freq), and its exact derivatives by the free ones."""
    shape = (len(structure.outputs), len(structure.inputs), frequency.size)
    output, input_, position = np.indices(shape).reshape(3, -1)
    points = Sensitivity(structure.program, frequency[position], output, input_)
    there = points.at(structure.program.ordered(values))
    return there.response.reshape(shape), there.slope().reshape(-1, *shape)


OMEGA = np.geomspace(1.0, 60.0, 40)
SERVO = ident.blocks.second_order("servo", omega=200.0, zeta=1.0)
SERVOS = {"lat": SERVO, "lon": SERVO}
SERVOED = ident.in_series(ident.structures.rollpitch_speeds, inputs=SERVOS)
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
