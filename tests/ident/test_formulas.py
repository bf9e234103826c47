"""The identification's formulas a second time, in plain sums and loops.

What differs is rounding, unless a test says otherwise.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import detrend

from helisim.ident import frequency_response, structures, verify
from helisim.ident.bounds import accuracy
from helisim.ident.cost import Cost, select
from helisim.ident.evaluate import response
from helisim.ident.windows import OVERLAP, cross_spectra, random_error
from helisim.records.record import FlightRecord
from ident_data import YAW, fitted, record

GRID = np.geomspace(0.5, 25.0, 70)
ROLLPITCH = structures.rollpitch
TRUE = {
    **{"L_b": 536.0, "M_a": 313.0, "tau_f": 0.045, "A_b": 0.9, "B_a": -0.5, "A_lat": 0.1},
    **{"A_lon": -0.4, "B_lat": 0.2, "B_lon": 0.1, "tau_lat": 0.012, "tau_lon": -0.008},
}


def flight(seed, *, samples=900, step=0.02, names=("lat", "lon", "p")):
    random = np.random.default_rng(seed)
    columns = random.normal(size=(samples, len(names))).cumsum(axis=0) * 0.1
    return record(step, **dict(zip(names, columns.T)))


def test_cross_spectra_are_sums_over_windows():
    """Detrended, faded, Hann windows hanging over both ends, (2/T) mean of A B* / 0.375."""
    records, names = [flight(1), flight(2, samples=700)], ["lat", "p"]
    frequency, window = np.array([1.1, 3.0, 7.7]), 6.0
    found = cross_spectra(records, names, frequency, window)
    total, power, shared = 0.0, 0.0, 0.0
    for one in records:
        step, samples, length = one.sample_time, len(one), 300
        ramp = min(2.0 * math.pi / (frequency[0] * step), 0.05 * samples)
        ends = np.minimum(np.arange(samples), np.arange(samples)[::-1]) + 0.5
        fade = np.where(ends < ramp, np.sin(0.5 * np.pi * ends / ramp) ** 2, 1.0)
        signals = detrend(one.select(names), axis=0) * fade[:, None]
        hop = length * (1.0 - OVERLAP)
        count = math.ceil((samples + length - 2.0 * hop) / hop) + 1
        begins = [round(x) for x in np.linspace(hop - length, samples - hop, count)]
        windows = []
        for begin in begins:
            k = np.arange(max(begin, 0), min(begin + length, samples))
            hann = np.sin(np.pi * (k - begin) / length) ** 2
            turn = np.exp(-1j * np.outer(frequency, (k - begin) * step))
            sums = turn @ (signals[k] * hann[:, None]) * step
            total = total + sums[:, :, None] * sums[:, None, :].conj()
            full = np.zeros(samples)
            full[k] = hann * fade[k]
            windows.append(full)
        gram = np.array(windows) @ np.array(windows).T / (0.375 * length)
        power, shared = power + np.trace(gram), shared + np.sum(gram**2)
    # the windows' energy is summed at 512 instants instead of at the samples: 1 %
    assert found.averages == pytest.approx(power**2 / shared, rel=1e-2)
    assert found.matrix == pytest.approx(2.0 / (window * 0.375 * power) * total, rel=1e-2)
    ratio = found.matrix / total
    assert ratio == pytest.approx(np.full_like(ratio, ratio[0, 0, 0]), rel=1e-9)


def test_the_random_error_is_the_published_formula():
    """C_eps sqrt(1 - g2) / (|g| sqrt(2 n_d)) with C_eps^2 in the number of averages."""
    coherence = np.array([0.1, 0.6, 0.99])
    expected = np.sqrt((1.0 - coherence) / (2.0 * 7.3 * coherence))
    assert random_error(coherence, 7.3) == pytest.approx(expected, rel=1e-12)


@pytest.fixture(scope="module")
def frf():
    """Three axes' worth of windowed noise, so that coherence and scatter are ordinary."""
    random = np.random.default_rng(3)
    records = []
    for _ in range(2):
        x = random.normal(size=(3000, 2))
        y = np.array([np.convolve(x[:, k], np.exp(-np.arange(60) / 15.0))[:3000] for k in (0, 1)])
        noise = 0.4 * random.normal(size=(3000, 2))
        p, q = y[0] + 0.3 * y[1] + noise[:, 0], y[1] - 0.2 * y[0] + noise[:, 1]
        records.append(record(0.02, lat=x[:, 0], lon=x[:, 1], p=p, q=q))
    return frequency_response(records, inputs=["lat", "lon"], outputs=["p", "q"], band=(1.0, 25.0))


