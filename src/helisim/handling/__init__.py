"""Handling qualities: criteria of a closed loop, whether identified, exact or flown."""

from helisim.handling import criteria as criteria
