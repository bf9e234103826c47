"""What the identification's error bars are worth, from a campaign's dataset.

Printed are, for every parameter, how often the 95 % intervals hold the truth and how often the mean
that estimates scatter about, with the bias and how much of it is the structure's; and the shortest
flight time that keeps N_r, L_b and M_a within the paper's bounds of the truth. Where the campaign
varied the sweeps' length alone, a coverage of 90 % is judged at each number and length. Bias,
scatter and coverage at any condition: `helisim study campaign study --by recorder.noise,flights`.

    helisim study campaign scripts/campaigns/study.toml --out study
    python scripts/proof/campaign_study.py study
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import common
import numpy as np
import pyarrow as pa

import helisim as hs
from helisim.study.models import MODELS
from helisim.study.paper import published
from helisim.study.replicates import Summary, errors, read_dataset, summarise
from helisim.study.truth import exact_response

WANTED = (("yaw_base", "N_r"), ("rollpitch_in1", "L_b"), ("rollpitch_in1", "M_a"))
SHARE = 0.95  # Of the replicates that must be within a bound.
LENGTH = "sweep.duration"  # The condition that is mildest where it is greatest.
HELD = 0.90  # Of the replicates whose 95 % intervals must hold the truth.

Row = dict[str, Any]


def select(rows: Sequence[Row], condition: Row) -> list[Row]:
    return [row for row in rows if all(row[name] == value for name, value in condition.items())]


def in_words(condition: Row) -> str:
    return ", ".join(f"{name.split('.')[-1]} {value:g}" for name, value in condition.items())


def verdict(rows: Sequence[Row]) -> None:
    """Print the coverage at each number and length of sweeps, and which fall below `HELD`."""
    lines, by = defaultdict[str, list[Summary]](list), ("flights", LENGTH)
    found = summarise(pa.Table.from_pylist(rows), by=by)
    for one in sorted(found, key=lambda one: [one.group[name] for name in by]):
        method = "" if one.group["method"] == "designed" else f" {one.group['method']}"
        lines[f"{one.model} {one.parameter}{method}"].append(one)
    flown = [f"{n} x {s:g} s" for n, s in sorted({(r["flights"], r[LENGTH]) for r in rows})]
    for head, width, cell in (
        (
            *("bias +- scatter, stated", 26),
            lambda one: f"{100 * one.bias:9.2f} +-{100 * one.scatter:6.2f}{100 * one.stated:8.2f}",
        ),
        ("% in 95 %, of sweeps", 12, lambda one: f"{100 * held(one):.0f}"),
    ):
        print()
        columns = [f"{head}:<24", *(f"{one}:{width}" for one in flown)]
        common.table("|".join(columns), ([name, *map(cell, line)] for name, line in lines.items()))
    for k, what in enumerate(flown):
        low = [name for name, line in lines.items() if not held(line[k]) >= HELD]
        print(f"{what}: " + (f"fail, below {HELD:.0%}: {', '.join(low)}" if low else "pass"))


def held(one: Summary) -> float:
    return one.covered * one.count / (one.count + one.failed)  # no estimate holds no truth


def apart(rows: Sequence[Row], columns: Sequence[str], exact: dict[tuple[str, str], float]) -> None:
    """Print what the 95 % intervals hold: the truth, and the mean that estimates scatter about.

    Beside them the bias, and how much of it is the structure's: the error of the structure that
    is fitted to the exact response.
    """
    lines = []
    for key in dict.fromkeys((row["model"], row["parameter"]) for row in rows):
        mine = [row for row in rows if (row["model"], row["parameter"]) == key and row["estimate"]]
        error, size = errors(mine), np.array([abs(row["truth"]) for row in mine])
        half = 1.96 * np.array([row["standard_error"] for row in mine]) / size
        where = [tuple(row[name] for name in columns) for row in mine]
        means = {one: np.mean([e for e, at in zip(error, where) if at == one]) for one in where}
        about = error - np.array([means[one] for one in where])
        held = [100.0 * np.mean(np.abs(off) <= half) for off in (error, about)]
        own = 100.0 * (exact[key] - mine[0]["truth"]) / size[0] if key in exact else None
        lines.append((" ".join(key), *held, 100.0 * error.mean(), own))
    print(f"\n{'':<24}{'% of intervals that hold':>26}{'bias of the':>26}")
    common.table(
        ":<24|the truth:13.1f|their mean:13.1f|estimate, %:13.2f|structure, %:13.2f", lines
    )


def tended_to(plan: Row) -> dict[tuple[str, str], float]:
    """Return what the structures make of the vehicle's exact response, without any flight.

    Empty if the campaign changed the vehicle, its steady wind or its recorder's latencies.
    """
    sections = {one["section"] for one in plan["settings"]}
    names = {one["name"].split(".")[0] for one in plan["settings"]}
    if "vehicle" in sections or names & {"wind", "latency"}:
        return {}
    vehicle = hs.load(plan["vehicle"])
    found = {}
    for model in MODELS:
        if model.truth_kind != "derivatives" or model.name not in plan["models"]:
            continue
        omega = np.geomspace(*model.band, 200)
        exact = exact_response(vehicle, model, hs.Recorder.of(vehicle), omega)
        fit = hs.identify(exact, model.structure, weighting=model.weighting)
        found |= {(model.name, name): float(value) for name, value in fit.values.items()}
    return found


def shortest(rows: Sequence[Row], columns: Sequence[str]) -> None:
    found = {row["model"] for row in rows}
    bounds = {(model, name): bound(model, name) for model, name in WANTED if model in found}
    if not bounds:
        return
    limits = ", ".join(f"{name} {100 * limit:.3g} %" for (_, name), limit in bounds.items())
    print(f"\nshortest flight time with {SHARE:.0%} of the replicates within the paper's bounds")
    print(f"({limits} of the truth)")
    print("(s of all sweeps together; in brackets sweeps of each axis x s)")
    others, lines = [name for name in columns if name != LENGTH], []
    for values in sorted({tuple(row[name] for name in others) for row in rows}):
        condition = dict(zip(others, values))
        here = select(rows, condition)
        lines.append((in_words(condition), *(need(here, *one) for one in bounds.items())))
    common.table("|".join([":<24", *(f"{name}:18" for _, name in bounds)]), lines)


def need(rows: Sequence[Row], key: tuple[str, str], limit: float) -> str:
    model, parameter = key
    wanted = {"model": model, "parameter": parameter, "method": "designed"}
    enough: list[tuple[float, str]] = []
    for duration in sorted({row.get(LENGTH) for row in rows}):
        mine = select(rows, wanted if duration is None else {**wanted, LENGTH: duration})
        for flights in sorted({row["flights"] for row in mine}, reverse=True):
            some = select(mine, {"flights": flights})
            if (np.abs(errors(some)) <= limit).sum() < SHARE * len(some):
                break
            time = max(row["flight_time"] for row in some if row["flight_time"] is not None)
            how = f"{flights}" if duration is None else f"{flights} x {duration:g}"
            enough.append((time, f"{time:.0f} ({how})"))
    return min(enough)[1] if enough else "not reached"


def bound(model: str, parameter: str) -> float:
    (one,) = (item for item in MODELS if item.name == model)
    printed = published("jr700")[model][parameter]
    return one.paper_tolerance(parameter, printed.cr_percent).percent / 100.0


def main(path: str) -> None:
    table, provenance = read_dataset(path)
    rows = table.to_pylist()
    plan = provenance["campaign"]
    varied = [one for one in plan["settings"] if len(one["values"]) > 1]
    columns = tuple(f"{one['section']}.{one['name']}" for one in varied)
    replicates = len({row["replicate"] for row in rows})
    most = {"flights": max(row["flights"] for row in rows)}
    print(f"{replicates} replicates, {len(rows)} estimates; varied: {', '.join(columns)}")
    print(f"all conditions together, {in_words(most)} on each axis")
    apart(select(rows, most), columns, tended_to(plan))
    if columns == (LENGTH,):
        verdict(rows)
    shortest(rows, columns)


if __name__ == "__main__":
    common.run(main)
