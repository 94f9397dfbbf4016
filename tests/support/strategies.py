"""Strategies of the property-based tests."""

from __future__ import annotations

from math import pi

from hypothesis import strategies as st

angles = st.floats(-pi, pi)
#: Away from the vertical, where Euler angles have a pole.
pitch_angles = st.floats(-1.4, 1.4)
speeds = st.floats(-3.0, 3.0)
forces = st.floats(-80.0, 80.0)
lengths = st.floats(0.05, 2.0)


def vectors(elements: st.SearchStrategy[float], n: int) -> st.SearchStrategy[tuple[float, ...]]:
    """Tuples of n numbers."""
    return st.tuples(*([elements] * n))
