"""What only the proof needs: the model it works on, its conditions and its Lyapunov function.

==========================  ==========================================================
module                      what it states
==========================  ==========================================================
:mod:`.control_point_model` (4) to (8), (14), (15): the model, in matrices of numpy
:mod:`.error_dynamics`      (20), (25) to (29): what the error dynamics lump together
:mod:`.zetas`               (26), (29): lower bounds on what the paper leaves unknown
:mod:`.gain_conditions`     (30) to (32), (52) to (54): the conditions of the theorems
:mod:`.attraction`          (33), (40), (42), (47): how far the theorems reach at most
:mod:`.lyapunov`            (17), (19), (34), (55): composite errors, Lyapunov function
:mod:`.sampling`            what Euler's scheme asks of the gains; not in the paper
==========================  ==========================================================

Nothing here runs inside an FMU.
"""
