"""Conditions and Lyapunov function of the proof.

==========================  ==========================================================
module                      contents
==========================  ==========================================================
:mod:`.gain_conditions`     (26), (29) to (32), (52) to (54): conditions on the gains
:mod:`.attraction`          (33), (40), (42), (47): upper bounds on what the theorems cover
:mod:`.lyapunov`            (17), (19), (34), (55): composite errors, Lyapunov function
==========================  ==========================================================

Nothing here runs inside an FMU. The model of the proof, (4) to (8), (11), (14), (15), (20), (25)
and (28), is in the tests, which compare it with the equations: `support.control_point_model`.
"""