def chosen(frf, count=20):
    return select(frf, ROLLPITCH, band=(2.0, 20.0), responses=None, count=count)


def test_points_are_the_nearest_to_log_spaced_ones(frf):
    """Of each response the coherent points of its band nearest to 20 log-spaced targets."""
    points = chosen(frf)
    for number, name in enumerate(points.pairs):
        output, input_ = name.split("/")
        o, i = frf.outputs.index(output), frf.inputs.index(input_)
        usable = [
            k
            for k, w in enumerate(frf.frequency)
            if 2.0 <= w <= 20.0 and frf.coherence[o, i, k] >= 0.6
        ]
        place = np.log(frf.frequency[usable])
        targets = np.linspace(place[0], place[-1], 20)
        near = sorted({usable[int(np.argmin(np.abs(place - target)))] for target in targets})
        mine = points.pair == number
        assert points.frequency[mine] == pytest.approx(frf.frequency[near])
        assert points.measured[mine] == pytest.approx(frf.response[o, i, near])
        weight = 20.0 / len(near) * (1.58 * (1.0 - np.exp(-frf.coherence[o, i, near]))) ** 2
        assert points.weight[mine] == pytest.approx(weight)
        assert points.bands[number] == (frf.frequency[near[0]], frf.frequency[near[-1]])
        assert set(points.output[mine]) == {ROLLPITCH.outputs.index(output)}
        assert set(points.input[mine]) == {ROLLPITCH.inputs.index(input_)}


def vector(names):
    return np.array([TRUE.get(name, 0.1) for name in names])


def test_the_cost_is_its_formula_and_its_slopes_are_differences(frf):
    """Residuals of all three kinds, point by point, and what they become by small steps."""
    points = chosen(frf)
    cost = Cost(ROLLPITCH, points)
    names = [parameter.name for parameter in ROLLPITCH.free]
    x = vector(names)
    model = response(ROLLPITCH, dict(zip(names, x)), points.frequency)
    each = [model[o, i, k] for k, (o, i) in enumerate(zip(points.output, points.input))]
    z = np.array(each) / points.measured
    root = np.sqrt(points.weight)
    decibels, degrees = 20.0 * np.log10(np.abs(z)), np.rad2deg(np.angle(z))
    plain = np.concatenate([root * decibels, root * math.sqrt(0.01745) * degrees])
    assert cost.log(x, unwrap=False) == pytest.approx(plain, rel=1e-9)
    squares = root**2 * (decibels**2 + 0.01745 * degrees**2)
    by_response = [np.sum(squares[points.pair == k]) for k in range(len(points.pairs))]
    assert cost.per_response(x) == pytest.approx(by_response, rel=1e-9)
    scaled = 20.0 / math.log(10.0) * root * (z - 1.0)
    assert cost.relative(x) == pytest.approx([*scaled.real, *scaled.imag], rel=1e-9)
    spread = np.hypot(np.sqrt(0.5 * np.diagonal(points.covariance).real), 0.005)
    assert cost.spread == pytest.approx(spread, rel=1e-12)
    over = (z - 1.0) / spread
    assert cost.standardised(x) == pytest.approx([*over.real, *over.imag], rel=1e-9)
    for residual, jacobian in (
        (lambda x: cost.log(x, unwrap=False), cost.log_jacobian(x)),
        (cost.relative, cost.relative_jacobian(x)),
        (cost.standardised, cost.standardised_jacobian(x)),
    ):
        for k in range(x.size):
            shift = np.zeros(x.size)
            shift[k] = 1e-6 * max(abs(x[k]), 1e-2)
            slope = (residual(x + shift) - residual(x - shift)) / (2.0 * shift[k])
            # central differences: the square of the step, and rounding over the step
            assert jacobian[:, k] == pytest.approx(
                slope, rel=1e-5, abs=1e-6 * np.max(np.abs(slope))
            )


