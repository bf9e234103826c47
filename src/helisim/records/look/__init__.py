"""A first look at logs of which nothing is known: see `look`."""

from helisim.records.look.answers import FoundAnswer
from helisim.records.look.excitation import FoundExcitation
from helisim.records.look.guess import SeenChannel
from helisim.records.look.look import LogLook, Look, look
from helisim.records.look.opened import SeenClock

__all__ = ["FoundAnswer", "FoundExcitation", "LogLook", "Look", "SeenChannel", "SeenClock", "look"]
