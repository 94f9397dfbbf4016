"""Ports of ObserverController."""

from auv_fmu.output_feedback import Gains
from auv_fmu.saturation import SATURATIONS
from fmus.base.port import H_MAX, POSITIVE, Port, inputs, outputs, parameter, parameters
from fmus.base.vehicle_ports import CONTROL_POINT

_AXES = ("x", "y", "z")
_POSITION = dict.fromkeys(_AXES, "m")
_VELOCITY = dict.fromkeys(_AXES, "m/s")
_TAU = {"u": "N", "q": "N.m", "r": "N.m"}
_THETA = {"[1]": "N", "[2]": "kg/s", "[3]": "kg/m", "[4]": "kg"}
_PER_AXIS = {"[1]": "N", "[2]": "N", "[3]": "N"}

_GAINS = Gains()
_INPUTS = (
    *inputs("y", _POSITION, "Measured control point"),
    *inputs("eta", {"phi": "rad", "theta": "rad", "psi": "rad"}, "Measured Euler angle"),
    *inputs("y_d", _POSITION, "Desired control point"),
    *inputs("dy_d", _VELOCITY, "Desired velocity"),
    *inputs("ddy_d", dict.fromkeys(_AXES, "m/s2"), "Desired acceleration"),
)
_Y, _Y_D, _DY_D = _INPUTS[0:3], _INPUTS[6:9], _INPUTS[9:12]

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *outputs("tau", _TAU, "Commanded force and moments (21), not limited", _INPUTS),
    *outputs("y_hat", _POSITION, "Estimated control point", _Y),
    *outputs("dy_hat", _VELOCITY, "Estimated velocity of the control point (23)", _Y),
    *(
        Port(f"theta_hat{k}", "output", "continuous", "Real", f"Estimated parameter {k}", unit)
        for k, unit in _THETA.items()
    ),
    *outputs("e", _POSITION, "Tracking error y - y_d", (*_Y, *_Y_D)),
    *outputs("z", _POSITION, "Estimation error y - y_hat", _Y),
    *parameters("K1", _GAINS.K1, _PER_AXIS, "Diagonal of K_1", POSITIVE, tunable=True),
    *parameters("K2", _GAINS.K2, _PER_AXIS, "Diagonal of K_2", POSITIVE, tunable=True),
    parameter("lambda", _GAINS.lambda_, "m/s", "Lambda = lambda I", POSITIVE, tunable=True),
    parameter("k_d", _GAINS.k_d, "1/s", "Gain of the observer", POSITIVE, tunable=True),
    parameter("gamma", _GAINS.gamma, "1", "Gamma = gamma I, in SI units", 0.0, tunable=True),
    parameter("sigma", _GAINS.sigma, "1/s", "Sigma = sigma I", minimum=0.0, tunable=True),
    *parameters("theta_0", _GAINS.theta_0, _THETA, "Prior of the parameters"),
    parameter("eps_t", _GAINS.eps_t, "W", "Boundary layer of (21)", POSITIVE, tunable=True),
    CONTROL_POINT,
    Port(
        "saturation",
        "parameter",
        "fixed",
        "String",
        "Saturation function of Definition 2: tanh or algebraic",
        start="tanh",
        choices=tuple(SATURATIONS),
    ),
    Port(
        "printed_jacobian",
        "parameter",
        "fixed",
        "Boolean",
        "Use (11) as printed, for zero roll, instead of the full attitude",
        start=_GAINS.printed_jacobian,
    ),
    parameter(
        "innovation_gate",
        _GAINS.innovation_gate,
        "m",
        "Restart the observer when |y - y_hat| exceeds this; 0: never. Not in the paper",
        minimum=0.0,
        tunable=True,
    ),
    H_MAX,
)
