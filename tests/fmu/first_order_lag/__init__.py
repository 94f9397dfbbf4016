"""A first-order lag, measured with noise."""
