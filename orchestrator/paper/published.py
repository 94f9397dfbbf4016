"""What the paper prints in section 4."""

from __future__ import annotations

#: Control efforts of section 4.2, in the order u, q, r.
EFFORT_PROPOSED, EFFORT_PD = (130.0, 40.0, 53.0), (235.0, 163.0, 172.0)

#: e_f of section 4.2, in the order x, y, z [m].
FINAL_ERROR_PROPOSED, FINAL_ERROR_PD = (0.01, 0.02, 0.06), (0.004, 0.001, 0.001)

#: Turning radius of section 4.1 [m].
TURNING_RADIUS = 0.6
