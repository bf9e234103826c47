"""Laws of the identification restated in plain loops, on random numbers.

What differs is rounding, unless a test says otherwise.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import eigh
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import f as fisher

from helisim.base.errors import IdentificationError
from helisim.ident import Parameter, Structure, in_series, local, local_fit, rational, structures
from helisim.ident.blocks import second_order
from helisim.ident.cost import Cost, select
from helisim.ident.diagnosis import Residual, degenerate, doubt, shape
from helisim.ident.evaluate import response
from helisim.ident.local import WIDTHS, Bands, Local, Task, choose, smoothed
from helisim.ident.local_fit import Lines, fit_band
from helisim.ident.modes import uncancelled
from helisim.ident.rational import delay_grid, rational_fits
from helisim.ident.scatter import hann_lobe
from helisim.ident.search import (
    Delays,
    Minimum,
    Start,
    agreed,
    beside,
    linear_parameters,
    scattered,
    search,
    starting_points,
)
from helisim.ident.structures import transfer_function
from helisim.ident.windows import Windows, compose, condition, cross_spectra
from helisim.records.record import Channel, FlightRecord
from ident_data import of_model, record
from tabled import tabled


def numbers(random, *shape):
    return random.normal(size=shape) + 1j * random.normal(size=shape)


def test_a_gaussian_mean_is_over_the_logarithm_of_the_frequency():
    random, frequency = np.random.default_rng(0), np.geomspace(1.0, 5.0, 9)
    values, weight = numbers(random, 2, 9), np.array([0.0, 2.0, *random.uniform(size=7)])
    near = [[np.exp(-0.5 * (np.log(a / b) / 0.3) ** 2) for a in frequency] for b in frequency]
    expected = [[sum(x * weight * row) / sum(weight * row) for row in near] for x in values]
    assert smoothed(values, frequency, weight, 0.3) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("power", [1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("first", [0, 3])
def test_the_weight_of_each_width_is_its_law(power, first):
    """Shares by inverse squares of variance plus squared bias, itself by the gap to the narrower.

    Widths are the method's own from 0.06 or 0.48; at some frequencies some are unusable.
    """
    random, n, widths = np.random.default_rng(first), 12, WIDTHS[first : first + 4]
    frequency, level = np.geomspace(1.0, 4.0, n), power * random.uniform(0.5, 2.0, (2, n))
    gain = 1.0 + 0.1 * numbers(random, 4, 2, 1, n) * np.arange(1.0, 5.0)[:, None, None, None] ** 2
    root = random.normal(size=(n, 4, 6))
    shared = np.moveaxis(root @ root.swapaxes(1, 2), 0, 2)[:, :, None, :]
    valid = np.ones((4, n), dtype=bool)
    valid[0, :5], valid[1, :2], valid[2:, 0], valid[2, 8] = False, False, False, False
    valid[3, 0] = True
    share, bias, spread = choose(gain, shared, level, valid, widths, frequency, widest=1.0)
    at = np.log(frequency)
    for o in range(2):
        squares = np.zeros((2, 4, n))  # the likely bias, and the sure one
        for width in range(4):
            gap, chance, law, counted = np.zeros(n), np.zeros(n), np.ones(n), np.zeros(n, bool)
            for k in range(n):
                narrower = [one for one in range(width) if valid[one, k]]
                if not (narrower and valid[width, k]):
                    continue
                counted[k], b = True, narrower[-1]
                size = np.abs(gain[np.flatnonzero(valid[:, k])[0], o, 0, k])
                gap[k] = np.abs(gain[width, o, 0, k] - gain[b, o, 0, k]) ** 2 / size**2
                s = shared[:, :, 0, k]
                chance[k] = (s[width, width] + s[b, b] - 2.0 * s[width, b]) * level[o, k] / size**2
                law[k] = 1.0 - (widths[b] / widths[width]) ** 4
            known = np.where(counted, 1.0 / (chance + 0.005**2) ** 2, 0.0)
            for k in np.flatnonzero(counted):
                near = known * np.exp(-0.5 * ((at - at[k]) / (0.5 * widths[width])) ** 2)
                size = np.abs(gain[np.flatnonzero(valid[:, k])[0], o, 0, k])
                excess = np.sum(near * (gap - chance)) / np.sum(near)
                doubt = 0.5 * np.sum(near * chance) / np.sum(near)
                for found, value in zip(squares, (excess, excess - doubt)):
                    found[width, k] = max(value, 0.0) / law[k] ** 2 * size**2
        for k in range(n):
            usable = np.flatnonzero(valid[:, k])
            low = usable[0]
            for found in squares:
                found[:, k] = np.maximum.accumulate(found[:, k])
                behind = min(low + 1, 3)
                law = 1.0 if widths[low] > 0.5 else (widths[low] / widths[behind]) ** 8
                found[:, k] = found[:, k] + law * found[behind, k]
            own = np.diagonal(shared[:, :, 0, k])
            offered = [one for one in usable if widths[one] <= 1.0 or one == low]
            error = {one: own[one] * level[o, k] + squares[0, one, k] for one in offered}
            part = {one: error[one] ** -2.0 for one in offered}
            part = {one: x for one, x in part.items() if x >= 0.05 * sum(part.values())}
            expected = [part.get(one, 0.0) / sum(part.values()) for one in range(4)]
            assert share[:, o, 0, k] == pytest.approx(expected)
            mean = np.dot(expected, gain[:, o, 0, k])
            apart = np.dot(expected, np.abs(gain[:, o, 0, k] - mean) ** 2)
            assert spread[o, 0, k] == pytest.approx(np.sqrt(apart))
            sure = np.sqrt(np.dot(expected, squares[1, :, k]))
            alone = usable.size == 1 and widths[low] > 1.0
            assert bias[o, 0, k] == pytest.approx(max(sure, abs(mean)) if alone else sure)


@pytest.mark.parametrize("transient", [False, True])
def test_a_band_is_fitted_by_weighted_least_squares(transient):
    """Lines one by one under Epanechnikov's kernel; the rest's freedom is the hat matrix's."""
    random, spacing, count = np.random.default_rng(1), np.array([0.02, 0.03]), np.array([200, 90])
    made = Lines(("u", "y", "v", "z"), spacing, count, numbers(random, 2, 200, 4))
    frequency = np.array([0.5, 1.3, 2.5])
    half = np.array([0.3, 1.0, 0.75])
    fit = fit_band(made, [0, 2], [1, 3], frequency, half, transient=transient, poles=False)
    for f, middle in enumerate(frequency):
        rows, right, weight = [], [], []
        for flight in range(2):
            for line in range(1, count[flight]):
                omega = line * spacing[flight]
                inside = 1.0 - ((omega - middle) / half[f]) ** 2
                if inside < -1e-9:
                    continue
                u = made.values[flight, line, [0, 2]]
                terms = np.log(omega / middle) ** np.arange(3)
                start = np.zeros((2, 3))
                start[flight] = omega ** np.arange(-1.0, 2.0)
                rows.append([*np.outer(terms, u).ravel(), *start.ravel() * transient])
                right.append(made.values[flight, line, [1, 3]])
                weight.append(max(inside, 0.0))
        root = np.sqrt(weight)[:, None]
        design, right = root * np.array(rows), root * np.array(right)
        used = design[:, np.any(design != 0.0, axis=0)]
        solution = np.linalg.lstsq(used, right)[0]
        assert fit.gain[f] == pytest.approx(solution[:2].T, rel=1e-7)
        left = right - used @ solution
        free = np.dot(weight, 1.0 - np.diagonal(used @ np.linalg.pinv(used)).real)
        assert fit.freedom[f] == pytest.approx(free)
        assert fit.residual[f] == pytest.approx(left.T @ left.conj() / free)


