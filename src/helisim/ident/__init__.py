"""From flight records to identified models, by the frequency-response method."""

from helisim.ident import blocks, structures
from helisim.ident.ardupilot import ArduPilotModel
from helisim.ident.diagnosis import Residual
from helisim.ident.fit import identify, suspicions
from helisim.ident.fitted import FittedParameter
from helisim.ident.frf import (
    ClosedLoopWarning,
    CrossControlWarning,
    RecordQualityWarning,
    frequency_response,
)
from helisim.ident.likelihood import identify_records
from helisim.ident.modes import Mode, Modes
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse
from helisim.ident.result import Fit, load_fit
from helisim.ident.structure import Parameter, Structure, in_series
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
    "Mode",
    "Modes",
    "Parameter",
    "RecordQualityWarning",
    "Residual",
    "Structure",
    "Verification",
    "blocks",
    "frequency_response",
    "identify",
    "identify_records",
    "in_series",
    "load_fit",
    "structures",
    "suspicions",
    "verify",
]
