"""What a run found, for Rerun: each model's plots and numbers, the table, the steps."""

import json

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from helisim.ident import FrequencyResponse
from helisim.show import tables
from helisim.show.rerun.bode import bode_size, log_bode
from helisim.show.rerun.layout import CheckViews, ModelViews
from helisim.show.rerun.series import log_series
from helisim.show.rerun.timelines import STEP, time_column
from helisim.show.table import as_markdown
from helisim.study.identified import IdentifiedModel
from helisim.study.run import Run

_FLIGHT = (176, 184, 196)
_MODEL = (72, 166, 255)
_INPUTS = ((94, 210, 160), (255, 152, 56))


def model_views(run: Run) -> tuple[ModelViews, ...]:
    """Return what there is to look at of each model."""
    return tuple(
        ModelViews(
            name=item.name,
            pairs={
                f"{output} / {input_}": f"{_pair(item, output, input_)}/bode"
                for output in item.fit.structure.outputs
                for input_ in item.fit.structure.inputs
            },
            checks=_checks(item),
        )
        for item in run.models
    )


def _checks(item: IdentifiedModel) -> tuple[CheckViews, ...]:
    checked = item.verification
    if checked is None:
        return ()
    names = item.verified_on or [f"flight {k + 1}" for k in range(len(checked.traces))]
    return tuple(
        CheckViews(
            title=f"{name}, predicted",
            root=f"models/{item.name}/time_{k + 1}",
            plots=("inputs", *checked.outputs),
            start=float(trace.time[0]),
            stop=float(trace.time[-1]),
        )
        for k, (name, trace) in enumerate(zip(names, checked.traces))
    )


def _pair(item: IdentifiedModel, output: str, input_: str) -> str:
    return f"models/{item.name}/{output}_{input_}"


def log_results(recording: rr.RecordingStream, run: Run) -> None:
    """Log all that was found, below the entity `models`."""
    recording.send_property(
        "run", rr.AnyValues(results=json.dumps(run.results.to_dict(), sort_keys=True))
    )
    for item in run.models:
        _log_pairs(recording, item)
        _log_verification(recording, item)
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


def _log_pairs(recording: rr.RecordingStream, item: IdentifiedModel) -> None:
    """Log the Bode plot of each pair of a model, and the numbers behind it."""
    fit, identified = item.fit, item.fit.response(item.fit.data.frequency)
    for output in fit.structure.outputs:
        for input_ in fit.structure.inputs:
            entity = _pair(item, output, input_)
            log_bode(
                recording,
                f"{entity}/bode",
                output,
                input_,
                data=fit.data,
                identified=identified,
                truth=item.exact,
                used=fit.bands.get(f"{output}/{input_}"),
                size=bode_size(len(fit.structure.outputs) * len(fit.structure.inputs)),
            )
            numbers = _numbers(fit.data, identified, item.exact, output, input_)
            values = rr.AnyValues(drop_untyped_nones=True, **numbers)
            recording.log(f"{entity}/numbers", values, static=True)


def _log_verification(recording: rr.RecordingStream, item: IdentifiedModel) -> None:
    """Log the flights that verified a model as time series: inputs, measured, predicted."""
    checked = item.verification
    if checked is None:
        return
    for k, trace in enumerate(checked.traces):
        entity = f"models/{item.name}/time_{k + 1}"
        names = item.fit.structure.inputs
        log_series(recording, f"{entity}/inputs", trace.time, trace.inputs, names, _INPUTS)
        for j, (output, unit) in enumerate(zip(checked.outputs, checked.units)):
            both = np.column_stack([trace.measured[:, j], trace.predicted[:, j]])
            labels = [f"{output}, {which} [{unit}]" for which in ("flight", "identified model")]
            part = f"{entity}/{output}"
            log_series(recording, part, trace.time, both, labels, (_FLIGHT, _MODEL))


def _numbers(
    data: FrequencyResponse,
    model: FrequencyResponse,
    exact: FrequencyResponse | None,
    output: str,
    input_: str,
) -> dict[str, NDArray[np.float64]]:
    """Return the columns behind a plot: complex ones as real and imaginary parts."""
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
        notes = [f"{label}: {text}." if label else f"{text}." for label, text in table.notes]
        parts += [f"## {table.title}", f"{table.lead}.", "", as_markdown(table), "", *notes, ""]
    return "\n".join(parts)


def _steps(run: Run) -> list[str]:
    given = run.configuration
    steps = [
        f"vehicle loaded and trimmed, seed {run.results.seed}",
        f"flown: {given.flown_each_axis} sweeps on each axis, {given.flights_kept_each_axis} kept",
        *(f"left out: {one.message}" for one in run.results.excluded),
    ]
    for table in run.results.tables:
        good = sum(row.agreement == "agrees" for row in table.parameters)
        steps.append(
            f"identified: {table.name} from {table.input}, cost {table.cost:.3g}, "
            f"{good} of {len(table.parameters)} parameters agree"
        )
    steps += [
        f"verified: {name}, TIC {one.tic:.3g}, {one.approach}"
        for name, one in run.results.verification.items()
    ]
    return steps + [f"missed: {sentence}" for sentence in run.results.misses]