@pytest.mark.parametrize("place", [0.3 + 0.4j, -0.2 - 0.3j, 0.8 + 0.2j])
def test_a_pole_is_the_best_one_under_noise(place):
    """No neighbour leaves less: those a tenth of its distance away, with all else fitted anew."""
    random, spacing = np.random.default_rng(4), 0.01
    omega = spacing * np.arange(260)
    offset = (omega - 1.5) / 0.6
    u = numbers(random, 260)
    y = u / (1.0 - offset / place) + 0.02 * numbers(random, 260)
    made = Lines(("u", "y"), np.array([spacing]), np.array([260]), np.stack([u, y], 1)[None])
    fit = fit_band(made, [0], [1], np.array([1.5]), np.array([0.6]), transient=False)
    inside = np.abs(offset) < 1.0
    root = np.sqrt(1.0 - offset[inside] ** 2)

    def left(pole):
        over = 1.0 / (1.0 - offset[inside] / pole)
        terms = np.log(omega[inside, None] / 1.5) ** np.arange(3)
        design = (root * over * u[inside])[:, None] * terms
        solution, (square,), *_ = np.linalg.lstsq(design, root * y[inside])
        return square, solution[0]

    square = fit.residual[0, 0, 0].real * fit.freedom[0]
    turns = 0.1 * np.exp(0.25j * np.pi * np.arange(8))
    assert all(square < left(place * (1.0 + turn))[0] for turn in turns)
    # one step of Gauss and Newton's from a start that noise of 2 % biases little
    assert square <= 1.02 * left(place)[0]
    # the estimate's own deviation: 0.02 over the root of some 80 lines, three of it
    assert fit.gain[0, 0, 0] == pytest.approx(1.0, abs=0.01)


def test_a_windows_lobe_is_its_fourier_integral():
    """To four bins, where 0.0014 % of the power is left; zero beyond."""
    length = 3.0
    bins = np.array([0.0, 0.4, 1.0, -1.0, 1.7, -3.9, 4.3])
    offset = bins * 2.0 * np.pi / length
    found, _ = quad_vec(
        lambda t: np.cos(np.pi * t / length) ** 2 * np.cos(offset * t), -0.5 * length, 0.5 * length
    )
    assert hann_lobe(offset, length) == pytest.approx(np.where(bins > 4.0, 0.0, found), abs=1e-9)


