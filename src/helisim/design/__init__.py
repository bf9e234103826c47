"""From an identified model to a control law that meets specifications."""
