"""The figures by which a loop is judged, each computed from one response or one history.

What a figure means and where it is defined stands with its function; whether it is good enough is
said by `criteria`. A figure that a response doesn't have within its band (no crossover, no phase
of -180 deg) is continued beyond it so that it stays finite and continuous, as a search needs it.
"""
