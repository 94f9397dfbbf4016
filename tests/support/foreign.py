"""Misbehaving FMUs: one in C, and one built by PythonFMU."""

from __future__ import annotations

from pathlib import Path
from zlib import crc32

from pythonfmu import FmuBuilder

from orchestrator.cosim import System
from support.small_fmus import connected, constants, description, unknown, variable, write

_SOURCE = Path(__file__).with_name("foreign.c")

_DESCRIPTION = description(
    "foreign",
    (
        variable("u", 0, "input"),
        variable("y", 1, "output", initial="calculated"),
        variable("at", 2, "parameter"),
        variable("act", 3, "parameter", "Integer"),
        variable("phase", 4, "parameter", "Integer"),
    ),
    (unknown(2, ""),),
)

#: When it misbehaves, and how.
PHASES, ACTS = constants(_SOURCE, "ENTER"), constants(_SOURCE, "BEHAVE")

_SLAVE = """
import builtins, json, os, sys
import numpy
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Acts(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        if current_time > 0.1:
            {act}
        self.y = current_time + step_size
        return True
"""


def build_raising_fmu(folder: Path) -> Path:
    """A slave of PythonFMU, as its own builder makes it, whose step raises after 0.1 s."""
    return build_slave(folder, 'raise RuntimeError("no water left")')


def build_slave(folder: Path, act: str) -> Path:
    """A slave of PythonFMU, whose output is the time, with a statement that its step executes."""
    # A process imports a module of a name once.
    script = folder / f"acts_{crc32(act.encode())}.py"
    script.write_text(_SLAVE.format(act=act), encoding="utf-8")
    return Path(FmuBuilder.build_FMU(script, dest=folder))


def foreign_system(fmu: Path, act: str = "BEHAVE", phase: str = "STEP", at: float = 0.1) -> System:
    """Two instances of the FMU in C: the first misbehaves and feeds the second."""
    values = {"bad.act": ACTS[act], "bad.phase": PHASES[phase], "bad.at": at, "bad.u": 0.0}
    return connected("foreign", {"bad": fmu, "good": fmu}, {"good.u": "bad.y"}, values)


def build_c_fmu(folder: Path) -> Path:
    """The FMU in C; the test is skipped where there is no compiler."""
    return write(folder / "foreign.fmu", _DESCRIPTION, _SOURCE)