def lagging(inputs, outputs):
    """Return x' = -a x + K u + 2 v seen as y = x and z = 3 x."""
    return Structure(
        name="late",
        parameters=(
            Parameter("K", "1", 1.0),
            *(Parameter(name, "s", 0.0, (-0.1, 0.4)) for name in ("early", "after")),
            Parameter("a", "1/s", 2.0, fixed=True),
        ),
        states=("x",),
        inputs=("u", "v"),
        outputs=("y", "z"),
        F=(("-a",),),
        G=(("K", "2"),),
        H0=(("1",), ("3",)),
        input_delays=inputs,
        output_delays=outputs,
    )


@pytest.mark.parametrize(
    ("inputs", "outputs"), [({"v": "early"}, {"z": "2*after"}), ({"u": "early", "v": "after"}, {})]
)
def test_a_scan_finds_the_delays_of_its_grid(inputs, outputs):
    structure, frequency = lagging(inputs, outputs), np.geomspace(0.5, 20.0, 60)
    values = {"K": 5.0, "early": 0.1, "after": 0.225, "a": 2.0}  # steps of half a radian at 20
    frf = of_model(structure, values, frequency)
    points = select(frf, structure, band=None, responses=None, count=60)
    cost = Cost(structure, points)
    delays, place = Delays(cost), [one.name for one in structure.free]
    assert [place[k] for k in delays.index] == ["early", "after"]
    assert delays.apart == pytest.approx([0.025, 0.025])
    for grid in delays.grids:
        assert grid == pytest.approx(np.linspace(-0.1, 0.4, 21))
    found = delays.scan(np.array([1.0, 0.0, 0.3]), np.array([0]))
    assert found == pytest.approx([1.0, 0.1, 0.225])
    taken = delays.scan(np.array([1.0, 0.0, 0.3]), np.array([0]), [found[1:]])
    assert np.max(np.abs(taken[1:] - found[1:])) == pytest.approx(0.025)
    assert not delays.differ(found[1:], found[1:] + np.array([0.02, 0.024]))
    assert delays.differ(found[1:], found[1:] - np.array([0.0, 0.025]))
    both = beside(cost, np.array([1.0, 0.1, 0.225]))  # four steps off, with the best gain there
    expected = np.array([[0.0, 0.125], [0.2, 0.325]])
    assert np.array([one.delays for one in both]) == pytest.approx(expected)
    for one in both:
        slope = cost.relative_jacobian(one.x)[:, 0] @ cost.relative(one.x)
        assert slope == pytest.approx(0.0, abs=1e-6)


def test_scattered_starts_are_lognormal_about_their_own_or_normal_about_zero():
    """A fifth of those without bounds has the other sign; of 4000 draws, to four deviations."""
    free, random = structures.rollpitch.free, np.random.default_rng(0)
    start, size = (np.array([getattr(one, k) for one in free]) for k in ("start", "magnitude"))
    draws = np.array([scattered(structures.rollpitch, random, 0.2) for _ in range(4000)])
    known = start != 0.0
    shift, ratio = draws[:, ~known] / size[~known], draws[:, known] / start[known]
    assert np.std(shift, axis=0) == pytest.approx(np.ones(6), abs=0.045)
    assert np.std(np.log(np.abs(ratio)), axis=0) == pytest.approx(np.full(5, 0.7), abs=0.032)
    share = [0.0 if one.bounds else 0.2 for one in free if one.start]
    assert np.mean(ratio < 0.0, axis=0) == pytest.approx(share, abs=0.026)


@pytest.mark.parametrize(("fixed", "count"), [(False, 7), (True, 3)])
def test_starts_of_a_transfer_function_are_rational_fits_then_scattered(fixed, count):
    structure = transfer_function(zeros=0, poles=2, input="u", output="y")
    values = {"b0": 30.0, "a1": 3.0, "a0": 25.0, "tau": 0.05}
    frf = of_model(structure, values)
    structure = structure.with_fixed({"tau": 0.05}) if fixed else structure
    cost = Cost(structure, select(frf, structure, band=None, responses=None, count=20))
    starts, again, other = (list(starting_points(cost, count, seed)) for seed in (0, 0, 1))
    assert starts[0].x == pytest.approx([values[name] for name in cost.names], rel=1e-6)
    assert len(starts) == count
    assert [one.chosen for one in starts] == [True] * (count - 2) + [False] * 2
    grid = delay_grid(cost.points.frequency, *structure.parameter("tau").limits)
    for one, same in zip(starts, again):
        assert np.array_equal(one.x, same.x)
        assert one.delays.size == (0 if fixed else 1)
        assert all(np.min(np.abs(grid - delay)) < 1e-9 for delay in one.delays)
        assert np.all((one.x >= cost.limits[0]) & (one.x <= cost.limits[1]))
    assert not np.allclose(starts[-1].x, other[-1].x)


