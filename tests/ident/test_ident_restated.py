"""Laws of the identification restated in plain loops, on random numbers.

What differs is rounding, unless a test says otherwise.
"""

import numpy as np
import pytest
from scipy.integrate import quad_vec

from helisim.ident import Parameter, Structure
from helisim.ident.cost import Cost, select
from helisim.ident.diagnosis import shape
from helisim.ident.local import WIDTHS, choose, smoothed
from helisim.ident.local_fit import Lines, fit_band
from helisim.ident.rational import delay_grid
from helisim.ident.scatter import hann_lobe
from helisim.ident.search import Delays, starting_points
from helisim.ident.transfer import transfer_function
from ident_data import of_model


def numbers(random, *shape):
    return random.normal(size=shape) + 1j * random.normal(size=shape)


def test_a_gaussian_mean_is_over_the_logarithm_of_the_frequency():
    """Weighted sums over weighted counts, point by point."""
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
    """From exact data with delays of the grid nothing is left, whatever the gain begins at."""
    structure, frequency = lagging(inputs, outputs), np.geomspace(0.5, 20.0, 60)
    names = {one.name: one for one in structure.free}
    values = {"K": 5.0, "early": 0.1, "after": 0.225, "a": 2.0}  # steps of half a radian at 20
    points = select(
        of_model(structure, values, frequency), structure, band=None, responses=None, count=60
    )
    cost = Cost(structure, points)
    delays, place = Delays(cost), list(names)
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


@pytest.mark.parametrize(("fixed", "count"), [(False, 7), (True, 3)])
def test_starts_of_a_transfer_function_are_rational_fits_then_scattered(fixed, count):
    """The first is the truth; the direct ones' delays are of the grid, the later within limits."""
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
OFF = 1.5 * np.exp(0.4j)
LOW = "cost is at the band's lower edge, outside 2.85 to 20 rad/s"


@pytest.mark.parametrize(
    ("ratio", "coherence", "told", "band"),
    [
        (np.where(EDGED < 1.5, OFF, 1.01), 1.0, LOW, "2.9 20"),
        # half a turn at the first frequency, which goes on to a whole one: none
        (np.exp(1j * np.clip(np.linspace(3.1, 10.0, 41), None, 2.0 * np.pi)), 1.0, LOW, "2.9 20"),
        (
            np.where(EDGED > 15.0, OFF, 1.01),
            1.0,
            "100 % of its cost is at the band's upper edge, outside 1 to 7.01 rad/s",
            "1 7",
        ),
        (np.full(41, OFF), 0.75, None, None),
        (np.full(41, OFF), 0.7, "coherence is 0.70 on average: something else moves y,", None),
    ],
)
def test_the_shape_of_an_error_tells_its_cause(ratio, coherence, told, band):
    """Three quarters of the cost in a third of the points at an edge, else low coherence."""
    note = shape("y/u", EDGED, ratio, np.full(41, coherence))
    assert (note is None) == (told is None)
    assert note is None or told in note.text
    assert band in (None, *(one.value for one in (note.remedy if note else ())))
