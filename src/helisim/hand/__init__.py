"""Flying by hand: sticks, devices, assistance, and a flight that they move while it goes on."""

from helisim.hand.assist import ASSISTS as ASSISTS
from helisim.hand.devices import KEY_FEEL as KEY_FEEL
from helisim.hand.devices import Inputs as Inputs
from helisim.hand.devices import JoystickSticks as JoystickSticks
from helisim.hand.devices import KeyboardSticks as KeyboardSticks
from helisim.hand.devices import StickDevice as StickDevice
from helisim.hand.flight import HandFlight as HandFlight
from helisim.hand.joystick import Axis as Axis
from helisim.hand.joystick import JoystickMap as JoystickMap
from helisim.hand.joystick import calibrated as calibrated
from helisim.hand.logbook import Logbook as Logbook
from helisim.hand.sticks import MODES as MODES
from helisim.hand.sticks import Deflection as Deflection
from helisim.hand.sticks import Gimbals as Gimbals
from helisim.hand.sticks import StickFeel as StickFeel
