"""What only the proof needs: its conditions and its Lyapunov function.

==========================  ==========================================================
module                      what it states
==========================  ==========================================================
:mod:`.gain_conditions`     (26), (29) to (32), (52) to (54): what is asked of the gains
:mod:`.attraction`          (33), (40), (42), (47): how far the theorems reach at most
:mod:`.lyapunov`            (17), (19), (34), (55): composite errors, Lyapunov function
==========================  ==========================================================

Nothing here runs inside an FMU. The model that it works on, (4) to (8), (11), (14), (15), (20),
(25) and (28), is in the tests, which hold it against the equations: `support.control_point_model`.
"""
