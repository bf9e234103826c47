"""The same campaign by local processes and on a Dask cluster that loses a worker on the way.

The cluster is two worker processes of this machine, which listen on 127.0.0.1 only; one is killed
after the first replicate. Printed are the datasets' digests, which must be equal.

    pip install helisim[dask]
    python scripts/proof/campaign_cluster.py
"""

import hashlib
import os
import signal
import tempfile
from pathlib import Path

from distributed import Client, LocalCluster

from helisim.study.campaign import campaign_from, local, on_dask, run_campaign

CAMPAIGN = {
    "campaign": {"replicates": 3, "models": ["heave"], "flights": 1},
    "set": {"sweep": {"duration": 40}},
    "vary": {"recorder": {"noise": {"values": [1, 4], "relative": True}}},
}


def digest(path: Path) -> str:
    """Return the SHA-256 of a file, shortened."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def on_a_cluster_that_loses_a_worker(folder: Path) -> Path:
    """Run the campaign and kill a worker after the first replicate."""
    cluster = LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    )
    with cluster, Client(cluster) as client:
        workers = list(client.run(os.getpid).values())
        print(f"Dask at {cluster.scheduler_address}, worker processes {workers}")
        done: list[int] = []

        def kill_one() -> None:
            done.append(len(done))
            print(f"  replicate {len(done)} of {len(campaign)} is in")
            if len(done) == 1:
                os.kill(workers[0], signal.SIGKILL)
                print(f"  killed worker {workers[0]}")

        executor = on_dask(cluster.scheduler_address)
        path = run_campaign(campaign, folder, executor=executor, on_replicate=kill_one)
        print(f"  worker processes now {list(client.run(os.getpid).values())}")
    return path


def main() -> None:
    """Run both and compare."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        here = run_campaign(campaign, folder / "local", executor=local(2))
        print(f"local, 2 processes    {digest(here)}")
        there = on_a_cluster_that_loses_a_worker(folder / "dask")
        print(f"Dask, 2 workers       {digest(there)}")
        same = here.read_bytes() == there.read_bytes()
    print("identical datasets" if same else "the datasets differ")
    raise SystemExit(not same)


if __name__ == "__main__":
    campaign = campaign_from(CAMPAIGN)
    main()
