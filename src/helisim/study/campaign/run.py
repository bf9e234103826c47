"""Run a campaign: do what is missing, keep each replicate, make one dataset in the end."""

import os
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from helisim.base.errors import WorkerError
from helisim.records.provenance import difference, versions
from helisim.study.campaign.dataset import Dataset
from helisim.study.campaign.executors import ONE_THREAD, Executor, local
from helisim.study.campaign.plan import Campaign, Replicate
from helisim.study.campaign.replicate import ReplicateRow, fly_and_identify


@dataclass(frozen=True)
class _Task:
    """What is sent to a worker."""

    campaign: Campaign
    replicate: Replicate
    versions: dict[str, str]


def run_campaign(
    campaign: Campaign,
    folder: str | Path,
    *,
    executor: Executor | None = None,
    on_replicate: Callable[[], None] | None = None,
) -> Path:
    """Fly and identify every replicate that the folder doesn't hold yet.

    The dataset's bytes depend on the campaign and on the versions of the libraries, not on the
    executor, its workers, or how often the campaign was interrupted.

    Args:
        campaign: to run.
        folder: of `parts/`, a file for each finished replicate, which in the end become
            `dataset.parquet`.
        executor: `local()` if None.
        on_replicate: called once for each replicate that is there, for progress.

    Returns:
        The path of the dataset.

    Raises:
        InputError: the folder holds another campaign.
        StorageError: the folder can't be made or written.
        WorkerError: workers were lost again and again, or can't be used.
    """
    dataset = Dataset(Path(folder), campaign)
    missing = dataset.missing()
    on_replicate = on_replicate or (lambda: None)
    for _ in range(len(campaign) - len(missing)):
        on_replicate()
    if missing:
        dataset.prepare()
        tasks = [_Task(campaign, one, dict(versions())) for one in missing]
        with closing((executor or local())(_work, tasks)) as finished:  # stops what still runs
            for number, rows in finished:
                dataset.add(number, rows)
                on_replicate()
    return dataset.compact()


def _work(task: _Task) -> tuple[int, list[ReplicateRow]]:
    """Do one replicate, in a worker. Raises WorkerError where its numbers would differ."""
    change = difference(versions(), task.versions)
    if change:
        raise WorkerError(f"a worker can't give the same numbers: {change} (its version there)")
    for name, count in ONE_THREAD.items():
        if os.environ.get(name) != count:
            raise WorkerError(
                f"a worker can't give the same numbers: start it with {name}={count}, as Dask's "
                "nanny does"
            )
    return task.replicate.number, fly_and_identify(task.campaign, task.replicate)
