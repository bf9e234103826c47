"""Flights of an outside autopilot that a script flies, by simulated time and over MAVLink."""
