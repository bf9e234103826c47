"""The standard atmosphere against its published table."""

import math

import pytest

from helisim.base.errors import InputError
from helisim.vehicle import isa_density, load


# ISO 2533:1975, table 1 (as printed in Anderson, Introduction to Flight, appendix A)
@pytest.mark.parametrize(
    ("altitude", "density"),
    [(0.0, 1.2250), (1000.0, 1.1117), (2000.0, 1.0066), (5000.0, 0.73643), (11000.0, 0.36480)],
)
def test_density_is_the_tables(altitude, density):
    """The table counts in geometric altitude above 0: 11 km differ by 19 m, 0.2 %."""
    tolerance = 5e-5 if altitude == 0.0 else 3e-3 * altitude / 11000.0
    assert isa_density(altitude) == pytest.approx(density, rel=tolerance)


def test_hot_air_is_thin():
    """At one pressure density goes with 1/T."""
    assert isa_density(0.0, temperature=303.15) == pytest.approx(1.225 * 288.15 / 303.15, rel=1e-5)


def test_thin_air_takes_pitch_and_shifts_the_power(jr700):
    """Induced power goes with 1 / sqrt(rho), profile power with rho."""
    density = isa_density(2000.0)
    high = load(parameters={"air.density": density})
    assert high.trim.col > jr700.trim.col
    weight, area, tip = 8.01 * 9.8015, math.pi * 0.767**2, 178.02358 * 0.767  # Table 1
    induced = 1.15 * math.sqrt(weight**3 / (2.0 * 1.225 * area))
    profile = 2 * 0.065 / (math.pi * 0.767) * 0.012 / 8.0 * 1.225 * area * tip**3
    thin = density / 1.225
    # the trim's roll of 0.067 rad: 0.2 % of thrust
    assert jr700.main_power == pytest.approx(induced + profile, rel=3e-3)
    assert high.main_power == pytest.approx(induced / math.sqrt(thin) + profile * thin, rel=3e-3)


@pytest.mark.parametrize("given", [{"altitude": 20000.0}, {"altitude": 0.0, "temperature": 25.0}])
def test_nonsense_is_refused(given):
    """Stratosphere, and Celsius for Kelvin, are one clear line."""
    with pytest.raises(InputError, match=r"from -500 to 11000 m|Celsius"):
        isa_density(**given)
