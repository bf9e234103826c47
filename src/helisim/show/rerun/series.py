"""Signals over time for Rerun: one entity a group of them, one series a signal."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from helisim.show.rerun.timelines import time_column

_INKS = ((72, 166, 255), (255, 152, 56), (94, 210, 160), (190, 140, 230), (150, 158, 170))
_ENVELOPE = rr.components.AggregationPolicy.MinMax
"""What a pixel shows of many samples; their mean would make a fast sweep look as if it faded."""
_SCALARS = rr.ComponentDescriptor("Scalars:scalars", archetype="rerun.archetypes.Scalars")
"""Rerun's own scalars are in double precision, twice as large; its plots take these as well."""


def log_series(
    recording: rr.RecordingStream,
    entity: str,
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    labels: Sequence[str],
    colours: Sequence[tuple[int, int, int]] = _INKS,
) -> None:
    """Log signals in single precision.

    Args:
        recording: that is logged to.
        entity: of the group.
        time: (n_time,) s.
        values: (n_time, n_signal).
        labels: one a signal.
        colours: of the series, repeated when there are more.
    """
    inks = [colours[k % len(colours)] for k in range(len(labels))]
    lines = rr.SeriesLines(names=list(labels), colors=inks, aggregation_policy=_ENVELOPE)
    recording.log(entity, lines, static=True)
    count, width = values.shape
    column = rr.ComponentColumn(_SCALARS, _Singles(values), lengths=np.full(count, width))
    recording.send_columns(entity, indexes=[time_column(time)], columns=[column])


class _Singles:
    """Numbers of a component, in single precision."""

    def __init__(self, values: NDArray[np.float64]) -> None:
        self._values = np.ascontiguousarray(values, dtype=np.float32).ravel()

    def component_descriptor(self) -> rr.ComponentDescriptor:
        return _SCALARS

    def as_arrow_array(self) -> pa.Array:
        return pa.array(self._values)
