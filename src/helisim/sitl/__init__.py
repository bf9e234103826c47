"""An outside autopilot in the loop: the vehicle as a backend for ArduPilot's JSON interface.

A frame of servo pulses comes in by `link`, moves the vehicle that `aircraft` steps by way of its
`outputs`, and what its IMU then senses goes back. `backend` ties the three together.
"""
