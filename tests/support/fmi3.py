"""An FMU of FMI 3.0, called by the functions of FMI 2.0.

Most rows of fmi-answers.md hold under the names of both versions; so the tests of an FMU
of FMI 2.0 are also tests of one of FMI 3.0.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Container
from ctypes import (
    CDLL,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_size_t,
    c_uint,
    c_uint8,
    c_void_p,
)
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy

from fmus.kinds import NATIVE
from support.raw import MODEL_EXCHANGE, Description, Library, Variable, variable
from support.status_table import names_in_fmi3

Logger = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)

_KINDS = {
    "Float64": "Real", "Int32": "Integer", "Enumeration": "Integer",
    "Boolean": "Boolean", "String": "String",
}  # fmt: skip

#: Start time, whether there is a stop time, and which, as fmi2SetupExperiment takes them.
_NO_EXPERIMENT = (0, c_double(0.0), c_double(0.0), 0, c_double(0.0))


def read_description(folder: Path) -> Description:
    """modelDescription.xml, with the names of FMI 2.0; the time is an additional variable."""
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    implementation, variables = root.find("CoSimulation"), root.find("ModelVariables")
    assert implementation is not None and variables is not None
    return Description(
        root.attrib["modelName"],
        root.attrib["instantiationToken"],
        implementation.attrib["modelIdentifier"],
        tuple(map(_variable, variables)),
        NATIVE,
    )


def _variable(element: ElementTree.Element) -> Variable:
    text = element.find("Start")
    start = element.get("start") if text is None else text.get("value")
    return variable(element, _KINDS[element.tag], element, start)


class Fmi3Library(Library):
    """The functions of an unpacked FMU of FMI 3.0, under their names in FMI 2.0."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.description = read_description(folder)
        library = f"{self.description.identifier}{fmpy.sharedLibraryExtension}"
        self.own = CDLL(str(folder / "binaries" / fmpy.platform_tuple / library))
        for name in ("CoSimulation", "ModelExchange", "ScheduledExecution"):
            getattr(self.own, f"fmi3Instantiate{name}").restype = c_void_p
        self.own.fmi3FreeInstance.restype = None
        self.own.fmi3GetVersion.restype = c_char_p
        root = ElementTree.parse(folder / "modelDescription.xml")
        enumerations = root.iterfind("ModelVariables/Enumeration")
        self.functions: Any = _Functions(
            self.own, {int(element.attrib["valueReference"]) for element in enumerations}
        )


class _Functions:
    """Functions of FMI 2.0 as attributes, made of functions of FMI 3.0."""

    def __init__(self, library: CDLL, enumerations: Container[int]) -> None:
        self._library = library
        self._enumerations = enumerations
        self._loggers: list[Any] = []
        self._experiments: dict[Any, tuple[Any, ...]] = {}

    def fmi2Instantiate(
        self, name: c_char_p, kind: int, guid: c_char_p, _location: c_char_p,
        callbacks: Any, visible: int, logging: int,
    ) -> Any:  # fmt: skip
        logger = self._logger(callbacks)
        before = (name, guid, None, c_bool(visible), c_bool(logging))
        if kind == MODEL_EXCHANGE:
            return self._library.fmi3InstantiateModelExchange(*before, None, logger)
        no_events = (c_bool(False), c_bool(False), None, c_size_t(0))
        return self._library.fmi3InstantiateCoSimulation(*before, *no_events, None, logger, None)

    def _logger(self, callbacks: Any) -> Any:
        log = callbacks._obj.logger if callbacks is not None else None
        if not log:
            return Logger()
        logger = Logger(
            lambda environment, status, category, text: log(
                environment, None, status, category, text
            )
        )
        self._loggers.append(logger)
        return logger

    def fmi2FreeInstance(self, component: c_void_p) -> None:
        self._library.fmi3FreeInstance(component)

    # FMI 3.0 has one function for both.

    def fmi2SetupExperiment(self, component: c_void_p, *experiment: Any) -> int:
        self._experiments[component.value] = experiment
        return 0

    def fmi2EnterInitializationMode(self, component: c_void_p) -> int:
        has_tolerance, tolerance, start, has_stop, stop = self._experiments.pop(
            component.value, _NO_EXPERIMENT
        )
        entered: int = self._library.fmi3EnterInitializationMode(
            component, c_bool(has_tolerance), tolerance, start, c_bool(has_stop), stop
        )
        return entered

    def fmi2DoStep(self, component: c_void_p, time: c_double, h: c_double, no_set: int) -> int:
        flags = [c_bool(True) for _ in range(3)]
        reached = c_double()
        status: int = self._library.fmi3DoStep(
            component, time, h, c_bool(no_set), *map(byref, flags), byref(reached)
        )
        assert status or not any(flags), (
            "events, an end or an early return, which there are none of"
        )
        return status

    # A boolean has one byte.

    def fmi2SetBoolean(self, component: c_void_p, references: Any, n: c_size_t, values: Any) -> int:
        given = None if values is None else (c_uint8 * len(values))(*(v & 0xFF for v in values))
        status: int = self._library.fmi3SetBoolean(component, references, n, given, n)
        return status

    def fmi2GetBoolean(self, component: c_void_p, references: Any, n: c_size_t, values: Any) -> int:
        got = None if values is None else (c_uint8 * len(values))(*(v & 0xFF for v in values))
        status: int = self._library.fmi3GetBoolean(component, references, n, got, n)
        for i in range(len(got or ())):
            values[i] = got[i]
        return status

    # An enumeration has its own functions, of another type of C.

    def fmi2SetInteger(self, component: c_void_p, references: Any, n: c_size_t, values: Any) -> int:
        return self._integers("Set", component, references, n, values)

    def fmi2GetInteger(self, component: c_void_p, references: Any, n: c_size_t, values: Any) -> int:
        return self._integers("Get", component, references, n, values)

    def _integers(
        self, verb: str, component: c_void_p, references: Any, n: c_size_t, values: Any
    ) -> int:
        """Call the function for integers, and for enumerations their own."""
        wide = [
            i for i, reference in enumerate(references or ()) if reference in self._enumerations
        ]
        if values is None or not wide or len(references) != n.value:
            function = getattr(self._library, f"fmi3{verb}Int32")
            return int(function(component, references, n, values, n))
        narrow = [i for i in range(n.value) if i not in wide]
        worst = 0
        for kind, c_type, places in (("Int64", c_int64, wide), ("Int32", c_int, narrow)):
            m = len(places)
            some = (c_type * m)(*(values[i] for i in places))
            numbers = (c_uint * m)(*(references[i] for i in places))
            function = getattr(self._library, f"fmi3{verb}{kind}")
            if m:
                worst = max(worst, function(component, numbers, c_size_t(m), some, c_size_t(m)))
            for i, value in zip(places, some, strict=True):
                values[i] = value
        return worst

    def __getattr__(self, name: str) -> Callable[..., int]:
        function = getattr(self._library, names_in_fmi3()[name])
        if name.endswith(("Real", "String")):
            return lambda component, references, n, values: function(
                component, references, n, values, n
            )
        return function  # type: ignore[no-any-return]
