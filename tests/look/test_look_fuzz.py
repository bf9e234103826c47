"""Property tests: whatever a log holds, a look is a value or an error, and its command parses."""

import shlex
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helisim.base.errors import HelisimError
from helisim.cli import parser
from helisim.cli.logs import command_line
from helisim.look import look

HEADS = st.sampled_from(
    [
        *("t [s]", "time", "time_ms", "stamp", "p", "q [deg/s]", "rollRate", "Roll", "pitch_cmd"),
        *("lat", "LAT [percent]", "rc1", "collective [%]", "acc_z", "az [g]", "climb", "a:b", "n"),
    ]
)
COLUMNS = st.sampled_from(
    ["time", "ms", "sine", "zero", "noise", "pulses", "holes", "wild", "none"]
)


def column(kind, count, seed):
    """Return numbers of a kind, (count,)."""
    t, random = np.arange(count) / 50.0, np.random.default_rng(seed)
    return {
        "time": t,
        "ms": 1e3 * t,
        "sine": np.sin(3.0 * t),
        "zero": 0.0 * t,
        "noise": random.standard_normal(count),
        "pulses": 1500.0 + 300.0 * np.sin(np.exp(t / 8.0)),
        "holes": np.where(random.random(count) < 0.1, np.nan, np.sin(t)),
        "wild": 1e300 * random.standard_normal(count),
        "none": np.full(count, np.nan),
    }[kind]


@pytest.mark.slow
@given(
    columns=st.lists(st.tuples(HEADS, COLUMNS), min_size=1, max_size=6),
    count=st.sampled_from([0, 1, 3, 60, 600]),
    cut=st.integers(0, 60),
    seed=st.integers(0, 9),
)
@settings(max_examples=150, deadline=None)
def test_any_table_is_looked_at_or_refused(columns, count, cut, seed):
    """Columns of any kind under any name, with a gap: a value that prints, or an error."""
    heads = [head for head, _ in columns]
    rows = zip(*(column(kind, count, seed).tolist() for _, kind in columns))
    lines = [",".join("" if cell != cell else repr(cell) for cell in row) for row in rows]
    del lines[20 : 20 + cut]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "any.csv")
        path.write_text("\n".join([",".join(heads), *lines]) + "\n")
        try:
            found = look(path)
        except HelisimError as error:
            message = str(error)
        else:
            message = ""
    if message:
        assert "any.csv" in message
        return
    assert str(found)
    assert found.to_dict()["logs"][0]["format"] == "CSV"
    if found.proposal is not None:
        words = shlex.split(command_line(found.proposal))[1:]
        assert parser(words).parse_args(words).command == "identify"
