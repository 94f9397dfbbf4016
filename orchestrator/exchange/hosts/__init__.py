"""Hosts of others: what runs the bundle in them, and where they are installed."""
