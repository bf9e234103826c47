"""What is wrong in the paper, each with its calculation from the paper's own numbers.

Every figure of an `Erratum` is computed here, at run time, from the transcribed tables and,
for the tail rotor, from the force laws. Only what the paper says in words is quoted.
"""

from helisim.study.paper.errata import airframe, rollpitch, yaw
from helisim.study.paper.errata.erratum import Erratum

__all__ = ["Erratum", "errata"]


def errata() -> tuple[Erratum, ...]:
    """Return all that is known to be wrong in the paper, in the order of its sections."""
    return tuple(row.compute() for row in (*airframe.ROWS, *yaw.ROWS, *rollpitch.ROWS))