EDGED = np.geomspace(1.0, 20.0, 41)
FIRST = np.arange(41) < 14
OFF = 1.5 * np.exp(0.4j)
LOW = "cost is at the band's lower edge, outside 2.85 to 20 rad/s"


@tabled("ratio", "coherence", "told", "band")
def test_the_shape_of_an_error_tells_its_cause(ratio, coherence, told, band):
    note = shape("y/u", EDGED, ratio, np.full(41, coherence))
    assert (note is None) == (told is None)
    assert note is None or told in note.text
    assert band in (None, *(one.value for one in (note.remedy if note else ())))


def test_windows_that_see_inputs_move_together_are_weighed_by_the_pseudo_inverse():
    """H = Y pinv(U), U seen through the references; the rest is what least squares leaves.

    One input follows the other late, and both are disturbed: their coherence is complex.
    """
    random = np.random.default_rng(2)
    stick, pedal, gust = random.standard_normal((3, 700))
    lat = stick + 0.3 * np.roll(stick, 2) + 0.2 * np.roll(gust, 1)
    lon = np.roll(stick, 5) + 0.3 * pedal
    p, q = np.roll(lat, 2) - 2.0 * lon + gust, lon + 0.5 * gust
    flown = record(LAT=stick, LON=pedal, lat=lat, lon=lon, p=p, q=q)
    names, frequency = ("LAT", "LON", "lat", "lon", "p", "q"), np.array([1.0, 3.0, 8.0])
    spectra = cross_spectra([flown, flown.slice(0.0, 20.0)], names, frequency, 6.0)
    with pytest.raises(IdentificationError, match="inputs are fully coherent"):
        condition(spectra, ["lat"], ["p"], others=["lat"])
    u, r, y = (spectra.windowed(names[k : k + 2]) for k in (2, 0, 4))
    for reference, seen in (((), u), (names[:2], u @ np.linalg.pinv(r) @ r)):
        inverse = np.linalg.pinv(seen)
        h = y @ inverse
        told, left = (spectra.scale * np.sum(np.abs(x) ** 2, 2).T for x in (h @ seen, y - h @ u))
        own = (spectra.scale / np.sum(np.abs(inverse) ** 2, axis=1)).T
        for count in (2, 1):
            found = condition(
                spectra, names[2 : 2 + count], ["p", "q"], names[2 + count : 4], reference
            )
            gain = np.moveaxis(h[:, :, :count], 0, 2)
            assert found.weight == pytest.approx(inverse.swapaxes(1, 2)[:, :count])
            assert found.gxx == pytest.approx(np.tile(own[:count], (2, 1, 1)))
            assert found.gxy == pytest.approx(gain * found.gxx)
            assert found.gyy == pytest.approx(np.abs(gain) ** 2 * found.gxx + left[:, None])
            assert found.multiple == pytest.approx(told / (told + left))


def test_stated_errors_are_the_scatter_of_many_disturbances():
    random, draws, omega = np.random.default_rng(5), 200, np.array([2.0, 2.2, 5.0])
    lat, own, *gusts = random.standard_normal((2 + draws, 1200))
    lon = np.roll(lat, 6) + 0.5 * own
    late = np.roll(gusts, 2, axis=1)
    values = np.stack([lat, lon, *(lat - lon + gust for gust in (*gusts, *late))], axis=1)
    names = ("lat", "lon", *(f"y{k}" for k in range(2 * draws)))
    channels = tuple(Channel(name, "1", "OTHER", "") for name in names)
    flown = FlightRecord(0.05 * np.arange(1200), values, channels, {})
    found = Windows([flown], names, omega, (15.0, 10.0)).estimate(names[:2], names[2:])
    o, i, w = np.indices((2, 2, 3)).reshape(3, -1)
    each = found.response.reshape(2, draws, 2, 3).swapaxes(0, 1)[:, o, i, w] - (1.0 - 2.0 * i)
    measured = each.T @ each.conj() / draws
    noise = np.diagonal(found.scatter.noise, axis1=1, axis2=2).real.mean(axis=1)
    assert noise == pytest.approx(np.full(3, 0.1), rel=0.1)  # two inputs take a fifth of it
    turn = np.exp(0.1j * omega)  # of two samples, 0.1 s; each gust's spectrum is 2 x 0.05
    both = np.moveaxis(np.array([[turn**0, turn], [1.0 / turn, turn**0]]), 2, 0)
    known = {"noise": 0.1 * np.kron(both, np.eye(draws)), "bias": np.zeros((2 * draws, 2, 3))}
    model = replace(found.scatter, **known)
    some = range(0, draws, 20)
    stated = np.mean([model.covariance(draws * o + k, i, w) for k in some], axis=0)
    size = np.sqrt(np.outer(np.diagonal(measured), np.diagonal(measured)).real)
    # a mean of 200 products is known to 7 %
    assert stated / size == pytest.approx(measured / size, abs=0.25)


