"""Public names are what they are called, also where a room of the house has the same name."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("first", ["", "import helisim.look, helisim.design.design; "])
def test_a_function_is_not_replaced_by_the_room_of_its_name(first):
    """Whatever was imported before, and when it is asked for again."""
    names = "print(*(one.__name__ for one in (hs.look, hs.look, hs.design)))"
    code = f"{first}import helisim as hs; {names}"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == ["look", "look", "design"]
