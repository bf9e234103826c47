"""What a user says of a log: repairs by name, and a map as a file. Imports nothing."""

REPAIRS: dict[str, str] = {
    "duplicates": "average rows that have the same stamp",
    "frozen": "leave out stretches in which measured motion is frozen, and split the log there "
    "as at gaps",
    "gaps": "split the log at its gaps",
    "missing": "interpolate cells without a number",
    "order": "sort rows by time",
    "resets": "split the log where the clock goes back",
    "spikes": "interpolate single samples, or two, that stick out",
    "tail": "leave out an incomplete last line",
}
"""What may be done to a log, each only on request."""

MAP_EXAMPLE = """\
[time]
column = "t"
unit = "us"

[channels.p]
column = "gyro_x"
unit = "deg/s"
sign = -1

[channels.lat]
column = "rc1"
unit = "us"          # pulse width: (pulse - trim) / range
trim = 1520
range = 800

[file]               # only where it can't be found out, CSV
delimiter = ";"
decimal = ","
"""
"""A map as a file."""
