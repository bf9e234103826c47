"""helisim: fly, sweep, identify and verify a nonlinear helicopter in MuJoCo."""

__version__ = "0.1.0"
