"""Kill a command, without a chance to tidy up, when it is about to complete a certain file."""

import subprocess
import sys

_HOLDING = """
import os, sys, time
from helisim.cli import main

put_in_place = os.replace

def hold(source, target):
    if str(target).endswith(sys.argv[1]):
        print("holding", flush=True)
        time.sleep(600)
    put_in_place(source, target)

os.replace = hold
sys.exit(main(sys.argv[2:]))
"""
"""Runs a command, and stops for good when a file of a certain name is about to be complete."""


def kill_at(ending: str, *arguments: str) -> None:
    """Run a command and kill it when it is at the file whose name ends so."""
    command = [sys.executable, "-c", _HOLDING, ending, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        process.kill()
    assert line == "holding\n"
