"""What a run found, for Rerun: each model's figures and numbers, the table, the steps."""

import json

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from helisim.ident import Fit, FrequencyResponse
from helisim.output import tables
from helisim.output.drawings import bode_drawings, verification_drawings
from helisim.output.table import as_markdown
from helisim.output.timelines import STEP, time_column
from helisim.study.run import Run


def figure_entities(run: Run) -> dict[str, tuple[str, ...]]:
    """Return the entities of the figures of each model."""
    return {
        item.name: (
            *(
                f"models/{item.name}/{output}_{input_}/figure"
                for output in item.fit.structure.outputs
                for input_ in item.fit.structure.inputs
            ),
            *(
                f"models/{item.name}/time_{k + 1}/figure"
                for k in range(len(item.verification.traces) if item.verification else 0)
            ),
        )
        for item in run.models
    }


def log_findings(recording: rr.RecordingStream, run: Run) -> None:
    """Log all that was found, below the entity `models`."""
    recording.send_property(
        "run", rr.AnyValues(results=json.dumps(run.results.to_dict(), sort_keys=True))
    )
    for item in run.models:
        pictures = [*bode_drawings(item), *verification_drawings(item)]
        for entity, drawing in zip(figure_entities(run)[item.name], pictures):
            image = rr.EncodedImage(contents=drawing.png, media_type="image/png")
            recording.log(entity, image, static=True)
        for output in item.fit.structure.outputs:
            for input_ in item.fit.structure.inputs:
                numbers = _numbers(item.fit, item.exact, output, input_)
                entity = f"models/{item.name}/{output}_{input_}/numbers"
                recording.log(entity, rr.AnyValues(drop_untyped_nones=True, **numbers), static=True)
    text = rr.TextDocument(_markdown(run), media_type="text/markdown")
    recording.log("models/table", text, static=True)
    steps = _steps(run)
    recording.send_columns(
        "models/log",
        indexes=[
            rr.TimeColumn(STEP, sequence=range(len(steps))),
            time_column(np.zeros(len(steps))),  # the flights' clock too, or the viewer shows none
        ],
        columns=rr.TextLog.columns(text=steps, level=["INFO"] * len(steps)),
    )


def _numbers(
    fit: Fit, exact: FrequencyResponse | None, output: str, input_: str
) -> dict[str, NDArray[np.float64]]:
    """Return the columns behind a figure: complex ones as real and imaginary parts."""
    data, model = fit.data, fit.response(fit.data.frequency)
    pair = data.index(output, input_)
    columns = {
        "frequency_rad_s": data.frequency,
        "data_real": data.response[pair].real,
        "data_imag": data.response[pair].imag,
        "coherence": data.coherence[pair],
        "random_error": data.random_error[pair],
        "identified_real": model.response[model.index(output, input_)].real,
        "identified_imag": model.response[model.index(output, input_)].imag,
    }
    if exact is not None:
        line = exact.response[exact.index(output, input_)]
        columns |= {
            "truth_frequency_rad_s": exact.frequency,
            "truth_real": line.real,
            "truth_imag": line.imag,
        }
    return columns


def _markdown(run: Run) -> str:
    parts = []
    for table in map(tables.comparison, run.results.tables):
        parts += [f"## {table.title}", f"{table.lead}.", "", as_markdown(table), ""]
    return "\n".join(parts)


def _steps(run: Run) -> list[str]:
    given = run.configuration
    steps = [
        f"vehicle loaded and trimmed, seed {run.results.seed}",
        f"flown: {given.flown_each_axis} sweeps on each axis, {given.flights_kept_each_axis} kept",
        *(f"left out: {one.message}" for one in run.results.excluded),
    ]
    for table in run.results.tables:
        good = sum(row.verdict == "ok" for row in table.parameters)
        steps.append(
            f"identified: {table.name} from {table.input}, cost {table.cost:.3g}, "
            f"{good} of {len(table.parameters)} parameters within tolerance"
        )
    return steps + [f"missed: {sentence}" for sentence in run.results.misses]
