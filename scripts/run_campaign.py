"""Vary the recorder's noise, identify heave at each level, and look at what came of it.

python scripts/run_campaign.py [FOLDER [REPLICATES]]
"""

import sys

from helisim.study.campaign import campaign_from
from helisim.study.replicates import read_dataset, render, run_campaign, summarise


def main(folder: str = "noise", replicates: int = 5) -> None:
    """Print bias, scatter and coverage at each level, and where each estimate of Z_w came out."""
    campaign = campaign_from(
        {
            "campaign": {"replicates": replicates, "models": ["heave"], "flights": 2},
            "set": {"sweep": {"duration": 60}},
            "vary": {"recorder": {"noise": {"values": [1, 4], "relative": True}}},
        }
    )
    # where it was interrupted it goes on; what is complete is not flown again
    table, _ = read_dataset(run_campaign(campaign, folder))
    print(render(summarise(table, by=["recorder.noise"])))
    print("\nreplicate  noise      Z_w    truth")
    for row in table.to_pylist():  # a row for each parameter of each model, identified once
        if row["parameter"] == "Z_w" and row["failure"] is None:
            print(
                f"{row['replicate']:9}{row['recorder.noise']:7g}"
                f"{row['estimate']:9.3f}{row['truth']:9.3f}"
            )


if __name__ == "__main__":  # the workers are processes that import this file
    main(*sys.argv[1:2], *map(int, sys.argv[2:3]))
