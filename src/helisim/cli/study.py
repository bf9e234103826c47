"""Commands about the experiment: reproduce it, recover derivatives, vary it, and its report."""

from pathlib import Path

from helisim.base.errors import InputError
from helisim.cli.options import (
    Options,
    coloured,
    parameters,
    print_written,
    progress,
    write_recording,
)


def reproduce(o: Options) -> int:
    """Fly the paper's experiment, identify its models, compare.

    Fly sweeps on all four axes, identify the paper's models, and print them beside the paper and
    the exact linearisation.

    Options:
        --out DIR <=reproduction>  folder of results.json and flights/ (default: reproduction)
        --flights N <=10>  kept on each axis (default: 10)
        @jobs
        @seed: of pilot and sensors
        @rerun
        @set
        --verbose  what each fit was given, too, the verification, the gyro's effect, eq. (8)
        @quiet

    example: helisim reproduce --out reproduction --flights 10 --seed 1

    Exit status 1: a tolerance is missed.
    """
    from tqdm import tqdm

    from helisim.show.report import write_report
    from helisim.show.terminal import render_comparison, render_results
    from helisim.study.experiment import flights_in_all, reproduce
    from helisim.study.models import MODELS

    with progress(flights_in_all(o.flights) + len(MODELS) + 1, o.quiet) as advance:
        run = reproduce(
            out=o.out,
            flights=o.flights,
            seed=o.seed,
            jobs=o.jobs,
            parameters=parameters(o),
            rotor=o.rerun is not None,
            on_progress=advance,
            on_table=lambda one: tqdm.write(
                coloured(f"{render_comparison(one, verbose=o.verbose)}\n")
            ),
        )
        write_report(o.out, run)
        advance("report")
    print(coloured(render_results(run.results, verbose=o.verbose, printed=True)))
    results = f"{o.out / 'results.json'}, records in {o.out / 'flights'}"
    print_written(o, results, o.out / "report.html")
    if o.rerun is not None:
        write_recording(
            o,
            o.rerun,
            {
                f"{axis}_{k + 1:02d}": record
                for axis, some in run.flights.items()
                for k, record in enumerate(some)
            },
        )
    return 1 if run.results.misses else 0


def study(_: Options) -> None:
    """Recover derivatives, fly many replicates, list the paper's errors.

    What the paper's experiment says of other vehicles and of its own error bars.

    examples:
      helisim study recover --vehicle blade360 --flights 3
      helisim study campaign noise.toml
      helisim study errata
    """


def study_recover(o: Options) -> int:
    """Sweep a vehicle and recover its derivatives.

    Sweep all four axes, identify yaw, roll-pitch and heave, and print them beside the exact
    linearisation and published values.

    Options:
        @vehicle
        --flights N <=3>  kept on each axis (default: 3)
        @seed: of pilots and sensors
        @jobs
        @set
        --verbose  what each fit was given, too
        @quiet

    example: helisim study recover --vehicle blade360 --flights 3
    """
    from helisim.show.terminal import render_results
    from helisim.study.experiment import flights_in_all, recover

    with progress(flights_in_all(o.flights) + 3, o.quiet) as advance:
        results = recover(
            o.vehicle,
            flights=o.flights,
            seed=o.seed,
            jobs=o.jobs,
            parameters=parameters(o),
            on_progress=advance,
        )
    print(coloured(render_results(results, verbose=o.verbose)))
    return 1 if results.misses else 0


def report(o: Options) -> int | None:
    """Write the page of a run, or of an ArduPilot log.

    Write DIR/report.html and DIR/figures again, from the results of helisim reproduce in DIR; or of
    a log FLIGHT.bin what helisim tune finds, as FLIGHT.html with FLIGHT.param beside it.

    Options:
        source FILE|DIR  folder of a run, or log of ArduCopter-heli, .bin, or of
            Rotorflight
        @quiet

    examples:
      helisim report reproduction
      helisim report flight.bin
    """
    if o.source.is_file():
        from helisim.cli.design import tune_logs

        o.json, o.rpm, o.tail_ratio, o.dump, o.logs = None, None, None, None, [o.source]
        o.report, o.out = map(o.source.with_suffix, (".html", ".param"))
        return tune_logs(o)
    from helisim.show.report import write_report

    path = write_report(o.source)
    print_written(o, f"{path}, figures in {path.parent / 'figures'}")


def study_errata(_: Options) -> None:
    """List the paper's errors, each with its calculation.

    List what the paper's own numbers contradict, each computed as it is printed.

    example: helisim study errata
    """
    from helisim.show.terminal import render_errata
    from helisim.study.errata import errata

    print(render_errata(errata()))


def study_campaign(o: Options) -> None:
    """Fly and identify many replicates, with what you vary.

    Fly and identify many replicates as a campaign file says, write a Parquet dataset of
    parameters, truth, estimates and bounds, and print how well they agree.

    Options:
        file FILE  campaign file, .toml; or the folder of a dataset
        --out DIR  folder of the dataset (default: FILE's name)
        --dask ADDRESS <maybe=>  on Dask, with this scheduler or one started here
        --jobs J <int>  workers (default: all processors)
        --by COLUMNS <names>  summarise for each value of these columns
        @quiet

    examples:
      helisim study campaign noise.toml                       into the folder noise/
      helisim study campaign noise.toml --dask tcp://127.0.0.1:8786
      helisim study campaign noise --by recorder.noise        only summarise

    A campaign that was interrupted goes on where it stopped. Its file, TOML:

      [campaign]
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

      [vary.recorder]              # every combination of what varies is a point
      noise = { values = [1, 4], relative = true }

      [vary.weather]               # wind, turbulence, gust.down, ... of hs.Weather
      turbulence = [0, 3]          # wind at 20 ft, m/s; 0 is calm

      [vary.vehicle]
      main_rotor.hub_stiffness = { values = [0.8, 1, 1.2], relative = true }
    """
    from helisim.study.replicates import read_dataset, render, summarise

    path = o.file
    if not path.is_dir() and path.suffix != ".parquet":
        path = _fly_campaign(o)
    elif o.out is not None:
        raise InputError(f"{path} is a dataset, which is only looked at: leave out --out")
    table, _ = read_dataset(path)
    print(render(summarise(table, by=o.by or ())))


def _fly_campaign(o: Options) -> Path:
    from helisim.study.campaign import read_campaign
    from helisim.study.executors import local, on_dask
    from helisim.study.replicates import run_campaign

    campaign = read_campaign(o.file)
    executor = on_dask(o.dask or None, o.jobs) if o.dask is not None else local(o.jobs)
    with progress(len(campaign), o.quiet) as advance:
        path = run_campaign(
            campaign,
            o.out or o.file.with_suffix(""),
            executor=executor,
            on_replicate=lambda: advance("replicate"),
        )
    print(f"Written: {path} ({len(campaign)} replicates)\n")
    return path
