"""Ports that the REMUS 100 and what allocates its fins and propeller share."""

from __future__ import annotations

from math import pi

from auv_fmu.quantities import Members
from auv_fmu.tail import Tail
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, parameter
from fmus.ports.vehicle import PAPER

#: The source of the model, and the paper whose numbers of equations stand beside it.
REMUS = PAPER._replace(
    citation="The model is that of the class remus100 in PythonVehicleSimulator 1.0.1, by T. I. "
    f"Fossen. {PAPER.citation}"
)

_TAIL = Tail()

TAIL = ParameterSet(
    Tail,
    rho=parameter("rho", _TAIL.rho, "kg/m3", "Density of the water", POSITIVE),
    area=parameter("fin.area", _TAIL.area, "m2", "Area of a pair of fins", POSITIVE),
    x=parameter(
        "fin.x",
        _TAIL.x,
        "m",
        "Where the fins are ahead of the centre; at the stern: < 0",
        maximum=-POSITIVE,
    ),
    lift_r=parameter(
        "fin.lift.r", _TAIL.lift_r, "1/rad", "Lift coefficient of the rudder per angle", POSITIVE
    ),
    lift_s=parameter(
        "fin.lift.s",
        _TAIL.lift_s,
        "1/rad",
        "Lift coefficient of the stern planes per angle",
        POSITIVE,
    ),
    delta_max=parameter(
        "fin.max", _TAIL.delta_max, "rad", "Largest angle of a fin", POSITIVE, maximum=pi / 2
    ),
    diameter=parameter(
        "propeller.diameter", _TAIL.diameter, "m", "Diameter of the propeller", POSITIVE
    ),
    deduction=parameter(
        "propeller.deduction", _TAIL.deduction, "1", "Thrust deduction number", 0.0, 0.9
    ),
    advance=parameter(
        "propeller.advance", _TAIL.advance, "1", "Speed of advance per speed of the vehicle", 0.0
    ),
    j_1=parameter(
        "propeller.J_1", _TAIL.j_1, "1", "Advance number to which KT_1 and KQ_1 belong", POSITIVE
    ),
    kt_0=parameter(
        "propeller.KT_0", _TAIL.kt_0, "1", "Thrust coefficient at advance number 0", POSITIVE
    ),
    kt_1=parameter("propeller.KT_1", _TAIL.kt_1, "1", "Thrust coefficient at advance number J_1"),
    kq_0=parameter(
        "propeller.KQ_0", _TAIL.kq_0, "1", "Torque coefficient at advance number 0", 0.0
    ),
    kq_1=parameter("propeller.KQ_1", _TAIL.kq_1, "1", "Torque coefficient at advance number J_1"),
    torque=parameter(
        "propeller.torque", _TAIL.torque, "1", "Share of the torque that rolls the vehicle", 0.0
    ),
    n_max=parameter(
        "propeller.max", _TAIL.n_max, "rad/s", "Largest speed of the propeller", POSITIVE
    ),
)

#: What is commanded, and what fins and propeller are.
TAIL_COMMAND: Members = {"delta_r": "rad", "delta_s": "rad", "n": "rad/s"}
