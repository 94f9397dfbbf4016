"""What only the proof needs: the model it works on, its conditions and its Lyapunov function.

==========================  ==========================================================
module                      what it states
==========================  ==========================================================
:mod:`.control_point_model` (4) to (8), (14), (15): the model, in matrices of numpy
:mod:`.gain_conditions`     (30) to (32), (52) to (54): the conditions of the theorems
:mod:`.lyapunov`            (17), (19), (34), (55): composite errors, Lyapunov function
:mod:`.sampling`            what Euler's scheme asks of the gains; not in the paper
==========================  ==========================================================

Nothing here runs inside an FMU.
"""
