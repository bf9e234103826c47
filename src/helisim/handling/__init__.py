"""Handling qualities: what a closed loop is judged by, whether identified, exact or flown.

A `Loop` is a vehicle with its control law, seen as responses: broken loops, disturbance
rejection, answers to the sticks. Criteria rate any of them alike. Nothing here knows a simulator.
"""

from helisim.handling import criteria as criteria
