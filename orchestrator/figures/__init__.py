"""Figures of runs and of studies, as far as there is what they show."""
