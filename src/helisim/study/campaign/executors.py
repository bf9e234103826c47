"""Who does the work: processes of this machine, or a Dask cluster. Both survive a lost worker."""

import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from signal import SIG_IGN, SIGINT, signal
from threading import Thread
from typing import Any, Protocol, TypeVar

from helisim.base.errors import InputError, WorkerError

Task = TypeVar("Task")
Result = TypeVar("Result")

ONE_THREAD: Mapping[str, str] = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "1"
)
"""What a worker's environment says, as Dask's own: the last bits of a matrix product depend on
the number of threads that compute it, and there is a worker for each processor anyway."""

_LOSSES = 3
"""Workers that may be lost in a row, with nothing finished between, before that is believed."""

Results = Generator[Result, None, None]
"""What an executor yields; closing it stops the work."""


class Executor(Protocol):
    """Applies a function to tasks, in any order, and yields what it returns."""

    def __call__(self, work: Callable[[Task], Result], tasks: Sequence[Task], /) -> Results[Result]:
        """Yield the results as they come."""
        ...


def local(jobs: int | None = None) -> Executor:
    """Return an executor of processes on this machine, one a processor if `jobs` is None.

    Raises:
        InputError: jobs is not an integer of 1 or more.
    """
    count = (os.cpu_count() or 1) if jobs is None else jobs
    if not isinstance(count, int) or count < 1:
        raise InputError(f"jobs must be an integer of 1 or more, got {count}")

    def execute(work: Callable[[Task], Result], tasks: Sequence[Task], /) -> Results[Result]:
        waiting = dict(enumerate(tasks))
        losses = 0
        while waiting:
            try:
                for number, result in _in_processes(work, waiting, min(count, len(waiting))):
                    del waiting[number]
                    losses = 0
                    yield result
            except BrokenProcessPool:
                losses += 1
                if losses >= _LOSSES:
                    raise WorkerError(
                        f"{_LOSSES} worker processes in a row died (out of memory?) with "
                        f"{len(waiting)} replicates left; run again with fewer jobs to go on"
                    ) from None

    return execute


def _in_processes(
    work: Callable[[Task], Result], tasks: Mapping[int, Task], count: int
) -> Iterator[tuple[int, Result]]:
    with _environment(ONE_THREAD), _processes(count) as pool:
        futures = {pool.submit(work, task): number for number, task in tasks.items()}
        for future in as_completed(futures):
            yield futures[future], future.result()


@contextmanager
def _processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Lend a pool of processes; when the block raises, stop them at once."""
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


@contextmanager
def _environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment, which new processes inherit, while the block runs."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


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

    def execute(work: Callable[[Task], Result], tasks: Sequence[Task], /) -> Results[Result]:
        try:
            with _client(distributed, scheduler, jobs) as client:
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


def _client(distributed: Any, scheduler: str | None, jobs: int | None) -> Any:
    if scheduler is not None:
        return distributed.Client(scheduler)
    return distributed.Client(
        n_workers=jobs, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    )
