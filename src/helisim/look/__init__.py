"""A first look at logs of which nothing is known: see `look`; and logs of SystemID, `systemid`."""

from helisim.look.channels import SeenChannel
from helisim.look.excitation import FoundAnswer, FoundExcitation
from helisim.look.look import LogLook, Look, Proposal, look
from helisim.look.opened import SeenClock

__all__ = [
    "FoundAnswer",
    "FoundExcitation",
    "LogLook",
    "Look",
    "Proposal",
    "SeenChannel",
    "SeenClock",
    "look",
]
