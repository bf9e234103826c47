import numpy as np
import pytest

from helisim.base.errors import InputError, StorageError
from helisim.study.results import read_models, write_models
from made_run import make_model


def test_a_model_comes_back(tmp_path):
    """Fit, exact response and verification are read as they were written."""
    item = make_model("rollpitch_in1", verified=True)
    (read,) = read_models(write_models(tmp_path / "fits.json", [item]))
    assert (read.name, read.note, read.verified_on) == (item.name, item.note, item.verified_on)
    assert read.fit.values == item.fit.values
    np.testing.assert_array_equal(read.exact.response, item.exact.response)
    np.testing.assert_array_equal(
        read.verification.traces[0].predicted, item.verification.traces[0].predicted
    )
    assert read.verification.tic_by_output == item.verification.tic_by_output


def test_another_file_is_refused(tmp_path):
    """The message names the file and what it holds."""
    path = tmp_path / "fits.json"
    with pytest.raises(StorageError, match=r"fits\.json"):
        read_models(path)
    path.write_text('{"format": "other"}')
    with pytest.raises(InputError, match="its format is 'other'"):
        read_models(path)
    path.write_text('{"format": "helisim fits, version 1", "models": [{}]}')
    with pytest.raises(InputError, match="can't read a model"):
        read_models(path)
