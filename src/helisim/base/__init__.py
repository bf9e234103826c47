"""Errors, units, values, files and settings, used by every package; imports nothing of helisim."""
