"""The indices of a vehicle, in the language of equations.

Each module is a :class:`~fmus.ports.reducer.Reducer`. Its inputs have the names of the standard
loop, which are mapped to the names of each loop.
"""
