"""What the compiled loop works on, laid out as stepper.c declares it."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_double, c_int, c_size_t, c_void_p


class CMove(Structure):
    """Values of one type that are neighbours in the row, and FMI's function that moves them."""

    _fields_ = (
        ("call", c_void_p),
        ("references", c_void_p),
        ("n", c_size_t),
        ("values", c_void_p),
        ("integers", c_void_p),
    )


class CMember(Structure):
    """A component: how it is stepped, and how its inputs and outputs are moved."""

    _fields_ = (
        ("component", c_void_p),
        ("do_step", c_void_p),
        ("inputs", POINTER(CMove)),
        ("outputs", POINTER(CMove)),
        ("n_inputs", c_size_t),
        ("n_outputs", c_size_t),
    )


class CMapping(Structure):
    """Values that become others on their way through one connection."""

    _fields_ = (
        ("connection", c_size_t),
        ("n", c_size_t),
        ("from_values", POINTER(c_double)),
        ("to_values", POINTER(c_double)),
    )


class CStage(Structure):
    """Inputs to gather, and the components to step then."""

    _fields_ = (
        ("targets", c_void_p),
        ("sources", c_void_p),
        ("factors", c_void_p),
        ("offsets", c_void_p),
        ("mappings", POINTER(CMapping)),
        ("members", POINTER(CMember)),
        ("n_connections", c_size_t),
        ("n_mappings", c_size_t),
        ("n_members", c_size_t),
        ("every", c_size_t),
        ("at_end", c_int),
    )


class CRun(Structure):
    """What the steps of a run are made of."""

    _fields_ = (
        ("stages", POINTER(CStage)),
        ("values", c_void_p),
        ("n_stages", c_size_t),
        ("n_shown", c_size_t),
        ("start_time", c_double),
        ("step", c_double),
        ("stop_time", c_double),
        ("full_steps", c_size_t),
        ("steps", c_size_t),
    )


class CBlock(Structure):
    """Rows, each with the time in front: where they are, how many there may be, and are."""

    _fields_ = (("rows", c_void_p), ("most", c_size_t), ("n", c_size_t))


class CFailure(Structure):
    """The first call with a status that is worse than a warning."""

    _fields_ = (("stage", c_size_t), ("member", c_size_t), ("call", c_int), ("status", c_int))


#: Why Python has to look.
DUE, FAILED, NOT_FINITE = range(3)
