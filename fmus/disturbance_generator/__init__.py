"""Friction, waves and ocean currents."""
