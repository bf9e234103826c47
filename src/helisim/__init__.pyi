"""The public names and where they live, read by `__init__.py`, by type checkers and editors."""

from .ident import Fit as Fit
from .ident import FrequencyResponse as FrequencyResponse
from .ident import Structure as Structure
from .ident import Verification as Verification
from .ident import frequency_response as frequency_response
from .ident import identify as identify
from .ident import load_fit as load_fit
from .ident import reduce as reduce
from .ident import structures as structures
from .ident import verify as verify
from .physics.native import installed as installed
from .records.logs import read_log as read_log
from .records.logs import screen as screen
from .records.record import FlightRecord as FlightRecord
from .records.storage import read_record as read_record
from .records.storage import write_record as write_record
from .sim import ClockDrift as ClockDrift
from .sim import Doublet as Doublet
from .sim import Gust as Gust
from .sim import GyroDropout as GyroDropout
from .sim import GyroRestart as GyroRestart
from .sim import Pilot as Pilot
from .sim import Recorder as Recorder
from .sim import RecordGap as RecordGap
from .sim import SampleLoss as SampleLoss
from .sim import SensorDropout as SensorDropout
from .sim import SensorSpikes as SensorSpikes
from .sim import ServoStuck as ServoStuck
from .sim import ServoWeak as ServoWeak
from .sim import Sweep as Sweep
from .sim import FlightEnvelope as FlightEnvelope
from .sim import FlightPlan as FlightPlan
from .sim import read_plan as read_plan
from .sim import write_plan as write_plan
from .sim import Weather as Weather
from .sim import fly as fly
from .sim import fly_each as fly_each
from .sim import fly_to as fly_to
from .study.reproduce import reproduce as reproduce
from .vehicle import GyroSettings as GyroSettings
from .vehicle import Vehicle as Vehicle
from .vehicle import load as load

__version__: str
