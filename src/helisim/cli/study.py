"""Commands about the experiment: reproduce it, recover derivatives, vary it, and its report."""

import sys
from dataclasses import asdict
from pathlib import Path

from helisim.base.errors import InputError
from helisim.cli.options import (
    Options,
    Progress,
    parameters,
    print_json,
    print_written,
    write_recording,
)


def reproduce(o: Options) -> int:
    """Fly the paper's experiment, identify its models, compare.

    Fly sweeps on all four axes, identify the paper's models from the records, and print them beside
    the paper and the exact linearisation of the model that flew.

    Options:
        --from/run_folder DIR  repeat the run in DIR as it says that it was made, and compare:
            records to the byte, results to the last digit
        --out DIR  folder of results.json and flights/ (default: reproduction; with --from none)
        --flights N  kept on each axis (default: 10)
        @jobs
        --timestep S  of the simulation, s
        --reuse  identify the flights in DIR again instead of flying
        --json  print results.json, no tables
        --seed S <int>  of pilot and sensors (default: 1)
        @rerun
        @set
        @quiet

    examples:
      helisim reproduce --out reproduction --flights 10 --seed 1
      helisim reproduce --from reproduction       is every number the same again?

    Exit status 1: a tolerance is missed; with --from, a number differs.
    """
    from helisim.show.report import write_report
    from helisim.show.terminal import render_results, wants_color
    from helisim.study.experiment import flights_in_all, named_records, reproduce
    from helisim.study.models import MODELS

    if o.run_folder is not None:
        return _repeat(o)
    flights, out = 10 if o.flights is None else o.flights, o.out or Path("reproduction")
    if flights < 1:
        raise InputError(f"--flights must be 1 or more, got {flights}")
    flown = 0 if o.reuse else flights_in_all(flights)
    with Progress(flown + len(MODELS) + 1, o.quiet) as advance:
        run = reproduce(
            out=out,
            flights=flights,
            seed=1 if o.seed is None else o.seed,
            jobs=o.jobs,
            parameters=parameters(o),
            timestep=o.timestep,
            rotor=o.rerun is not None,
            reuse=o.reuse,
            on_progress=advance,
        )
        write_report(out, run)
        advance("report")
    if o.json:
        print_json(run.results.to_dict())
    else:
        print(render_results(run.results, color=wants_color(sys.stdout)))
        results = f"{out / 'results.json'}, records in {out / 'flights'}"
        print_written(o, results, out / "report.html")
    if o.rerun is not None:
        write_recording(o.rerun, named_records(run.flights), run=run, quiet=o.quiet or o.json)
    return 1 if run.results.misses else 0


def _repeat(o: Options) -> int:
    """Repeat a run as it says that it was made, and compare. Return the exit status."""
    from helisim.show.report import write_report
    from helisim.study.experiment import flights_in_all
    from helisim.study.models import MODELS
    from helisim.study.replay import arguments_of, repeat

    own = ("flights", "seed", "timestep", "set", "reuse", "rerun")
    given = [f"--{name}" for name in own if getattr(o, name) not in (None, [], False)]
    if given:
        raise InputError(f"--from repeats a run with its own options: leave out {', '.join(given)}")
    flights = arguments_of(o.run_folder).flights
    steps = flights_in_all(flights) + len(MODELS) + (o.out is not None)
    with Progress(steps, o.quiet) as advance:
        found = repeat(o.run_folder, out=o.out, jobs=o.jobs, on_progress=advance)
        if o.out is not None:
            write_report(o.out)
            advance("report")
    if o.json:
        print_json(found.to_dict())
    else:
        print(found)
    return 0 if found.same else 1


def recover(o: Options) -> int:
    """Sweep a vehicle and recover its derivatives.

    Sweep a vehicle on all four axes, identify yaw, roll-pitch and heave from the records, and print
    them beside the exact linearisation and what is published.

    Options:
        @vehicle
        --flights N <=3>  kept on each axis (default: 3)
        @seed: of pilots and sensors
        @jobs
        --json  print the results as JSON
        @set
        @quiet

    example: helisim recover blade360 --flights 3
    """
    from helisim.show.terminal import render_results, wants_color
    from helisim.study.experiment import flights_in_all, recover

    with Progress(flights_in_all(max(1, o.flights)) + 3, o.quiet) as advance:
        results = recover(
            o.vehicle,
            flights=o.flights,
            seed=o.seed,
            jobs=o.jobs,
            parameters=parameters(o),
            on_progress=advance,
        )
    if o.json:
        print_json(results.to_dict())
    else:
        print(render_results(results, color=wants_color(sys.stdout)))
    return 1 if results.misses else 0


def report(o: Options) -> int:
    """Write a run's report again.

    Write DIR/report.html and DIR/figures again, from the files that helisim reproduce left in DIR:
    results.json, fits.json and flights/.

    Options:
        folder DIR  folder of a run
        @quiet

    example: helisim report reproduction
    """
    from helisim.show.report import write_report

    path = write_report(o.folder)
    print_written(o, f"{path}, figures in {path.parent / 'figures'}")
    return 0


def errata(o: Options) -> int:
    """List the paper's errors, each with its calculation.

    List what the paper's own numbers contradict, each computed as it is printed.

    Options:
        --json  as JSON

    example: helisim errata --json
    """
    from helisim.show.terminal import render_errata
    from helisim.study.errata import errata

    found = errata()
    if o.json:
        print_json([asdict(erratum) for erratum in found])
    else:
        print(render_errata(found))
    return 0


def campaign(o: Options) -> int:
    """Fly and identify many replicates, with what you vary.

    Fly and identify the experiment again and again as a campaign file says, write one Parquet
    dataset of parameters, truth, estimates and bounds, and print how well the truth was found and
    the bounds hold.

    Options:
        file FILE  campaign file, .toml; or the folder of a dataset
        --out DIR  folder of the dataset (default: FILE's name)
        --executor local|dask <=local>  processes of this machine, or a Dask cluster (default:
            local)
        --scheduler ADDRESS  of the Dask cluster (default: one that is started on this machine)
        --jobs J <int>  workers (default: all processors)
        --by COLUMNS <names>  summarise for each value of these columns, such as
            flights,recorder.noise
        @quiet

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
    from helisim.study.replicates import read_dataset, render, summarise

    path = o.file
    if not path.is_dir() and path.suffix != ".parquet":
        path = _fly_campaign(o)
    elif o.out is not None:
        raise InputError(f"{path} is a dataset, which is only looked at: leave out --out")
    table, _ = read_dataset(path)
    print(render(summarise(table, by=o.by or ())))
    return 0


def _fly_campaign(o: Options) -> Path:
    from helisim.study.campaign import read_campaign
    from helisim.study.executors import local, on_dask
    from helisim.study.replicates import run_campaign

    campaign = read_campaign(o.file)
    folder = o.out or o.file.with_suffix("")
    if o.executor not in ("local", "dask"):
        raise InputError(f"--executor must be local or dask, got {o.executor!r}")
    if o.executor == "local" and o.scheduler is not None:
        raise InputError("--scheduler is for --executor dask")
    executor = local(o.jobs) if o.executor == "local" else on_dask(o.scheduler, o.jobs)
    with Progress(len(campaign), o.quiet) as advance:
        done = {"executor": executor, "on_replicate": lambda: advance("replicate")}
        path = run_campaign(campaign, folder, **done)
    print(f"Written: {path} ({len(campaign)} replicates)\n")
    return path
