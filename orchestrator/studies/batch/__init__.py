"""Runs of the closed loop by its equations, compiled: `kernel` is one run."""
