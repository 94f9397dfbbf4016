"""The Euler approximation that section 4.1 simulates with.

Everything is evaluated at t_k, then all states advance together (reading 5): the `step` of every
module takes each state x to x + h dx/dt.
"""

from __future__ import annotations

#: The time step h of section 4.1 [s].
STEP = 0.02
