"""A component with ports, parameters and state of all types."""
