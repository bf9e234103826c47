"""From flight records to identified models, by the frequency-response method.

Knows no simulator: a real flight log is identified by the same calls.
"""

from helisim.ident.fitting.ardupilot import ArduPilotModel
from helisim.ident.fitting.fit import identify
from helisim.ident.fitting.fitted import FittedParameter
from helisim.ident.fitting.misfit import Misfit
from helisim.ident.fitting.modes import Mode, Modes
from helisim.ident.fitting.reduction import Reduction, reduce
from helisim.ident.fitting.result import Fit, load_fit
from helisim.ident.fitting.suspicion import suspicions
from helisim.ident.frf import (
    ClosedLoopWarning,
    CrossControlWarning,
    RecordQualityWarning,
    frequency_response,
)
from helisim.ident.model import blocks, structures
from helisim.ident.model.series import in_series
from helisim.ident.model.structure import Parameter, Structure
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse, load_response
from helisim.ident.verification import Verification
from helisim.ident.verify import verify

__all__ = [
    "USABLE_COHERENCE",
    "ArduPilotModel",
    "ClosedLoopWarning",
    "CrossControlWarning",
    "Fit",
    "FittedParameter",
    "FrequencyResponse",
    "Misfit",
    "Mode",
    "Modes",
    "Parameter",
    "RecordQualityWarning",
    "Reduction",
    "Structure",
    "Verification",
    "blocks",
    "frequency_response",
    "identify",
    "in_series",
    "load_fit",
    "load_response",
    "reduce",
    "structures",
    "suspicions",
    "verify",
]
