"""References that are not in the paper, and messages between vehicles.

=====================  ===========================================================================
module                 contents
=====================  ===========================================================================
:mod:`.follower`       a vehicle, and what a reference demands of it
:mod:`.path_planner`   a reference through waypoints
:mod:`.los`            line-of-sight guidance along waypoints
:mod:`.autopilot`      autopilots that do what guidance commands
:mod:`.track`          a reference through the rows of a table
:mod:`.formation`      a reference beside a leader's, which (23) and (51) estimate if need be
:mod:`.acoustic_link`  messages under water, late and sometimes lost
=====================  ===========================================================================
"""
