"""Transfer functions in factors: the notation, the response, and what fits find."""

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.cli.fitting import find_structure
from helisim.ident import Structure, identify, structures
from helisim.ident.evaluate import response_and_slope
from helisim.ident.modes import modes
from ident_data import of_model, slopes

GRID = np.geomspace(0.3, 30.0, 50)
S = 1j * GRID

# notation, parameters without K and tau, and the response over K by hand
CASES = [
    ("(a)/[zeta,omega](0)", (1.5, 0.2, 6.0),
     lambda a, z, w: (S + a) / (S**2 + 2 * z * w * S + w**2) / S),
    ("1/(1/T)", (0.5,), lambda t: 1 / (S + 1 / t)),
    ("(a)/(a)", (1.0, 9.0), lambda a, b: (S + a) / (S + b)),
    ("[z,w]/[z,w]", (0.1, 2.0, 0.3, 5.0),
     lambda a, b, c, d: (S**2 + 2 * a * b * S + b**2) / (S**2 + 2 * c * d * S + d**2)),
    ("(a)(b)(c)/(d)(e)(f)", (1.0, 4.0, -9.0, 2.0, 6.0, 12.0),
     lambda a, b, c, d, e, f: (S + a) * (S + b) * (S + c) / (S + d) / (S + e) / (S + f)),
    ("[z,w](a)/(b)(c)[y,v](1/T)", (0.15, 4.0, -2.0, 0.7, 3.0, 0.2, 9.0, 0.05),
     lambda z, w, a, b, c, y, v, t: (S**2 + 2 * z * w * S + w**2) * (S + a)
     / (S + b) / (S + c) / (S**2 + 2 * y * v * S + v**2) / (S + 1 / t)),
    ("[z,w]/(a)(b)(c)", (0.4, 3.0, 1.0, 5.0, 20.0),
     lambda z, w, a, b, c: (S**2 + 2 * z * w * S + w**2) / (S + a) / (S + b) / (S + c)),
    ("(0)/(a)(b)", (0.8, 12.0), lambda a, b: S / (S + a) / (S + b)),
    ("1/(0)(0)", (), lambda: 1 / S**2),
    ("1/1", (), lambda: np.ones_like(S)),
]  # fmt: skip


def made(notation, numbers, gain=-3.0, tau=0.12):
    structure = structures.factored(notation, input="u", output="y")
    return structure, dict(zip(structure.names, (gain, *numbers, tau), strict=True))


@pytest.mark.parametrize(("notation", "numbers", "over"), CASES)
def test_the_response_is_the_factors_written_out(notation, numbers, over):
    """Every kind of factor and section, with gain and delay; slopes by central differences."""
    structure, values = made(notation, numbers)
    found, slope = response_and_slope(structure, values, GRID)
    np.testing.assert_allclose(found[0, 0], -3.0 * over(*numbers) * np.exp(-0.12 * S), rtol=1e-11)
    np.testing.assert_allclose(slope, slopes(structure, values, GRID), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("notation", "numbers", "over"), CASES)
def test_a_fit_finds_the_factors_from_no_start_at_all(notation, numbers, over):
    """From an exact response, delay 0.17 s: the rational fit's roots are where it begins."""
    structure, values = made(notation, numbers, tau=0.17)
    exact = of_model(structure, values, GRID)
    fit = identify(exact, structure)
    assert fit.cost < 1e-12
    assert fit["K"].value == pytest.approx(-3.0)
    assert fit["tau"].value == pytest.approx(0.17)
    # of one kind, which is called first is the fit's to say
    assert sorted(fit.values.values()) == pytest.approx(sorted(values.values()), rel=1e-6)


def test_two_real_ones_are_a_second_order_of_high_damping():
    """[zeta, omega] above zeta = 1, and a pair of first orders becomes complex nowhere."""
    structure, values = made("1/(a)(b)", (2.0, 8.0))
    exact = of_model(structure, values, GRID)
    fit = identify(exact, structures.factored("1/[zeta,omega]", input="u", output="y"))
    assert fit.values == pytest.approx({"K": -3.0, "zeta": 1.25, "omega": 4.0, "tau": 0.12})


