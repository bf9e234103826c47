"""From an identified model to a control law that meets specifications."""

from helisim.design import laws as laws
