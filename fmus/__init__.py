"""The FMU components, and what turns them into FMUs.

============================== ==============================================================
package                        what it is
============================== ==============================================================
:mod:`.auv_plant`              the simulated vehicle
:mod:`.observer_controller`    the proposed controller
:mod:`.pd_controller`          the baseline
:mod:`.disturbance_generator`  friction, waves and ocean currents
:mod:`.motion_planner`         the reference trajectory
:mod:`.path_planner`           a reference through waypoints, in its place
:mod:`.ports`                  what a port is, and the groups that ports come in
:mod:`.slave`                  the Python kind of component, on PythonFMU
:mod:`.packaging`              from component folders to FMU files
============================== ==============================================================

A component is a folder with its ports, its slave and its page. Imports run one way: `ports`, then
`slave`, then the components and `packaging`.
"""
