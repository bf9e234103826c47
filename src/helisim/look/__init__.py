"""A first look at logs of which nothing is known: see `look`."""

from helisim.look.answers import FoundAnswer
from helisim.look.excitation import FoundExcitation
from helisim.look.guess import SeenChannel
from helisim.look.look import LogLook, Look, look
from helisim.look.opened import SeenClock

__all__ = ["FoundAnswer", "FoundExcitation", "LogLook", "Look", "SeenChannel", "SeenClock", "look"]
