"""A reference trajectory through waypoints."""
