"""Workers that die: nothing is lost, and the numbers are those of any other executor."""

import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path

import pytest
from mortal import always_die, fail, square

from helisim.base.errors import WorkerError
from helisim.study.campaign import campaign_from
from helisim.study.executors import local, on_dask
from helisim.study.replicates import run_campaign

pytestmark = pytest.mark.study

NO_DASK = "Dask isn't installed: pip install -e '.[dask]'"
PLAN = {
    "campaign": {"replicates": 3, "models": ["yaw_base"], "flights": 1},
    "set": {"sweep": {"duration": 30}},
    "vary": {"recorder": {"noise": {"values": [0.5, 4], "relative": True}}},
}


def plan():
    return campaign_from(PLAN)


def assert_no_process_is_left():
    # They were told to stop, and need a moment; and where the pool's own thread has just waited
    # for one, Python counts it as running until that thread has noted its end.
    wait_until(lambda: not active_children())


def test_processes_stop_when_one_dies_when_the_work_fails_and_when_left_early():
    assert sorted(local(2)(square, range(8))) == [square(number) for number in range(8)]
    with pytest.raises(WorkerError, match="with 1 replicates left; run again"):
        list(local(1)(always_die, [1]))
    assert_no_process_is_left()
    with pytest.raises(ZeroDivisionError):
        list(local(1)(fail, [1, 2]))
    assert_no_process_is_left()
    results = local(2)(square, range(100))
    next(results)
    results.close()
    assert_no_process_is_left()


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    script = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from mortal import linger
from helisim.study.executors import local
if __name__ == "__main__":
    list(local(2)(linger, [Path({str(tmp_path)!r})] * 2))
"""
    (tmp_path / "parent.py").write_text(script)
    command = [sys.executable, str(tmp_path / "parent.py")]
    parent = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        wait_until(lambda: len(list(tmp_path.glob("*.pid"))) == 2)
    finally:
        parent.kill()
        parent.wait()
    workers = [int(path.stem) for path in tmp_path.glob("*.pid")]
    assert len(workers) == 2
    wait_until(lambda: not any(map(runs, workers)))
    assert [worker for worker in workers if runs(worker)] == []


def wait_until(happened):
    for _ in range(1200):
        if happened():
            return
        time.sleep(0.05)
    raise AssertionError("not within a minute")


def runs(pid):
    """Return whether a process exists; one that ended but that nobody waited for doesn't."""
    try:
        os.kill(pid, 0)
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except ProcessLookupError:
        return False
    except FileNotFoundError:  # no such folder here, or it has just ended: ask again
        return True


@pytest.fixture(scope="module")
def by_processes(tmp_path_factory) -> Path:
    killed = []

    def kill_one():
        if not killed:
            child = active_children()[0]
            killed.append(child.pid)
            child.kill()

    folder = tmp_path_factory.mktemp("processes")
    with pytest.raises(WorkerError):
        run_campaign(plan(), folder, executor=local(2), on_replicate=kill_one)
    return run_campaign(plan(), folder, executor=local(2))


def test_a_dask_cluster_that_loses_a_worker_gives_the_same_bytes(by_processes, tmp_path):
    distributed = pytest.importorskip("distributed", reason=NO_DASK)
    asked = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    cluster = distributed.LocalCluster(**asked, host="127.0.0.1")
    with cluster, distributed.Client(cluster) as client:
        killed = []

        def kill_one():
            if not killed:
                killed.extend(client.run(os.getpid).values())
                os.kill(killed[0], signal.SIGKILL)

        workers = on_dask(cluster.scheduler_address)
        path = run_campaign(plan(), tmp_path, executor=workers, on_replicate=kill_one)
        assert killed[0] not in client.run(os.getpid).values()
    assert path.read_bytes() == by_processes.read_bytes()


def test_a_scheduler_that_is_not_there_is_said():
    pytest.importorskip("distributed", reason=NO_DASK)
    from dask import config

    with (
        config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(WorkerError, match=r"tcp://127\.0\.0\.1:9"),
    ):
        list(on_dask("tcp://127.0.0.1:9")(square, [1]))
