"""What an autopilot's log of system identification says of itself: see `infer`.

ArduPilot's mode SystemID logs what it injects (SIDD) and how (SIDS). With the messages beside them
that chooses all that an identification has to be told: `axes` | `sweeps` | `channels` | `fits`,
together a `plan`, whose records are made by `reading`.
"""

from helisim.look.systemid.axes import SID_AXES, SidAxis
from helisim.look.systemid.channels import TakenChannel
from helisim.look.systemid.fits import InferredFit
from helisim.look.systemid.plan import Inferred, InferredLog, infer
from helisim.look.systemid.sweeps import FlownSweep

__all__ = [
    "SID_AXES",
    "FlownSweep",
    "Inferred",
    "InferredFit",
    "InferredLog",
    "SidAxis",
    "TakenChannel",
    "infer",
]
