"""A host of one FMU that shares no code with the master, for comparison.

As plain as FMI allows: ctypes, a fixed step, t_k = k h, every Real output read after every step.
`python host.py FMU RUN OUT`, where RUN is what `ours.py` has written about the same run.
"""

from __future__ import annotations

import ctypes
import json
import sys
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np

#: Types by what the functions that get and set them are called.
_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
}

#: fmi2Type of a co-simulation, and the first fmi2Status of a call that has not done its work.
_CO_SIMULATION, _DISCARD = 1, 2

_Logger = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)
_Logger3 = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
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
    """A real variable of the description, or an array: names of its elements, value reference."""

    def __init__(self, element: ElementTree.Element, shape: list[int]) -> None:
        """Read an element of the description."""
        name = element.get("name", "")
        self.causality = element.get("causality", "local")
        self.reference = int(element.get("valueReference", "0"))
        self.type = next(e.tag for e in (element, *element) if e.tag in _TYPES)
        places = product(*(range(1, length + 1) for length in shape))
        self.names = [f"{name}[{','.join(map(str, p))}]" if p else name for p in places]


class Host:
    """One FMU of FMI 2.0, from its archive to its steps."""

    fmi, platform = "fmi2", "linux64"

    def __init__(self, folder: Path, root: ElementTree.Element) -> None:
        """Read the description, and load the library."""
        self.folder = folder
        simulation = root.find("CoSimulation")
        assert simulation is not None
        self.variables = [
            Variable(element, self.shape(root, element))
            for element in root.iterfind("ModelVariables/*")
            if any(e.tag in _TYPES for e in (element, *element))
        ]
        self.guid = root.get("guid", root.get("instantiationToken", ""))
        identifier = simulation.get("modelIdentifier", "")
        self.dll = ctypes.CDLL(str(folder / "binaries" / self.platform / f"{identifier}.so"))
        self.instance = ctypes.c_void_p()

    def shape(self, _: ElementTree.Element, __: ElementTree.Element) -> list[int]:
        """Lengths of an array; empty for a scalar."""
        return []

    def call(self, name: str, *arguments: object) -> None:
        """Call a function of the instance."""
        status = self.dll[f"{self.fmi}{name}"](self.instance, *arguments)
        if status >= _DISCARD:
            raise RuntimeError(f"{self.fmi}{name} returns {status}")

    def initialise(self, values: Mapping[str, float]) -> None:
        """Instantiate and initialise the FMU with other start values."""
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
        """Set variables by the names of their elements."""
        for variable in self.variables:
            if variable.names[0] in values:
                wanted = [values[name] for name in variable.names]
                self.access("Set", variable, (_TYPES[variable.type] * len(wanted))(*wanted))

    def value(self, variable: Variable) -> list[float]:
        """The values of a variable's elements."""
        values = (_TYPES[variable.type] * len(variable.names))()
        self.access("Get", variable, values)
        return list(values)

    def access(self, action: str, variable: Variable, values: Any, *more: object) -> None:
        """Get or set a variable."""
        reference, count = ctypes.c_uint(variable.reference), ctypes.c_size_t(1)
        self.call(f"{action}{variable.type}", ctypes.byref(reference), count, values, *more)

    def step(self, time: float, length: float) -> None:
        """Make a step."""
        self.call("DoStep", ctypes.c_double(time), ctypes.c_double(length), 1)

    def rows(self, steps: int, step: float, values: Mapping[str, float]) -> np.ndarray:
        """Values of all Real outputs at the start and after each step."""
        self.initialise(values)
        outputs = [variable for variable in self.variables if variable.causality == "output"]
        table = [[value for output in outputs for value in self.value(output)]]
        for k in range(steps):
            self.step(k * step, step)
            table.append([value for output in outputs for value in self.value(output)])
        return np.array(table)


class Host3(Host):
    """One FMU of FMI 3.0."""

    fmi, platform = "fmi3", "x86_64-linux"

    def shape(self, root: ElementTree.Element, element: ElementTree.Element) -> list[int]:
        """Lengths of an array, which may be structural parameters."""
        sizes = {e.get("valueReference"): e.get("start") for e in root.iterfind("ModelVariables/*")}
        dimensions = element.findall("Dimension")
        return [int(d.get("start") or sizes[d.get("valueReference")] or 0) for d in dimensions]

    def initialise(self, values: Mapping[str, float]) -> None:
        """Instantiate and initialise the FMU with other start values."""
        self._log = _Logger3(lambda *_: None)
        self.dll.fmi3InstantiateCoSimulation.restype = ctypes.c_void_p
        resources = f"{self.folder / 'resources'}/".encode()
        no = [ctypes.c_bool(False)] * 4
        nothing = ctypes.c_void_p()
        self.instance.value = self.dll.fmi3InstantiateCoSimulation(
            b"fmu", self.guid.encode(), resources, *no, nothing, ctypes.c_size_t(0), nothing,
            self._log, nothing,
        )  # fmt: skip
        if not self.instance.value:
            raise RuntimeError("fmi3InstantiateCoSimulation returns NULL")
        zero = ctypes.c_double(0.0)
        self.set(values)
        self.call("EnterInitializationMode", no[0], zero, zero, no[0], zero)
        self.set(values)
        self.call("ExitInitializationMode")

    def access(self, action: str, variable: Variable, values: Any, *_: object) -> None:
        """Get or set a variable."""
        super().access(action, variable, values, ctypes.c_size_t(len(values)))

    def step(self, time: float, length: float) -> None:
        """Make a step."""
        flags = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        last = ctypes.byref(ctypes.c_double())
        yes = ctypes.c_bool(True)
        self.call("DoStep", ctypes.c_double(time), ctypes.c_double(length), yes, *flags, last)


def host_of(fmu: Path) -> Host:
    """The host of an FMU, which it unpacks."""
    folder = Path(mkdtemp())
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    return (Host if root.get("fmiVersion") == "2.0" else Host3)(folder, root)


if __name__ == "__main__":
    run = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
    rows = host_of(Path(sys.argv[1])).rows(run["rows"] - 1, run["step"], run["wanted"])
    np.save(sys.argv[3], rows)
