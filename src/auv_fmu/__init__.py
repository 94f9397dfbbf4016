"""The equations of one paper, one module per thing in it.

The paper is "Three-dimensional tracking control of autonomous underwater vehicles with
limited torque and without velocity sensors". Equation numbers in this package are its own.

==========================  ==========================================================
module                      what it states
==========================  ==========================================================
:mod:`.vehicle`             (1), (2): kinematics and dynamics with five degrees of freedom
:mod:`.actuators`           (3): limits of the actuators
:mod:`.attitude`            T_1 of (1) for any roll, unit quaternion, Euler angles
:mod:`.plant`               section 4.1: the simulated vehicle with six degrees of freedom
:mod:`.control_point`       (9) to (13): the control point and its Jacobian
:mod:`.motion_planner`      Definition 1: the reference and its derivatives in closed form
:mod:`.disturbance`         (56): friction, waves and currents
:mod:`.saturation`          Definition 2: saturation functions, Lemma 1
:mod:`.observer`            (18), (23), (24), (50), (51): the velocity observer
:mod:`.adaptation`          (22), (49): bounding function, its adaptation, Lemma 2
:mod:`.output_feedback`     (16) to (24), (48) to (51): the proposed controller
:mod:`.proof`               what only the proof needs; never runs inside an FMU
==========================  ==========================================================

The functions take and return Python floats and tuples and import nothing but the standard
library, because they run inside FMUs in hosts that may have no numpy. `docs/architecture.md`
says why that form was chosen, with the measurements. Only `proof.control_point_model`,
which never runs inside an FMU, uses numpy.

Conventions: SI units; north-east-down earth frame E; body frame B with x forward, y to
starboard, z down; tuples are in the order of the paper's vectors.
"""

__version__ = "0.1.0"