def test_real_factors_on_a_pair_end_where_they_can():
    """Two first orders for a resonance: no error, and a cost that says so."""
    structure, values = made("1/[zeta,omega]", (0.1, 5.0))
    exact = of_model(structure, values, GRID)
    structure = structures.factored("1/(a)(b)", input="u", output="y")
    fit = identify(exact, structure, searches=2)
    assert not fit.acceptable


def test_names_starts_and_numbers_of_factors():
    """Names are kept, numbers are starts, repeats are numbered, 0 is fixed."""
    one = structures.factored("(1/T_r)(2.5)/[zeta_sp, omega_sp][0.3,5](0)", input="u", output="y")
    names = ("K", "T_r", "a", "zeta_sp", "omega_sp", "zeta", "omega", "tau")
    assert one.names == names
    assert one.starts["a"] == 2.5
    assert (one.starts["zeta"], one.starts["omega"]) == (0.3, 5.0)
    assert one.parameter("omega").limits[0] > 0.0
    assert one.parameter("T_r").limits[0] > 0.0
    assert one.parameter("a").bounds is None
    assert len(one.states) == 5
    two = structures.factored("K (a) / (a) (a)", input="u", output="y", delay=None, gain="A")
    assert two.names == ("A", "a1", "a2", "a3")
    assert len({two.starts["a2"], two.starts["a3"]}) == 2


@pytest.mark.parametrize(
    ("notation", "message"),
    [
        ("(a)", "can't read '(a)'; expected factors of the numerator"),
        ("(a)/", "a slash, and those of the denominator"),
        ("(a)/(b)x", "can't read '(a)/(b)x'"),
        ("{a}/(b)", "can't read '{a}/"),
        ("(a)(b)/(c)", "numerator of order 2 over a denominator of order 1"),
        ("1/[a]", "has 1 entries, expected two"),
        ("1/[0.5,-3]", "isn't positive"),
        ("1/(1/-2)", "isn't positive"),
        ("1/(a+b)", "neither a name nor a number"),
        ("1/(inf)", "isn't a finite number"),
        ("1/(K)", "parameter names repeat: K"),
        ("1/()", "neither a name nor a number"),
    ],
)
def test_a_notation_that_is_none_is_refused(notation, message):
    """One line with what was read and an example."""
    with pytest.raises(InputError) as caught:
        structures.factored(notation, input="u", output="y")
    assert message in str(caught.value)


def test_the_command_line_takes_factors(tmp_path):
    """As `tf:` and factors; polynomials as before, and the file is the same structure."""
    one = find_structure("tf:(a)/[zeta,omega](0)", ("lat",), ("p",))
    assert one == structures.factored("(a)/[zeta,omega](0)", input="lat", output="p")
    one.to_toml(tmp_path / "mine.toml")
    assert Structure.from_toml(tmp_path / "mine.toml") == one
    assert find_structure("tf:1/2", ("lat",), ("p",)).names[0] == "b1"
    with pytest.raises(InputError, match="needs one input and one output"):
        find_structure("tf:1/(a)", ("lat", "lon"), ("p",))
    with pytest.raises(InputError, match="can't read 'x'"):
        find_structure("tf:x", ("lat",), ("p",))
    with pytest.raises(UnknownNameError, match="tf:FACTORS"):
        find_structure("nothing", ("lat",), ("p",))


def test_a_fixed_factor_stays():
    """Known from elsewhere: the rest is found from the structure's own starts."""
    structure, values = made("(a)/[zeta,omega]", (1.5, 0.2, 6.0))
    exact = of_model(structure, values, GRID)
    fit = identify(exact, structure.with_fixed({"omega": 6.0}))
    assert fit.values == pytest.approx(values, rel=1e-6)


def test_the_modes_of_a_factored_fit_are_its_parameters():
    """Damping and frequency, with the parameters' own standard errors."""
    structure, values = made("1/[zeta,omega]", (0.3, 5.0))
    names, covariance = ["zeta", "omega"], np.array([[1e-4, 2e-4], [2e-4, 4e-2]])
    found = modes(structure, values, (), names=names, covariance=covariance)
    (pole,) = found.poles
    assert (pole.damping, pole.frequency) == pytest.approx((0.3, 5.0))
    assert (pole.damping_error, pole.frequency_error) == pytest.approx((0.01, 0.2))
