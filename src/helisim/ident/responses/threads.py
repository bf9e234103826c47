"""Limits linear algebra to one thread: the same bits whatever the number of processors.

BLAS adds up in another order when it works in several threads, which moves the last digits of
every result; and on matrices as small as these, one thread is the faster choice.

The number of BLAS threads is the process's, and threadpoolctl leaves it to the first Python
thread that sets it: where several Python threads identify at once, last digits may still move.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Let BLAS work in one thread within the block."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache
def _controller() -> ThreadpoolController:
    """Return the libraries in use; numpy and scipy each bring one, and both are loaded by now."""
    return ThreadpoolController()
