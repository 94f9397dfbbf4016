"""The equations of the paper: the vehicle, its reference, and the two controllers.

=======================  ==============================================================
module                   contents
=======================  ==============================================================
:mod:`.vehicle`          (1), (2): kinematics and dynamics with five degrees of freedom
:mod:`.actuators`        (3): limits of the actuators
:mod:`.attitude`         T_1 of (1) for any roll, unit quaternion, Euler angles
:mod:`.plant`            section 4.1: the simulated vehicle with six degrees of freedom
:mod:`.control_point`    (9) to (13): the control point and its Jacobian
:mod:`.motion_planner`   Definition 1: the reference and its derivatives in closed form
:mod:`.disturbance`      (56): friction, waves and currents
:mod:`.saturation`       Definition 2: saturation functions, Lemma 1
:mod:`.observer`         (24), (51): the state of the velocity observer
:mod:`.adaptation`       (22), (49), (58): bounding function, its adaptation, Lemma 2
:mod:`.output_feedback`  (16) to (24), (48) to (51): the proposed controller
:mod:`.pd`               (57), (58): the PD controller it is compared with
:mod:`.point_mass`       a mass at the control point, for other laws; not in the paper
:mod:`.euler`            section 4.1: Euler approximation and its time step
=======================  ==============================================================

Additions to the paper's equations are off by default and marked "not in the paper".
"""
