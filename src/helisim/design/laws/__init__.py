"""Control laws as data: a file that can be read, compared, tuned, linearised and flown."""

from helisim.design.laws.attitude_command import AttitudeAxis as AttitudeAxis
from helisim.design.laws.attitude_command import AttitudeCommand as AttitudeCommand
from helisim.design.laws.attitude_command import HeaveAxis as HeaveAxis
from helisim.design.laws.attitude_command import YawAxis as YawAxis
from helisim.design.laws.law import Law as Law
from helisim.design.laws.law import Lead as Lead
from helisim.design.laws.law import law_of as law_of
from helisim.design.laws.law import probed as probed
from helisim.design.laws.law import read_law as read_law
from helisim.design.laws.law import register as register
from helisim.design.laws.rate_command import CollectiveAxis as CollectiveAxis
from helisim.design.laws.rate_command import RateAxis as RateAxis
from helisim.design.laws.rate_command import RateCommand as RateCommand
from helisim.design.laws.rate_command import YawRateAxis as YawRateAxis
from helisim.design.laws.rotorflight import CollectiveRotorflight as CollectiveRotorflight
from helisim.design.laws.rotorflight import CyclicRotorflight as CyclicRotorflight
from helisim.design.laws.rotorflight import Notch as Notch
from helisim.design.laws.rotorflight import Rotorflight as Rotorflight
from helisim.design.laws.rotorflight import YawRotorflight as YawRotorflight
from helisim.design.laws.state_space import StateSpaceLaw as StateSpaceLaw
