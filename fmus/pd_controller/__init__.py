"""The baseline that measures the velocity."""
