"""Every aircraft of known truth, by name."""

from collections.abc import Callable

from aircraft import Aircraft
from hover import hover

FLEET: dict[str, Callable[[], Aircraft]] = {"hover": hover}
