"""Fins and propeller that give a commanded force and moments."""
