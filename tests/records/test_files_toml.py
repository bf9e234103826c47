"""Keys and values that are written as TOML are read as the same."""

import math
import tomllib

import pytest

from helisim.base.files import toml_key, toml_value


@pytest.mark.parametrize(
    "value",
    [
        "",
        'a "b" \\ c',
        "two\nlines",
        "\x7f\x1f",
        "é",
        True,
        3,
        0.1,
        1e-300,
        math.inf,
        ["a", [1, 2.5]],
    ],
)
def test_a_value_comes_back(value):
    """Text of any characters, numbers to the last bit, lists in lists."""
    assert tomllib.loads(f"x = {toml_value(value)}") == {"x": value}


@pytest.mark.parametrize("name", ["lat", "b-1", "N_v * Y_ped", "", "a.b", "\x7f", "é"])
def test_a_key_comes_back(name):
    """Names that TOML does not take bare are quoted."""
    assert tomllib.loads(f"{toml_key(name)} = 1") == {name: 1}
