"""Flying by hand: sticks, devices, assistance, and a flight that they move while it goes on."""

from helisim.sim.hand.assist import ASSISTS as ASSISTS
from helisim.sim.hand.devices import KEY_FEEL as KEY_FEEL
from helisim.sim.hand.devices import Inputs as Inputs
from helisim.sim.hand.devices import JoystickSticks as JoystickSticks
from helisim.sim.hand.devices import KeyboardSticks as KeyboardSticks
from helisim.sim.hand.devices import StickDevice as StickDevice
from helisim.sim.hand.flight import HandFlight as HandFlight
from helisim.sim.hand.joystick import Axis as Axis
from helisim.sim.hand.joystick import JoystickMap as JoystickMap
from helisim.sim.hand.joystick import calibrated as calibrated
from helisim.sim.hand.logbook import Logbook as Logbook
from helisim.sim.hand.sticks import MODES as MODES
from helisim.sim.hand.sticks import Deflection as Deflection
from helisim.sim.hand.sticks import Gimbals as Gimbals
from helisim.sim.hand.sticks import StickFeel as StickFeel
