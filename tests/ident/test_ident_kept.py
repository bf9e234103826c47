"""What fits of flights tell, whole, as it was reviewed: test_ident_kept.json."""

import numpy as np
import pytest

import helisim as hs
from helisim.ident import identify_records, structures
from helisim.ident.ardupilot import ArduPilotModel
from helisim.ident.evaluate import linear
from ident_data import ROLLPITCH, YAW, fitted
from tabled import rows

CASES = dict(rows(globals(), "CASES"))


def flights(axes, kind="sweep"):
    return [hs.open_example(f"{kind}_{axis}") for axis in axes]


@pytest.mark.parametrize("name", CASES)
def test_a_fit_of_flights(name, kept):
    axes, structure, options, band = CASES[name]
    sides = {"inputs": structure.inputs, "outputs": structure.outputs}
    frf = hs.frequency_response(flights(axes), **sides, band=band, **options)
    fit = hs.identify(frf, structure)
    shown = ""
    if axes[0] in ("lat", "ped") and not options:
        shown = str(hs.verify(fit, flights(axes[:1], "doublet")))
    words = [line for line in str(fit).splitlines() if "search" not in line]
    response = np.abs(frf.response[..., ::15]).tolist()
    error = frf.random_error[..., ::15].tolist()
    kept([words, str(fit.verdict), fit.verdict.to_dict(), str(fit.modes), shown, response, error])


def test_a_fit_of_a_short_record(kept):
    (record,) = flights(["ped"], "doublet")
    fit = identify_records([record], structures.yaw_base)
    kept([[line for line in str(fit).splitlines() if "search" not in line], fit.band])


@pytest.mark.parametrize("name", structures.BUILT_IN)
def test_a_structure(name, kept):
    structure = structures.named(name)
    at = linear(structure, structure.starts)
    kept([structure.to_dict(), at.a.tolist(), at.b.tolist(), at.c.tolist(), at.d.tolist()])


def test_a_model_for_ardupilot(kept):
    fits = [fitted(structures.rollpitch, ROLLPITCH), fitted(structures.yaw_base, YAW)]
    units = dict.fromkeys(("col", "lon", "lat", "ped"), 0.5)
    made = ArduPilotModel.of(fits, full=units, rotor_speed=178.0, hover=0.4, hover_lean=0.06)
    kept([dict(made.values), made.remarks])
