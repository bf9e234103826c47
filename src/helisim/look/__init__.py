"""First look at unknown logs (`look`), and at logs of ArduPilot (`systemid`, `vibration`)."""

from helisim.look.channels import SeenChannel, SeenClock
from helisim.look.excitation import FoundAnswer, FoundExcitation
from helisim.look.look import Look, Proposal, look
from helisim.look.opened import LogLook

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
