"""What a vehicle asks of a control law as data; `helisim.design.laws` has them."""

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from helisim.vehicle.controller import Controller
    from helisim.vehicle.vehicle import Vehicle


@runtime_checkable
class WrittenLaw(Protocol):
    """A control law as data, which makes a controller for a vehicle."""

    def on(self, vehicle: "Vehicle") -> "Controller":
        """Return the controller that flies it on a vehicle, about its trim."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        ...
