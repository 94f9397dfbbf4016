"""The FMU components: one folder each, with its ports, its slave and its page."""
