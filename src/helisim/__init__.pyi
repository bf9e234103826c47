"""The public names and where they live, read by `__init__.py`, by type checkers and editors."""

from helisim.ident import Fit as Fit
from helisim.ident import FrequencyResponse as FrequencyResponse
from helisim.ident import Structure as Structure
from helisim.ident import Verification as Verification
from helisim.ident import frequency_response as frequency_response
from helisim.ident import identify as identify
from helisim.ident import load_fit as load_fit
from helisim.ident import reduce as reduce
from helisim.ident import structures as structures
from helisim.ident import verify as verify
from helisim.physics.native import check_model as check_model
from helisim.physics.native import installed as installed
from helisim.records.examples import examples as examples
from helisim.records.examples import open_example as open_example
from helisim.records.logs import read_log as read_log
from helisim.records.logs import screen as screen
from helisim.records.record import FlightRecord as FlightRecord
from helisim.records.storage import read_record as read_record
from helisim.records.storage import write_record as write_record
from helisim.sim import ClockDrift as ClockDrift
from helisim.sim import Doublet as Doublet
from helisim.sim import Excitation as Excitation
from helisim.sim import FlightEnvelope as FlightEnvelope
from helisim.sim import FlightPlan as FlightPlan
from helisim.sim import Gust as Gust
from helisim.sim import GyroDropout as GyroDropout
from helisim.sim import GyroRestart as GyroRestart
from helisim.sim import Pilot as Pilot
from helisim.sim import Recorder as Recorder
from helisim.sim import RecordGap as RecordGap
from helisim.sim import SampleLoss as SampleLoss
from helisim.sim import SensorDropout as SensorDropout
from helisim.sim import SensorSpikes as SensorSpikes
from helisim.sim import ServoStuck as ServoStuck
from helisim.sim import ServoWeak as ServoWeak
from helisim.sim import Sweep as Sweep
from helisim.sim import ThreeTwoOneOne as ThreeTwoOneOne
from helisim.sim import Weather as Weather
from helisim.sim import fly as fly
from helisim.sim import fly_each as fly_each
from helisim.sim import fly_to as fly_to
from helisim.sim import read_plan as read_plan
from helisim.sim import write_plan as write_plan
from helisim.study.reproduce import reproduce as reproduce
from helisim.vehicle import GyroSettings as GyroSettings
from helisim.vehicle import Vehicle as Vehicle
from helisim.vehicle import load as load

__version__: str
SHOWN_BY: str