@pytest.mark.parametrize("standardised", [False, True])
def test_the_accuracy_is_its_formulas(frf, standardised):
    """CR, I, correlation from H = 2 J^T J; standard errors from the response's covariance."""
    points = chosen(frf)
    points = replace(points, gap=0.01 * np.exp(1j * points.frequency))
    cost = Cost(ROLLPITCH, points)
    x = vector([parameter.name for parameter in ROLLPITCH.free])
    found = accuracy(cost, x, standardised=standardised)
    hessian = 2.0 * cost.log_jacobian(x).T @ cost.log_jacobian(x)
    inverse = np.linalg.inv(hessian)
    root = np.sqrt(np.diag(inverse))
    # a condition number of up to 1e6, squared in H
    assert found.cramer_rao == pytest.approx(2.0 * root, rel=1e-6)
    assert found.insensitivity == pytest.approx(np.diag(hessian) ** -0.5, rel=1e-9)
    assert found.correlation == pytest.approx(inverse / np.outer(root, root), abs=1e-6)
    error = points.covariance
    stacked = 0.5 * np.block([[error.real, -error.imag], [error.imag, error.real]])
    if standardised:
        scale, jacobian = np.tile(1.0 / cost.spread, 2), cost.standardised_jacobian(x)
        residual = cost.standardised(x)
    else:
        weights = np.sqrt(points.weight) * 180.0 / np.pi * math.sqrt(0.01745)
        scale = np.concatenate([20.0 / math.log(10.0) * np.sqrt(points.weight), weights])
        jacobian, residual = cost.log_jacobian(x), cost.log(x, unwrap=False)
    covariance = scale[:, None] * stacked * scale
    gain = np.linalg.solve(jacobian.T @ jacobian, jacobian.T)
    left = np.eye(residual.size) - jacobian @ gain
    noise = np.diag(left @ covariance @ left.T)
    assert found.ratio == pytest.approx(residual @ residual / noise.sum(), rel=1e-6)
    assert found.noise == pytest.approx(noise / scale**2, rel=1e-6)
    # what the structure leaves out is alike within half of ln(frequency) in a response
    apart = np.abs(np.subtract.outer(np.log(points.frequency), np.log(points.frequency)))
    near = np.exp(-apart / 0.5) * (points.pair[:, None] == points.pair)
    alike = scale[:, None] * np.kron(np.eye(2), near) * scale
    square = (residual @ residual - noise.sum()) / np.trace(left @ alike @ left.T)
    assert square > 0.005**2  # x is no minimum
    structural = square * gain @ alike @ gain.T
    assert found.structural == pytest.approx(np.sqrt(np.diag(structural)), rel=1e-6)
    moved = gain @ (scale * np.concatenate([points.gap.real, points.gap.imag]))
    errors = np.diag(gain @ covariance @ gain.T + structural) + moved**2
    assert found.standard_error == pytest.approx(np.sqrt(errors), rel=1e-6)


def test_verification_figures_are_their_formulas():
    """J_rms and Theil's coefficient over all records, each about its own mean, and by output."""
    structure = structures.yaw_base
    fit = fitted(structure, YAW, GRID)
    names = (*structure.inputs, *structure.outputs)
    records = [flight(k, samples=400, names=names) for k in (7, 8)]
    late = FlightRecord(records[1].time + 5.0, records[1].values, records[1].channels)
    found = verify(fit, [records[0], late])
    centred = []
    for trace in found.traces:
        mean = trace.measured.mean(axis=0)
        centred.append((trace.measured - mean, trace.predicted - mean))
    measured, predicted = (np.concatenate(pair)[:, 0] for pair in zip(*centred))

    def rms(x):
        return math.sqrt(np.mean(x**2))

    theil = rms(measured - predicted) / (rms(measured) + rms(predicted))
    assert found.j_rms == pytest.approx(rms(measured - predicted), rel=1e-12)
    assert found.tic == pytest.approx(theil, rel=1e-12)
    assert dict(found.tic_by_output) == pytest.approx({"r": theil}, rel=1e-12)
    plain = found.to_dict()
    assert [one["duration_s"] for one in plain["records"]] == pytest.approx([7.98, 7.98])
    each = [rms(one.measured - one.predicted) for one in found.traces]
    assert [one["j_rms"]["r"] for one in plain["records"]] == pytest.approx(each, rel=1e-12)
    assert plain["outputs"][0]["unit"] == "rad/s"
    verdict = "acceptable" if theil <= 0.25 else "above 0.25"
    (overall,) = (line for line in str(found).splitlines() if line.startswith("all "))
    assert overall.split()[-len(verdict.split()) :] == verdict.split()
    own, quiet = (str(replace(found, quiet=some)).splitlines()[1] for some in ((), ("r",)))
    assert own.endswith("above 0.25") == (theil > 0.25)
    assert quiet.endswith("hardly moved")
    assert "hardly" not in own
