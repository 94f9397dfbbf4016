"""Ports, parameters and state of all types, and outputs that belong to the last step."""

from .component import *  # noqa: F403

SAMPLED = True
