"""Fig. 2 of the paper as one straight line of Python: :mod:`.closed_loop`."""
