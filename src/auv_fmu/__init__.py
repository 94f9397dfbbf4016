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
:mod:`.path_planner`        a reference through waypoints, not in the paper
:mod:`.remus100`            the REMUS 100, not in the paper; its :mod:`.hull` and :mod:`.tail`
:mod:`.allocation`          fins and propeller of the REMUS 100 from force and moments
:mod:`.formation`           a reference beside a leader's, not in the paper
:mod:`.acoustic_link`       messages between vehicles, not in the paper
:mod:`.disturbance`         (56): friction, waves and currents
:mod:`.saturation`          Definition 2: saturation functions, Lemma 1
:mod:`.observer`            (24), (51): the state of the velocity observer
:mod:`.adaptation`          (22), (49), (58): bounding function, its adaptation, Lemma 2
:mod:`.output_feedback`     (16) to (24), (48) to (51): the proposed controller
:mod:`.pd`                  (57), (58): the PD controller it is compared with
:mod:`.closed_loop`         Fig. 2: all of it as one straight line
:mod:`.euler`               section 4.1: Euler approximation and its time step
:mod:`.proof`               what only the proof needs; never runs inside an FMU
:mod:`.vectors`             names for the tuples; sums and products of three-vectors
==========================  ==========================================================

The functions take and return Python floats and tuples and import nothing but the standard
library, because they run inside FMUs in hosts that may have no numpy. `architecture.md`
says why that form was chosen, with the measurements.

Symbols are the paper's: dx and ddx are the first and second time derivative of x, x_hat is its
estimate, s_z is s(z). lambda_ is lambda, which Python keeps for itself.

Arguments come in one order: sets of parameters, states and signals, single parameters such as
ell and lambda, the step h.

Conventions: SI units; north-east-down earth frame E (reading 16); body frame B with x forward, y to
starboard, z down; tuples are in the order of the paper's vectors.
"""

from auv_fmu.arrays import Matrix, Vector
from auv_fmu.linear_algebra import interpolate, solve
from auv_fmu.variable import POSITIVE, Refusal, Variable

__all__ = ["POSITIVE", "Matrix", "Refusal", "Variable", "Vector", "interpolate", "solve"]

__version__ = "0.1.0"

#: Where the components come from, and what their equation numbers refer to.
__author__ = "auv-fmu"
__license__ = "MIT"
__citation__ = (
    'Equation numbers are from the paper "Three-dimensional tracking control of autonomous '
    'underwater vehicles with limited torque and without velocity sensors"'
)
