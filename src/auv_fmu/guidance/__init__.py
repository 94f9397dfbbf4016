"""References that are not in the paper, and messages between vehicles.

=====================  ===========================================================================
module                 what it states
=====================  ===========================================================================
:mod:`.path_planner`   a reference through waypoints
:mod:`.formation`      a reference beside a leader's, with (23) and (51) for one that is not known
:mod:`.acoustic_link`  messages under water, late and sometimes lost
=====================  ===========================================================================
"""
