"""Waves and a current at the vehicle."""
