"""The reference of a vehicle in a formation."""
