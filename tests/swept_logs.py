"""Logs of sweeps for tests of the command line: as helisim records them, and as others do."""

import csv

import numpy as np
import plants
from closed_loop import coloured, sweep

from helisim.ident import structures
from tabled import rows

HEAVE = {"Z_w": -0.8, "Z_col": -25.0, "tau_col": 0.03}


def flown(structure, values, axis, seed, *, duration=60.0, noise=0.0, jitter=False):
    random = np.random.default_rng(seed)
    inputs = np.zeros((round(duration * plants.RATE), len(structure.inputs)))
    for k, name in enumerate(structure.inputs):
        inputs[:, k] = (
            sweep(duration, (1.0, 40.0), 0.1, plants.RATE)
            if name == axis
            else coloured(random, inputs.shape[0], 0.003, 20.0, plants.RATE)
        )
    outputs = plants.respond(structure, values, inputs)
    if jitter:  # steps from 0.5 to 20.5 ms, on the simulation's grid
        rows = np.cumsum(random.integers(1, 42, size=inputs.shape[0] // 21))
        rows = rows[rows < inputs.shape[0]]
    else:
        rows = np.arange(0, inputs.shape[0], plants.KEEP)
    outputs = outputs[rows] + noise * random.standard_normal((rows.size, outputs.shape[1]))
    return rows / plants.RATE, inputs[rows], outputs


def write_foreign(path, headings, time, columns, *, delimiter=";", encoding="utf-8"):
    with path.open("w", newline="", encoding=encoding) as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerow(headings)
        for row in zip(time, *columns):
            writer.writerow([f"{cell:.10g}" for cell in row])


def csv_writer(folder):
    time, inputs, outputs = flown(structures.heave, HEAVE, "col", 5, duration=30.0, noise=0.01)
    rows = [[f"{cell:.8g}" for cell in row] for row in zip(time, inputs[:, 0], outputs[:, 0])]

    def write(change=lambda rows: rows, header="t [s],col [1],w [m/s]", name="bad.csv"):
        path = folder / name
        lines = [header, *(",".join(row) for row in change([list(row) for row in rows]))]
        path.write_text("\n".join(lines) + "\n")
        return path

    return write


BAD = dict(rows(globals(), "BAD"))
"""What may be wrong with the rows of a sweep as `csv_writer` writes it."""
