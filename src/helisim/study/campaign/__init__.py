"""Campaigns: the experiment again and again, with vehicles, noise, sweeps and seeds that vary."""

from helisim.study.campaign.dataset import read_dataset
from helisim.study.campaign.executors import Executor, local, on_dask
from helisim.study.campaign.plan import Campaign, campaign_from, read_campaign
from helisim.study.campaign.run import run_campaign

__all__ = [
    "Campaign",
    "Executor",
    "campaign_from",
    "local",
    "on_dask",
    "read_campaign",
    "read_dataset",
    "run_campaign",
]