@tabled("ripple", "deviation", "used")
def test_a_search_ends_where_noise_is_left_or_a_race_agrees(ripple, deviation, used):
    values = {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04}
    frf = of_model(structures.yaw_base, values)
    wave = 1.0 + ripple * np.cos(2.0 * np.pi * np.arange(frf.frequency.size) / 2.5)
    frf = replace(frf, response=frf.response * wave)
    points = select(frf, structures.yaw_base, band=None, responses=None, count=60)
    if deviation:
        points = replace(points, covariance=2.0 * deviation**2 * np.eye(60) + 0j)
    cost, told = Cost(structures.yaw_base, points), []
    best, agreeing = search(cost, 5, 0, told.append)
    assert told == ["yaw_base"] * used
    assert agreeing >= 2
    assert best.cost == pytest.approx(753.0 * ripple**2, rel=0.15)  # 20 W (8.69 dB)^2 / 2


def test_starts_agree_in_cost_from_delays_that_are_a_step_apart():
    structure = structures.yaw_base
    frf = of_model(structure, {"N_r": -0.7, "N_ped": 50.0, "tau_r_base": 0.04})
    for one, expected in ((structure, 3), (structure.with_fixed({"tau_r_base": 0.0}), 5)):
        cost = Cost(one, select(frf, one, band=None, responses=None, count=20))
        ends = [
            Minimum(np.array([k]), 5.0 * value, True, Start(np.zeros(3), np.array([0.026 * late])))
            for k, (value, late) in enumerate(
                [(1.00011, 5), (1.0, 0), (1.00009, 1), (1.00009, 0), (1.0, 1.5), (1.0, 2.5)]
            )
        ]
        best, agreeing = agreed(ends, Delays(cost))
        assert best is ends[1]
        assert agreeing == expected


@pytest.mark.parametrize("full", [0.0, 7.0])
@pytest.mark.parametrize(("beyond", "advised"), [(0.99, "tf:0/0"), (1.01, None)])
def test_a_lower_order_is_believed_up_to_an_f_test(full, beyond, advised):
    """At 99.9 % by scipy's F distribution, and up to 0.0001 where nothing is left."""
    structure = transfer_function(zeros=1, poles=2, input="u", output="y")
    values = {"b1": 1.0, "b0": 3.0, "a1": 1.2, "a0": 4.0, "tau": 0.1}
    points = select(of_model(structure, values), structure, band=None, responses=None, count=20)
    cost, x = Cost(structure, points), np.array(list(values.values()))
    asked = []

    def squares(of, end):
        less, freedom = len(cost.names) - len(of.names), 2 * points.frequency.size - 5
        if not less:
            return full
        asked.append(of.structure.names)
        rise = full * less / freedom * fisher.ppf(0.999, less, freedom)
        return full + beyond * (rise or 1e-4)

    def told(bounds):
        best = Minimum(x, 6.0, True, Start(x, x[4:]))
        return degenerate(cost, best, bounds, squares, lambda _: best._replace(cost=12.0))

    advice, names, lower = told(np.abs(x))
    assert names == (frozenset(values) if advised else frozenset())
    assert (bool(advice), lower) == (bool(advised), advised or "")
    if advised:
        assert f"fit {advised} instead, whose J of 12 " in advice[0]
    assert len(set(asked)) == len(asked) == (4 if advised else 3)
    assert told(0.999 * np.abs(x)) == ((), frozenset(), "")


def residuals(ratio, percent):
    none = {"r/ped": 0.0, "p/lat": 0.0}
    return Residual(none | {"p/lat": 0.2 * np.log(10.0) ** -1 * percent}, none, ratio)


@tabled("poles", "left", "kind")
def test_a_fit_is_doubted_for_a_fast_unstable_pole_or_large_residual(poles, left, kind):
    """From 0.4 of the band's top, 10 rad/s; from ten times the noise's power and 5 %."""
    note = doubt((1.0, 10.0), [complex(pole) for pole in poles], left)
    assert (note and note.kind) == kind
    assert note is None or ("p/lat is off by 5 %" in note.text) == (kind == "residual")


@tabled("zeros", "poles", "kept")
def test_zeros_that_poles_cancel_are_left_out_once_each(zeros, poles, kept):
    """Nearer than a millionth of a zero's size, or of a thousandth of the fastest pole's."""
    assert uncancelled(np.array(zeros) + 0j, np.array(poles) + 0j, 10.0).tolist() == kept


