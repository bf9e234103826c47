"""Flights, and what a run found from them, as a Rerun recording."""
