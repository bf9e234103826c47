"""A window to fly in by hand: what is seen and which keys do what, around `helisim.sim.hand`."""
