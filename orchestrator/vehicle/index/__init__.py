"""The indices of a vehicle, in the language of equations: what each sees of a run, and makes of it.

A module here is one :class:`~fmus.ports.reducer.Reducer`. The names of its inputs are those of the
standard loop; each loop has its own for them.
"""
