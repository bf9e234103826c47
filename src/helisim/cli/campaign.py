"""`helisim campaign`: the experiment many times over."""

import argparse
from pathlib import Path
from typing import Any

from helisim.base.errors import InputError
from helisim.cli.common import add_quiet, names
from helisim.cli.progress import Progress

_EPILOG = """\
examples:
  helisim campaign noise.toml                       into the folder noise/
  helisim campaign noise.toml --executor dask --scheduler tcp://127.0.0.1:8786
  helisim campaign noise --by recorder.noise        only look at what it found

A campaign that was interrupted goes on where it stopped. Its file, TOML:

  [campaign]
  design = "grid"              # "latin hypercube", "monte carlo": points = N
  replicates = 10              # of each point
  seed = 1
  integrator = "RK4"           # or "Euler", which costs less
  models = ["yaw_base", "rollpitch_in1"]
  flights = 10                 # on each axis
  identified_after = [2, 10]   # of them
  methods = ["joint", "direct"]  # or "designed", as the experiment says

  [campaign.sweeps]            # pooled in place of the experiment's
  yaw_base = ["ped", "lat"]

  [set.sweep]                  # in all; or pilot, recorder, weather, vehicle
  duration = 60

  [vary.recorder]              # a list, { low, high }, or { mean, std }
  noise = { values = [1, 4], relative = true }

  [vary.weather]               # wind, turbulence, gust.down, ... of hs.Weather
  turbulence = [0, 3]          # wind at 20 ft, m/s; 0 is calm. The truth of
                               # gusty air is the mean over the winds met

  [vary.vehicle."main_rotor.hub_stiffness"]
  low = 0.8
  high = 1.2
  count = 3
  relative = true
"""


def add(commands: Any) -> None:
    """Add the command to the parser."""
    command = commands.add_parser(
        "campaign",
        help="fly and identify many replicates, with what you vary",
        description="Fly and identify the experiment again and again as a campaign file says, "
        "write one Parquet dataset of parameters, truth, estimates and bounds, and print how "
        "well the truth was found and the bounds hold.",
        epilog=_EPILOG,
    )
    command.add_argument(
        "file", type=Path, metavar="FILE", help="campaign file, .toml; or the folder of a dataset"
    )
    command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the dataset (default: FILE's name)"
    )
    command.add_argument(
        "--executor",
        default="local",
        metavar="local|dask",
        help="processes of this machine, or a Dask cluster (default: local)",
    )
    command.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of the Dask cluster (default: one that is started on this machine)",
    )
    command.add_argument("--jobs", type=int, metavar="J", help="workers (default: all processors)")
    command.add_argument(
        "--by",
        default="",
        metavar="COLUMNS",
        help="summarise for each value of these columns, such as flights,recorder.noise",
    )
    add_quiet(command)
    command.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from helisim.study.campaign import read_dataset
    from helisim.study.campaign.summary import render, summarise

    path = options.file
    if not path.is_dir() and path.suffix != ".parquet":
        path = _fly(options)
    elif options.out is not None:
        raise InputError(f"{path} is a dataset, which is only looked at: leave out --out")
    table, _ = read_dataset(path)
    print(render(summarise(table, by=names(options.by))))
    return 0


def _fly(options: argparse.Namespace) -> Path:
    from helisim.study.campaign import read_campaign, run_campaign

    campaign = read_campaign(options.file)
    folder = options.out or options.file.with_suffix("")
    with Progress(len(campaign), options.quiet) as advance:
        path = run_campaign(
            campaign,
            folder,
            executor=_executor(options),
            on_replicate=lambda: advance("replicate"),
        )
    print(f"Written: {path} ({len(campaign)} replicates)\n")
    return path


def _executor(options: argparse.Namespace) -> Any:
    from helisim.study.campaign import local, on_dask

    if options.executor == "dask":
        return on_dask(options.scheduler, options.jobs)
    if options.executor != "local":
        raise InputError(f"--executor must be local or dask, got {options.executor!r}")
    if options.scheduler is not None:
        raise InputError("--scheduler is for --executor dask")
    return local(options.jobs)
