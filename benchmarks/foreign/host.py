"""A host of one FMU that shares nothing with the master: what it is held against.

As plain as FMI 2.0 allows: ctypes, a fixed step, t_k = k h, every Real output read after every
step. `python host.py FMU RUN OUT`, where RUN is what `ours.py` has written about the same run.
"""

from __future__ import annotations

import ctypes
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np

#: Types by what the functions that get and set them are called.
_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Enumeration": ctypes.c_int,
    "Boolean": ctypes.c_int,
}

#: fmi2Type of a co-simulation, and the first fmi2Status of a call that has not done its work.
_CO_SIMULATION, _DISCARD = 1, 2

_Logger = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)
_Allocate = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t)
_Free = ctypes.CFUNCTYPE(None, ctypes.c_void_p)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _Logger),
        ("allocate", _Allocate),
        ("free", _Free),
        ("finished", ctypes.c_void_p),
        ("environment", ctypes.c_void_p),
    )


class Variable:
    """A variable of the description: name, causality, value reference, name of its type."""

    def __init__(self, element: ElementTree.Element) -> None:
        """Read what is needed."""
        self.name = element.get("name", "")
        self.causality = element.get("causality", "local")
        self.reference = int(element.get("valueReference", "0"))
        self.type = next(child.tag for child in element if child.tag in (*_TYPES, "String"))


class Host:
    """One FMU, from its archive to its steps."""

    def __init__(self, fmu: Path) -> None:
        """Unpack and load it."""
        self.folder = Path(mkdtemp())
        with ZipFile(fmu) as archive:
            archive.extractall(self.folder)
        root = ElementTree.parse(self.folder / "modelDescription.xml").getroot()
        simulation = root.find("CoSimulation")
        assert simulation is not None
        self.variables = [Variable(e) for e in root.iterfind("ModelVariables/ScalarVariable")]
        self.guid = root.get("guid", "")
        identifier = simulation.get("modelIdentifier", "")
        self.dll = ctypes.CDLL(str(self.folder / "binaries" / "linux64" / f"{identifier}.so"))
        self.instance = ctypes.c_void_p()

    def call(self, name: str, *arguments: object) -> None:
        """Call a function of the instance."""
        status = self.dll[f"fmi2{name}"](self.instance, *arguments)
        if status >= _DISCARD:
            raise RuntimeError(f"fmi2{name} returns {status}")

    def initialise(self, values: Mapping[str, float]) -> None:
        """Instantiate it, and lead it through initialisation with other start values."""
        library = ctypes.CDLL(None)
        self._callbacks = _Callbacks(
            _Logger(lambda *_: None),
            ctypes.cast(library.calloc, _Allocate),
            ctypes.cast(library.free, _Free),
        )
        self.dll.fmi2Instantiate.restype = ctypes.c_void_p
        self.instance.value = self.dll.fmi2Instantiate(
            b"fmu",
            _CO_SIMULATION,
            self.guid.encode(),
            (self.folder / "resources").as_uri().encode(),
            ctypes.byref(self._callbacks),
            0,
            0,
        )
        if not self.instance.value:
            raise RuntimeError("fmi2Instantiate returns NULL")
        zero = ctypes.c_double(0.0)
        self.set(values)
        self.call("SetupExperiment", 0, zero, zero, 0, zero)
        self.call("EnterInitializationMode")
        # Some FMUs take their own values when they enter it.
        self.set(values)
        self.call("ExitInitializationMode")

    def set(self, values: Mapping[str, float]) -> None:
        """Set variables by their names."""
        for variable in self.variables:
            if variable.name in values:
                self._access("Set", variable, _TYPES[variable.type](values[variable.name]))

    def value(self, variable: Variable) -> float:
        """The value of a variable."""
        value = _TYPES[variable.type]()
        self._access("Get", variable, value)
        return float(value.value)

    def _access(self, action: str, variable: Variable, value: Any) -> None:
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        reference = ctypes.c_uint(variable.reference)
        one = ctypes.c_size_t(1)
        self.call(f"{action}{kind}", ctypes.byref(reference), one, ctypes.byref(value))

    def rows(self, steps: int, step: float, values: Mapping[str, float]) -> np.ndarray:
        """Values of all Real outputs at the start and after each step."""
        self.initialise(values)
        outputs = [v for v in self.variables if v.causality == "output" and v.type == "Real"]
        table = [[self.value(output) for output in outputs]]
        for k in range(steps):
            self.call("DoStep", ctypes.c_double(k * step), ctypes.c_double(step), 1)
            table.append([self.value(output) for output in outputs])
        return np.array(table)


if __name__ == "__main__":
    run = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
    np.save(sys.argv[3], Host(Path(sys.argv[1])).rows(run["rows"] - 1, run["step"], run["wanted"]))
