"""The simulated vehicle, its actuators and its localisation system."""
