"""From flight records to identified models, by the frequency-response method.

Knows no simulator: a real flight log is identified by the same calls.
"""

from helisim.ident import blocks, structures
from helisim.ident.conditioning import CrossControlWarning
from helisim.ident.fit import identify
from helisim.ident.fitted import FittedParameter
from helisim.ident.frf import ClosedLoopWarning, frequency_response
from helisim.ident.misfit import Misfit
from helisim.ident.modes import Mode, Modes
from helisim.ident.record_checks import RecordQualityWarning
from helisim.ident.reduction import Reduction, reduce
from helisim.ident.response import USABLE_COHERENCE, FrequencyResponse
from helisim.ident.response_file import load_response
from helisim.ident.result import Fit, load_fit
from helisim.ident.series import in_series
from helisim.ident.structure import Parameter, Structure
from helisim.ident.suspicion import suspicions
from helisim.ident.verification import Verification
from helisim.ident.verify import verify

__all__ = [
    "USABLE_COHERENCE",
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
