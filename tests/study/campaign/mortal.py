"""Work that may kill its process. Imports little, so that many processes start fast."""

import os
import signal
import time


def square(number):
    """Return the square."""
    return number * number


def die_once(task):
    """Return a number's square; the first to come to 3 kills its process."""
    number, mark = task
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(number)


def always_die(_):
    """Kill the process."""
    os.kill(os.getpid(), signal.SIGKILL)


def linger(folder):
    """Say who works, by a file named by the process, and work for long."""
    (folder / f"{os.getpid()}.pid").touch()
    time.sleep(600.0)


def fail(number):
    """Raise an exception that is no worker's fault."""
    raise ZeroDivisionError(number)
