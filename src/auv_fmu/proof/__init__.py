"""What only the proof needs: the model it works on, its conditions and its Lyapunov function.

==========================  ==========================================================
module                      what it states
==========================  ==========================================================
:mod:`.control_point_model` (4) to (8), (14), (15), (20), (25), (28): matrices of numpy
:mod:`.gain_conditions`     (26), (29) to (32), (52) to (54): what is asked of the gains
:mod:`.attraction`          (33), (40), (42), (47): how far the theorems reach at most
:mod:`.formation_bounds`    references in a formation: how far from their leader's
:mod:`.lyapunov`            (17), (19), (34), (55): composite errors, Lyapunov function
==========================  ==========================================================

Nothing here runs inside an FMU.
"""