@pytest.mark.parametrize("known", [{}, {1: -1.5, 2: 4.0}])
@pytest.mark.parametrize("fixed", [False, True])
def test_rational_fits_end_in_minima_of_their_stated_error(known, fixed):
    """The weighted rms relative error, which scipy's descent from there does not lower."""
    random, omega = np.random.default_rng(8), np.geomspace(0.3, 12.0, 40)
    s, weight, delays = 1j * omega, random.uniform(0.5, 2.0, 40), np.array([0.0, 0.1, 0.4])
    measured = (2.0 - 1.5 * s) / (4.0 + 1.2 * s + s**2) * np.exp(-0.12 * s)
    measured = measured * np.exp(0.05 * numbers(random, 40))
    given = np.array([known.get(k, np.nan) for k in range(4)])
    found = rational_fits(
        omega, measured, weight, zeros=1, poles=2, delays=delays, fixed=fixed, known=given
    )
    sought = np.append(np.isnan(given), not fixed)
    assert not fixed or found.delays == pytest.approx(delays)
    assert np.all(found.denominators[:, 2] == 1.0)
    for k, error in enumerate(found.errors):
        x = np.array([*found.numerators[k], *found.denominators[k, :2], found.delays[k]])
        for place, number in known.items():
            assert x[place] == pytest.approx(number)

        def residual(free, x=x):
            x = x.copy()
            x[sought] = free
            a, b, c, d, tau = x
            model = (a + b * s) / (c + d * s + s**2) * np.exp(-tau * s)
            each = np.sqrt(weight / weight.sum()) * (model / measured - 1.0)
            return np.concatenate([each.real, each.imag])

        assert np.linalg.norm(residual(x[sought])) == pytest.approx(error)
        best = least_squares(residual, x[sought], xtol=1e-12, ftol=1e-12, x_scale="jac")
        # a descent ends where a step gains a millionth of the square
        assert error <= np.sqrt(2.0 * best.cost) * (1.0 + 1e-5)


def bands(random, n_freq):
    valid = np.ones((3, n_freq), dtype=bool)
    valid[0, :3] = valid[1, 0] = False
    root = numbers(random, 3, n_freq, 2, 2)
    gains = (numbers(random, n_freq, 2, 3), numbers(random, n_freq, 3, 4))
    freedom = random.uniform(2.0, 20.0, (3, n_freq))
    freedom[:, -1] = 4.9
    return Bands(
        np.zeros((3, 2, 2, n_freq)), valid, root @ root.conj().swapaxes(2, 3), freedom, *gains, ()
    )


def test_the_disturbances_spectrum_is_the_narrowest_bands_that_has_lines_to_spare():
    """Averaged over 0.15 of the frequency; larger by 2.5 over the lines that it averages."""
    random, omega = np.random.default_rng(3), np.geomspace(1.0, 9.0, 12)
    made = bands(random, 12)
    found = local._noise(made, omega)
    taken = []
    for k in range(12):
        usable = np.flatnonzero(made.valid[:, k])
        spare = [one for one in usable if made.freedom[one, k] >= 5.0]
        taken.append(min(spare, default=usable[-1]))
    freedom = np.array([made.freedom[one, k] for k, one in enumerate(taken)])
    for k in range(12):
        near = freedom * np.exp(-0.5 * (np.log(omega / omega[k]) / 0.15) ** 2)
        mean = sum(w * made.residual[one, j] for j, (w, one) in enumerate(zip(near, taken)))
        count = freedom[k] * max(1.0, 3.5 * 0.15 / (1.6 * WIDTHS[taken[k]]))
        assert found[k] == pytest.approx(mean / near.sum() * (1.0 + 2.5 / count))


def test_inputs_spectra_are_means_over_lines_and_coherences_follow_from_them():
    """Of a fifth of the frequency and 12 lines; what no other input explains is Schur's part."""
    random, spacing, count = np.random.default_rng(6), np.array([0.02, 0.03]), np.array([200, 90])
    made = Lines(tuple("abcdef"), spacing, count, numbers(random, 2, 200, 6))
    made.values[1, 90:] = 0.0
    omega = np.array([0.05, 0.4, 1.3, 2.5])
    task = Task(made, [0, 2, 3, 5], [1, 4], [1, 4, 5], 2, omega)
    widest, low, high = 12 / (1.0 / spacing).sum(), [], []
    power = local._power(made, task.drive, omega)
    for w, found in zip(omega, power):
        low = max(w - max(0.2 * w, 0.5 * widest), 0.0)
        high = max(1.2 * w, low + widest)
        rows = [
            made.values[flight, line, task.drive]
            for flight in range(2)
            for line in range(1, count[flight])
            if low <= line * spacing[flight] <= high
        ]
        assert found == pytest.approx(np.mean([np.outer(x, x.conj()) for x in rows], axis=0))
    response, noise = numbers(random, 2, 2, 4), random.uniform(0.1, 9.0, (2, 4))
    made = bands(random, 4)
    partial, multiple = local._coherence(task, made, response, noise)
    for k in range(4):
        into, full = made.active_gain[k], made.full_gain[k]
        seen = into @ power[k] @ into.conj().T
        for o in range(2):
            total = (full[o] @ seen @ full[o].conj()).real
            assert multiple[o, k] == pytest.approx(total / (total + noise[o, k]))
            for i in range(2):
                rest = [j for j in range(3) if j != i]
                shared = seen[i, rest] @ np.linalg.solve(seen[np.ix_(rest, rest)], seen[rest, i])
                own = np.abs(response[o, i, k]) ** 2 * (seen[i, i] - shared).real
                assert partial[o, i, k] == pytest.approx(own / (own + noise[o, k]))


