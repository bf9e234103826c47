"""What the identification's error bars are worth, from a campaign's dataset.

Printed are, for every parameter, how often the 95 % intervals and the Cramér-Rao bounds hold the
truth; how bias and scatter grow with noise and turbulence and fall with the length of the
records; and the shortest flight time that keeps N_r, L_b and M_a within the paper's bounds of the
truth. Conditions are the values of what the campaign varied.

    helisim campaign scripts/campaigns/study.toml --out study
    python scripts/campaign_study.py study
"""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from helisim.campaign import read_dataset
from helisim.campaign.summary import Summary, errors, render, summarise
from helisim.experiment import MODELS
from helisim.reference import jr700

WANTED = (("yaw_base", "N_r"), ("rollpitch_in1", "L_b"), ("rollpitch_in1", "M_a"))
SHARE = 0.95
"""Of the replicates that must be within a bound."""

Row = dict[str, Any]


def conditions(provenance: Row) -> tuple[str, ...]:
    """Return the columns that the campaign varied."""
    settings = provenance["campaign"]["settings"]
    columns = [f"{one['section']}.{one['name']}" for one in settings if varies(one["law"])]
    return tuple(columns)


def varies(law: Row) -> bool:
    """Return whether a law of the plan has more than one value."""
    return len(law.get("values", (0, 1))) > 1


def levels(rows: Sequence[Row], column: str) -> list[Any]:
    """Return the values of a column, mildest first."""
    return sorted({row[column] for row in rows})


def effect(rows: Sequence[Row], column: str, held: dict[str, Any]) -> None:
    """Print bias and scatter at each level of a column, all else at the values held."""
    kept = [row for row in rows if all(row[name] == value for name, value in held.items())]
    values = levels(kept, column)
    told = ", ".join(f"{name} {value:g}" for name, value in held.items())
    print(f"\nbias and scatter, %, against {column} ({told})")
    print(f"  {'parameter':<24}" + "".join(f"{value:>16g}" for value in values))
    found: dict[tuple[str, str], dict[Any, Summary]] = {}
    for one in summarise(pa.Table.from_pylist(kept), by=(column,)):
        name = f"{one.model} {one.parameter}", one.group["method"]
        found.setdefault(name, {})[one.group[column]] = one
    for (name, method), by_level in found.items():
        cells = "".join(
            f"{100 * by_level[v].bias:8.2f} +-{100 * by_level[v].scatter:5.2f}" for v in values
        )
        print(f"  {name:<24}{cells}{'' if method == 'designed' else '  ' + method}")


def shortest(rows: Sequence[Row], columns: Sequence[str]) -> None:
    """Print the shortest flight time within the paper's bounds, for each condition."""
    bounds = {(model, name): bound(model, name) for model, name in WANTED}
    told = ", ".join(f"{name} {100 * limit:.2g} %" for (_, name), limit in bounds.items())
    print(f"\nshortest flight time with {SHARE:.0%} of the replicates within {told} of the truth")
    for condition in sorted({tuple(row[name] for name in columns) for row in rows}):
        here = [row for row in rows if tuple(row[name] for name in columns) == condition]
        where = ", ".join(f"{name} {value:g}" for name, value in zip(columns, condition))
        print(f"  {where:<48}" + "".join(need(here, key, limit) for key, limit in bounds.items()))


def need(rows: Sequence[Row], key: tuple[str, str], limit: float) -> str:
    """Return in words the least flights from which on enough replicates are within a limit."""
    rows = [r for r in rows if (r["model"], r["parameter"], r["method"]) == (*key, "designed")]
    enough = None
    for flights in reversed(levels(rows, "flights")):
        some = [row for row in rows if row["flights"] == flights]
        within = np.abs(errors(some)) <= limit
        if within.sum() < SHARE * len(some):
            break
        enough = max(row["flight_time"] for row in some if row["flight_time"] is not None)
    return f"  {key[1]} " + (f"{enough:5.0f} s" if enough is not None else "  never")


def bound(model: str, parameter: str) -> float:
    """Return the paper's bound on a parameter relative to its size, or what stands in for it."""
    (one,) = (item for item in MODELS if item.name == model)
    published = jr700.table(model)[parameter]
    return one.paper_tolerance(parameter, published.cr_percent).percent / 100.0


def main(path: str) -> None:
    """Print the study."""
    table, provenance = read_dataset(path)
    rows = table.to_pylist()
    columns = conditions(provenance)
    replicates = len({row["replicate"] for row in rows})
    longest = max(levels(rows, "flights"))
    mildest = {name: levels(rows, name)[0] for name in columns}
    print(f"{replicates} replicates, {len(rows)} estimates; varied: {', '.join(columns)}")
    print(f"\nall conditions together, {longest} flights on each axis\n")
    print(render(summarise(pa.Table.from_pylist([r for r in rows if r["flights"] == longest]))))
    for name in columns:
        others = {other: value for other, value in mildest.items() if other != name}
        effect(rows, name, {**others, "flights": longest})
    effect(rows, "flights", mildest)
    shortest(rows, columns)


if __name__ == "__main__":
    main(*sys.argv[1:])
