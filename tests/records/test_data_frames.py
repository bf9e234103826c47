"""Records as tables of pandas and xarray."""

import numpy as np
import pandas as pd

from made_run import make_flight

RECORD = make_flight(("lat", "p", "thrust"), seed=3, vehicle="jr700")


def test_a_dataframe_has_numbers_units_and_origin():
    frame = RECORD.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, RECORD.time)
    np.testing.assert_array_equal(frame["p"], RECORD["p"])
    assert frame.attrs["units"] == {"lat": "1", "p": "rad/s", "thrust": "N"}
    assert frame.attrs["provenance"]["vehicle"] == "jr700"
    frame.iloc[0, 0] = 7.0  # it is the user's own
    assert RECORD["lat"][0] != 7.0
