"""The proposed velocity-free saturated controller."""
