"""Executors of a campaign: processes of this machine."""

import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context, parent_process
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any

from helisim.base.errors import WorkerError
from helisim.sim.flight import thread_count

Work = Callable[[Any], Any]
Results = Generator[Any, None, None]  # closing it stops the work
Executor = Callable[[Work, Sequence[Any]], Results]  # yields results in any order


def local(jobs: int | None = None) -> Executor:
    """Return an executor of `jobs` processes, one a processor if None. Raises InputError."""
    count = thread_count(jobs)

    def execute(work: Work, tasks: Sequence[Any], /) -> Results:
        left, others = len(tasks), set(active_children())
        spawn = get_context("spawn")
        pool = ProcessPoolExecutor(min(count, left), mp_context=spawn, initializer=_begin)
        try:
            for future in as_completed([pool.submit(work, task) for task in tasks]):
                yield future.result()
                left -= 1
        except BrokenProcessPool:
            raise WorkerError(
                f"a worker process died (out of memory?) with {left} replicates left; run again, "
                "with fewer jobs if need be, to go on",
                remedy="jobs",
            ) from None
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(active_children()) - others:
                child.terminate()

    return execute


def _begin() -> None:
    signal(SIGINT, SIG_IGN)  # the parent's to handle: it reaches the whole group of a terminal
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
