"""Events of all kinds, and what may come last."""

from __future__ import annotations

#: At times and conditions, one upon the other.
ALL = """
stop_time = 20.0
step = 0.01
[parameters]
planner.eta0.z = -2.0
[[events]]
at = 2.0
for = 3.0
override = { controller.tau.u = 15.0 }
[[events]]
at = 3.0
for = 1.0
bias = { plant.y = 0.2 }
[[events]]
at = 3.5
for = 4.0
freeze = "planner.y_d"
[[events]]
when = "plant.nu.u > 0.2"
repeat = true
for = 0.5
set = { controller.eps_t = 2.0, plant.current.x = 0.1 }
[[events]]
at = 5.0
set = { plant.water = [0.1, 0.2, 0.0] }
[[events]]
at = 6.0
for = 2.0
set = { plant.water.x = 0.4 }
[[events]]
at = 7.0
release = "planner.y_d"
[[events]]
at = 7.0
for = 3.0
set = { plant.water.x = 0.2 }
[[events]]
at = 9.0
bias = { plant.water.x = 0.3 }
[[events]]
at = 10.0
reset = ["controller"]
[[events]]
at = 10.003
reset = ["plant", "disturbance"]
[[events]]
at = 12.0
release = "plant.water"
[[events]]
at = 15.0
drop = "plant.y"
LAST
"""

#: An event that undoes its own condition, and so happens more often than is listed.
_CHATTERING = """
[[events]]
at = 6.0
set = { plant.water.z = 0.01 }
[[events]]
when = "plant.water.z > 0.001"
repeat = true
for = 0.01
override = { plant.water.z = 0.0 }
"""

#: Replacements of the last line.
ENDS = {
    "whole": '[[events]]\nwhen = "plant.eta.x < 1e9"\nstop = true',
    "chattering": _CHATTERING,
    "stopped": "[[events]]\nat = 18.0\nstop = true",
    "stopped at a condition": '[[events]]\nwhen = "controller.tau.u < 2.0"\nstop = true',
    "at the start": "[[events]]\nat = 0.0\nfor = 0.02\noverride = { plant.water.y = 0.5 }",
    "refused": "[[events]]\nat = 18.0\noverride = { disturbance.tau_w.u = 1e300 }",
}
