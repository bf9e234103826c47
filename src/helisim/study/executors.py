"""Executors of a campaign: processes of this machine, or a Dask cluster; workers may be lost."""

import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any

from helisim.base.errors import InputError, WorkerError

ONE_THREAD: Mapping[str, str] = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "1"
)
"""What a worker's environment says, as Dask's own: the last bits of a matrix product depend on
the number of threads that compute it, and there is a worker for each processor anyway."""

_LOSSES = 3
"""Workers that may be lost in a row, with nothing finished between, before that is believed."""

Work = Callable[[Any], Any]
Results = Generator[Any, None, None]
"""What an executor yields; closing it stops the work."""
Executor = Callable[[Work, Sequence[Any]], Results]
"""Applies a function to tasks, in any order, and yields what it returns."""


def local(jobs: int | None = None) -> Executor:
    """Return an executor of processes on this machine, one a processor if `jobs` is None.

    Raises:
        InputError: jobs is not an integer of 1 or more.
    """
    count = (os.cpu_count() or 1) if jobs is None else jobs
    if not isinstance(count, int) or count < 1:
        raise InputError(f"jobs must be an integer of 1 or more, got {count}")

    def execute(work: Work, tasks: Sequence[Any], /) -> Results:
        waiting = dict(enumerate(tasks))
        losses = 0
        while waiting:
            try:
                with _processes(min(count, len(waiting))) as pool:
                    futures = {pool.submit(work, task): k for k, task in waiting.items()}
                    for future in as_completed(futures):
                        result = future.result()
                        del waiting[futures[future]]
                        losses = 0
                        yield result
            except BrokenProcessPool:
                losses += 1
                if losses >= _LOSSES:
                    raise WorkerError(
                        f"{_LOSSES} worker processes in a row died (out of memory?) with "
                        f"{len(waiting)} replicates left; run again with fewer jobs to go on",
                        remedy="jobs",
                    ) from None

    return execute


@contextmanager
def _processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Lend a pool of processes, each with one thread; stop them at once when the block raises."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)  # which new processes inherit
    others = set(active_children())
    pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_begin)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(active_children()) - others:
            child.terminate()
        raise
    finally:
        pool.shutdown()
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _begin() -> None:
    """Prepare a worker process: it outlives an interrupt, but not its parent."""
    signal(SIGINT, SIG_IGN)  # the parent's to handle: it reaches the whole group of a terminal
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait for the parent's death, however it comes, and end; the pool would wait for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def on_dask(scheduler: str | None = None, jobs: int | None = None) -> Executor:
    """Return an executor of a Dask cluster.

    Args:
        scheduler: its address, such as "tcp://127.0.0.1:8786"; None starts a cluster of
            processes on this machine, which listens on 127.0.0.1 only.
        jobs: workers of the started cluster; one a processor if None.

    Raises:
        InputError: Dask isn't installed, or the arguments don't agree.
    """
    try:
        import distributed
    except ImportError:
        raise InputError("Dask isn't installed: pip install helisim[dask]") from None
    if scheduler is not None and jobs is not None:
        raise InputError("jobs are for a cluster started here: leave out jobs or scheduler")
    started: dict[str, Any] = {"n_workers": jobs, "threads_per_worker": 1, "host": "127.0.0.1"}
    started |= {"dashboard_address": None}

    def execute(work: Work, tasks: Sequence[Any], /) -> Results:
        try:
            where: dict[str, Any] = started if scheduler is None else {"address": scheduler}
            with distributed.Client(**where) as client:
                futures = client.map(work, tasks, pure=False)
                try:
                    for _, result in distributed.as_completed(futures, with_results=True):
                        yield result
                finally:
                    client.cancel(futures)
        except distributed.KilledWorker as error:
            raise WorkerError(f"Dask gave up: {error}") from None
        except OSError as error:  # Dask's own time-outs and closed connections are among them
            raise WorkerError(
                f"the Dask scheduler {scheduler or ''} can't be reached: {error}"
            ) from None

    return execute