def test_a_width_is_used_that_has_lines_for_its_parameters():
    """Half more than they are and four; up to 4 widths, none beyond 100 lines for each or 1.0."""
    spacing, count = np.array([0.02, 0.05]), np.array([600, 300])
    made = Lines(("u", "v", "y"), spacing, count, np.zeros((2, 600, 3)))
    omega = np.geomspace(0.08, 20.0, 90)
    for transient in (True, False):
        task = Task(made, [0, 1], [2], [], 2, omega)
        found = local._usable_widths(task, np.full(90, transient))
        for k, w in enumerate(omega):
            lines = [
                sum(
                    max(
                        int(np.sum(np.abs(np.arange(1, n) * step - w) <= b * w * (1 + 1e-12)))
                        - 3 * transient,
                        0,
                    )
                    for n, step in zip(count, spacing)
                )
                for b in WIDTHS
            ]
            enough = [n for n, one in enumerate(lines) if one >= 1.5 * (6 + 4)] or [6]
            first = enough[0]
            expected = [
                n
                for n in enough
                if n < first + 4
                and (WIDTHS[n] <= 1.0 or n <= first + 1)
                and (n == first or lines[n - 1] < 600)
            ]
            assert np.flatnonzero(found[:, k]).tolist() == expected


def test_a_local_estimate_states_no_more_coherence_than_its_errors_allow():
    """1 / (1 + 16 e^2) for an error e of the magnitude, and chunks of any size give the same."""
    random = np.random.default_rng(1)
    lat, gust = random.standard_normal((2, 900))
    flown = [record(lat=lat, p=np.convolve(lat, [0.5, 0.3, 0.2])[:900] + gust)]
    omega = np.geomspace(0.5, 20.0, 30)
    found = Local(flown, ("lat", "p"), omega).estimate(["lat"], ["p"])
    o, i, w = np.indices((1, 1, 30)).reshape(3, -1)
    variance = found.scatter.variance(o, i, w) / np.abs(found.response[0, 0]) ** 2
    assert found.random_error[0, 0] == pytest.approx(np.sqrt(0.5 * variance))
    most = 1.0 / (1.0 + 8.0 * variance)
    assert np.all(found.coherence[0, 0] <= most * (1.0 + 1e-12))
    bound = np.isclose(found.coherence[0, 0], most, rtol=1e-9)
    assert np.any(bound)
    assert not np.all(bound)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(local, "_CHUNK", 1)
        again = Local(flown, ("lat", "p"), omega).estimate(["lat"], ["p"])
    assert again.response == pytest.approx(found.response, rel=1e-9)


@pytest.mark.parametrize("responses", [1, 2])
def test_a_first_pole_is_total_least_squares_in_the_noises_metric(responses):
    """A Y = B U + E: scipy's generalised eigenvalue problem, and what a pole takes off chi^2."""
    random, omega = np.random.default_rng(5), 0.01 * np.arange(260)
    u, spoil = numbers(random, 260), 0.3 * numbers(random, 260, responses)
    y = (u / (1.0 - (omega - 1.5) / (0.2 + 0.3j)))[:, None] + spoil
    made = Lines(("u", "y", "z"), np.array([0.01]), np.array([260]), np.column_stack([u, y])[None])
    chosen = np.arange(1, 1 + responses).tolist()
    band = local_fit._gather(made, [0], chosen, np.array([1.5]), np.array([0.6]))
    solved = local_fit._solve(band, None, transient=True)
    found, worth = local_fit._linear_pole(band, solved)
    offset = band.offset.reshape(1, -1, 1)
    rest, whole = solved.remainder, band.right.reshape(solved.remainder.shape)
    size = np.sqrt(np.sum(np.abs(rest) ** 2, axis=1, keepdims=True) / solved.freedom)
    one, two = ((x / size).ravel() for x in (rest, solved.cleared(whole * offset)))
    pair = np.stack([one, two])
    chance = [np.sum(solved.loose * offset[..., 0] ** k) / solved.freedom[0] for k in range(3)]
    metric = np.array([[chance[0], chance[1]], [chance[1], chance[2]]])
    _, vectors = eigh(pair.conj() @ pair.T, metric)
    a, b = vectors[:, 0]
    assert found[0] == pytest.approx(-a / b)
    two = two - chance[1] * one
    left = one - two * (two.conj() @ one) / (two.conj() @ two)
    after = np.sum(np.abs(left) ** 2)
    assert worth[0] == pytest.approx((np.sum(np.abs(one) ** 2) / after - 1.0) * solved.freedom[0])


def test_a_pole_stays_off_the_axis_and_near():
    """On its side of the axis, half a line away; ten half widths from the middle at most."""
    least = np.full(5, 0.1)
    place = np.array([2.0 + 0.5j, -3.0 - 0.05j, 1.0 + 0.0j, 30.0 - 40.0j, 0.05j])
    expected = [2.0 + 0.5j, -3.0 - 0.1j, 1.0 + 0.1j, 6.0 - 8.0j, 0.1j]
    assert local_fit._kept_off(place, least) == pytest.approx(np.array(expected))


