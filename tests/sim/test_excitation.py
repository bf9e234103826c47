"""Sweeps and doublets as they are asked for: what is accepted, and what is refused."""

import math

import numpy as np
import pytest

from helisim.base.errors import InputError, UnknownNameError
from helisim.physics.layout import DOUBLET, PARAM, SWEEP
from helisim.sim import Doublet, Sweep
from helisim.sim.plan import Pilot

NAN = math.nan


@pytest.mark.parametrize("kind", [Sweep, Doublet])
def test_unknown_axis_lists_the_axes(kind):
    """A wrong axis is answered with the four that exist."""
    with pytest.raises(UnknownNameError, match="col, lon, lat, ped"):
        kind(axis="yaw")


@pytest.mark.parametrize("kind", [Sweep, Doublet])
@pytest.mark.parametrize(
    "bad",
    [
        {"duration": -1.0},
        {"duration": 0.0},
        {"duration": NAN},
        {"duration": math.inf},
        {"duration": 3.0, "trim_time": 1.0},
        {"trim_time": -1.0},
        {"trim_time": NAN},
        {"amplitude": 0.0},
        {"amplitude": -0.1},
        {"amplitude": 0.6},
        {"amplitude": NAN},
    ],
)
def test_bad_numbers_are_refused(kind, bad):
    """Times and amplitudes outside their range, and NaN, are one clear line."""
    with pytest.raises(InputError):
        kind(axis="lat", **bad)


@pytest.mark.parametrize("band", [(1.0, 1.0), (0.0, 5.0), (-1.0, 5.0), (5.0, 1.0), (1.0, math.inf)])
def test_bad_band_is_refused(band):
    """A band must rise from above zero to a finite end."""
    with pytest.raises(InputError, match="band"):
        Sweep(axis="lat", band=band)


@pytest.mark.parametrize("bad", [{"leakage": NAN}, {"unsteadiness": NAN}, {"unsteadiness": -0.1}])
def test_bad_humanity_is_refused(bad):
    """A leakage or unsteadiness that is no number never reaches the sticks."""
    with pytest.raises(InputError):
        Sweep(axis="lat", **bad)


@pytest.mark.parametrize("width", [0.0, -1.0, 7.0, 8.0, NAN])
def test_bad_doublet_width_is_refused(width):
    """A doublet must fit into what the trimmed stretch leaves of its flight of 8 s: 6 s."""
    with pytest.raises(InputError, match="width"):
        Doublet(axis="lat", width=width)


@pytest.mark.parametrize(
    "bad",
    [{"remnant": -0.1}, {"remnant": NAN}, {"remnant_interval": 0.0}, {"remnant_interval": NAN}],
)
def test_bad_pilot_is_refused(bad):
    """A pilot's hand has a finite, non-negative unrest."""
    with pytest.raises(InputError):
        Pilot(**bad)


def test_sweep_is_written_as_asked(par):
    """The force laws get the axis's amplitude, and the leakage on the three others."""
    Sweep(axis="lon", duration=60.0, amplitude=0.1, band=(1.0, 20.0), leakage=0.05).write(par)
    assert par[PARAM.excitation] == SWEEP
    sticks = par[PARAM.excitation_col : PARAM.excitation_ped + 1]
    assert sticks == pytest.approx([0.005, 0.1, 0.005, 0.005], rel=1e-12)
    assert par[PARAM.excitation_start] == 3.0
    assert par[PARAM.excitation_duration] == 54.0
    assert (par[PARAM.sweep_w_min], par[PARAM.sweep_w_max]) == (1.0, 20.0)


def test_doublet_is_written_as_asked(par):
    """A doublet moves one stick only, for its width."""
    Doublet(axis="ped", amplitude=0.2, width=0.8).write(par)
    assert par[PARAM.excitation] == DOUBLET
    assert np.flatnonzero(par[PARAM.excitation_col : PARAM.excitation_ped + 1]).tolist() == [3]
    assert par[PARAM.excitation_duration] == 0.8


@pytest.mark.parametrize("kind", [Sweep, Doublet])
def test_what_is_left_open_is_the_vehicles(jr700, kind):
    """Amplitude and band that nobody gave are the vehicle's own; what is given stays."""
    complete = kind(axis="lat").on(jr700.parameters)
    assert complete.amplitude == jr700.parameters["sweep.lat_amplitude"]
    assert kind(axis="lat", amplitude=0.02).on(jr700.parameters).amplitude == 0.02
    if kind is Sweep:
        own = (jr700.parameters["sweep.lat_w_min"], jr700.parameters["sweep.lat_w_max"])
        assert complete.band == own
        assert Sweep(axis="lat", band=(1.0, 2.0)).on(jr700.parameters).band == (1.0, 2.0)


@pytest.mark.parametrize("kind", [Sweep, Doublet])
def test_what_is_left_open_never_reaches_the_sticks(par, kind):
    """Without a vehicle, an open amplitude is refused, not guessed."""
    with pytest.raises(InputError, match=r"on\(vehicle.parameters\)"):
        kind(axis="lat").write(par)
