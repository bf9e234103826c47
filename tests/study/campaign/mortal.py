"""Work that may kill its process. Imports little, so that many processes start fast."""

import os
import signal
import time


def square(number):
    return number * number


def always_die(_):
    os.kill(os.getpid(), signal.SIGKILL)


def linger(folder):
    (folder / f"{os.getpid()}.pid").touch()
    time.sleep(600.0)


def fail(number):
    raise ZeroDivisionError(number)
