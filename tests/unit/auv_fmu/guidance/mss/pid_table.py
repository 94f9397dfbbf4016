"""Write a table of inputs and results of `PIDpolePlacement`, with which the tests compare.

    PYTHONPATH=PythonVehicleSimulator/src python pid_table.py pid.csv

PythonVehicleSimulator: github.com/cybergalactic/PythonVehicleSimulator, commit
c717e073d7a839dcb5956cf20c595132f1fa249a.
"""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

from python_vehicle_simulator.lib.control import PIDpolePlacement

draw = Random(49).uniform
rows = ["e_int,e_x,e_v,m,d,k,wn,zeta,u"]
for i in range(40):
    e_int, e_x, e_v = draw(-5.0, 5.0), draw(-3.0, 3.0), draw(-1.0, 1.0)
    m, d, k = draw(1.0, 40.0), draw(0.0, 40.0), draw(0.0, 20.0) if i % 2 else 0.0
    wn, zeta = draw(0.1, 3.0), draw(0.3, 2.0)
    u, *_ = PIDpolePlacement(
        e_int, e_x, e_v, 0.0, 0.0, 0.0, m, d, k, 1.0, 1.0, wn, zeta, 0.0, 1.0, 0.02
    )
    rows.append(",".join(repr(x) for x in (e_int, e_x, e_v, m, d, k, wn, zeta, u)))
Path(sys.argv[1]).write_text("\n".join(rows) + "\n", encoding="utf-8")
