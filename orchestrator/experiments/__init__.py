"""Scenarios, wiring, bundle, one run and its files."""