def test_an_iteration_of_sanathanan_and_koerner_ends_in_exact_data():
    """The truth at its own delay, of roots far from the start's; a coefficient that is given."""
    omega = np.geomspace(0.2, 8.0, 30)
    powers = (1j * omega)[:, None] ** np.arange(4)
    top, bottom = np.array([3.0, -2.0]), np.array([0.5, 4.0, 0.3, 1.0])
    response = (powers[:, :2] @ top) / (powers @ bottom) * np.exp(-0.2j * omega)
    root, delays = np.random.default_rng(0).uniform(0.1, 0.2, 30), np.array([0.0, 0.2])
    for given in (np.full(5, np.nan), np.array([np.nan, -2.0, np.nan, 4.0, np.nan])):
        above, below = rational._sanathanan_koerner(powers, response, root, (1, 3), delays, given)
        # least squares that are held by 1e-14
        assert above[1] == pytest.approx(top, rel=1e-6)
        assert below[1] == pytest.approx(bottom, rel=1e-6)
        assert np.abs(above[0] - top).max() > 0.1
    rows = np.random.default_rng(1).normal(size=(1, 9, 4)) * [1.0, 0.0, 1.0, 1.0]
    expected = np.linalg.lstsq(rows[0, :, :3], rows[0, :, 3])[0]  # the least: 0 of what isn't seen
    assert rational._least_squares(rows)[0] == pytest.approx(expected, abs=1e-9)


def test_a_composites_bias_is_its_gap_to_the_local_estimate_beyond_chance():
    """Averaged over 0.15 of the frequency where chance is small; half of it in each part."""
    random, omega = np.random.default_rng(4), np.geomspace(2.0, 12.0, 25)
    lat, gust = random.standard_normal((2, 2400))
    p = lfilter([0.01], np.poly(0.99 * np.exp([0.2j, -0.2j])), lat) + 0.001 * gust
    flown, lengths, asked = [record(lat=lat, p=p)], (20.0, 12.0), (["lat"], ["p"])
    names = ("lat", "p")
    each = [condition(cross_spectra(flown, names, omega, one), ["lat"], ["p"]) for one in lengths]
    found = Windows(flown, names, omega, lengths).estimate(*asked)
    whole, beside = compose(each), Local(flown, names, omega).estimate(*asked)
    h, error = whole.response[0, 0], whole.random_error[0, 0]
    gap = np.abs(1.0 - beside.response[0, 0] / h) ** 2
    chance = 2.0 * np.maximum(error, beside.random_error[0, 0]) ** 2
    for k in range(25):
        near = np.exp(-0.5 * (np.log(omega / omega[k]) / 0.15) ** 2) / (chance + 0.005**2) ** 2
        excess = max(np.sum(near * (gap - chance)) / near.sum(), 0.0)
        assert found.scatter.bias[0, 0, k] == pytest.approx(np.sqrt(excess) * np.abs(h[k]))
        expected = np.sqrt(error[k] ** 2 + 0.5 * excess)
        assert found.random_error[0, 0, k] == pytest.approx(expected)
        counted = [one for one in each if one is each[0] or one.periods[k] >= 6.0]
        noise = sum(one.averages * one.noise[k] for one in counted)
        mean = noise / sum(one.averages for one in counted)
        assert found.scatter.noise[k] == pytest.approx(mean)
    assert np.sum(found.scatter.bias > 0.0) >= 3


LINEAR = [
    *structures.BUILT_IN.values(),
    *(
        in_series(plant, inputs={plant.inputs[0]: second_order("servo", **known)})
        for plant in (structures.rollpitch, structures.yaw_base)
        for known in ({"omega": 60.0, "zeta": 0.7}, {"omega": 60.0})
    ),
]


@pytest.mark.parametrize("structure", LINEAR, ids=lambda one: f"{one.name} {len(one.free)}")
def test_gains_are_the_most_parameters_in_which_a_response_is_linear_together(structure):
    """Half way between two draws of them it is the mean, and with any other it is not."""
    omega, random = np.array([0.7, 3.0, 11.0]), np.random.default_rng(0)
    size = {one.name: one.start or 0.3 * one.magnitude for one in structure.parameters}
    free = [one.name for one in structure.free]
    gains = [free[k] for k in linear_parameters(structure)]

    def bend(names):
        draws = [
            size | {name: size[name] * random.uniform(0.7, 1.3) for name in names} for _ in range(2)
        ]
        middle = {name: 0.5 * (draws[0][name] + draws[1][name]) for name in size}
        one, other, mean = (response(structure, values, omega) for values in (*draws, middle))
        return np.max(np.abs(mean - 0.5 * (one + other))) / np.max(np.abs(mean))

    assert gains
    assert bend(gains) < 1e-12
    assert all(bend([*gains, name]) > 1e-9 for name in free if name not in gains)
