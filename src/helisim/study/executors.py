"""Executors of a campaign: processes of this machine, or a Dask cluster."""

import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context, parent_process
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any

from helisim.base.errors import InputError, WorkerError
from helisim.sim.flight import thread_count

Work = Callable[[Any], Any]
Results = Generator[Any, None, None]  # closing it stops the work
Executor = Callable[[Work, Sequence[Any]], Results]  # yields results in any order


def local(jobs: int | None = None) -> Executor:
    """Return an executor of `jobs` processes, one a processor if None. Raises InputError."""
    count = thread_count(jobs)

    def execute(work: Work, tasks: Sequence[Any], /) -> Results:
        left, others = len(tasks), set(active_children())
        pool = ProcessPoolExecutor(
            min(count, left), mp_context=get_context("spawn"), initializer=_begin
        )
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


def on_dask(scheduler: str | None = None, jobs: int | None = None) -> Executor:
    """Return an executor of a Dask cluster at an address such as "tcp://127.0.0.1:8786".

    None starts a local cluster of `jobs` workers, one a processor if None. Raises InputError if
    Dask isn't installed or both are given.
    """
    try:
        import distributed
    except ImportError:
        raise InputError("Dask isn't installed: pip install -e '.[dask]'") from None
    if scheduler is not None and jobs is not None:
        raise InputError("jobs are for a cluster started here: leave out jobs or scheduler")
    started: dict[str, Any] = {"n_workers": jobs, "threads_per_worker": 1, "host": "127.0.0.1"}
    started |= {"dashboard_address": None}

    def execute(work: Work, tasks: Sequence[Any], /) -> Results:
        try:
            where: dict[str, Any] = started if scheduler is None else {"address": scheduler}
            with distributed.Client(**where) as client:
                futures = client.map(work, tasks, pure=False)  # given up with the client
                for _, result in distributed.as_completed(futures, with_results=True):
                    yield result
        except distributed.KilledWorker as error:
            raise WorkerError(f"Dask gave up: {error}") from None
        except OSError as error:  # Dask's own time-outs and closed connections are among them
            raise WorkerError(
                f"the Dask scheduler {scheduler or ''} can't be reached: {error}"
            ) from None

    return execute
