"""Flying by hand: keys or a joystick, what assists them, and a flight that they move."""

from helisim.hand.flight import HandFlight as HandFlight
from helisim.hand.sticks import Deflection as Deflection
from helisim.hand.sticks import Sticks as Sticks
