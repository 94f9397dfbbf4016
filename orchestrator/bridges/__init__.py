"""Simulations in the form that other libraries step: environments for learning, nodes of robots."""
