"""Flying by hand: sticks, devices, assistance, and a flight that they move while it goes on."""

from helisim.hand.flight import ASSISTS as ASSISTS
from helisim.hand.flight import HandFlight as HandFlight
from helisim.hand.sticks import KEY_FEEL as KEY_FEEL
from helisim.hand.sticks import MODES as MODES
from helisim.hand.sticks import Axis as Axis
from helisim.hand.sticks import Deflection as Deflection
from helisim.hand.sticks import Gimbals as Gimbals
from helisim.hand.sticks import Inputs as Inputs
from helisim.hand.sticks import JoystickMap as JoystickMap
from helisim.hand.sticks import JoystickSticks as JoystickSticks
from helisim.hand.sticks import KeyboardSticks as KeyboardSticks
from helisim.hand.sticks import StickDevice as StickDevice
from helisim.hand.sticks import StickFeel as StickFeel
