"""An FMU's library as a C program calls it: every argument as it is, every status as it comes.

fmpy turns a status into an exception and NULL into an error of its own; here both go through.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ctypes import (
    CDLL,
    CFUNCTYPE,
    Structure,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    cast,
    create_string_buffer,
    string_at,
)
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from fmus.kinds import NATIVE, PYTHON


class Status(IntEnum):
    """fmi2Status."""

    OK = 0
    Warning = 1
    Discard = 2
    Error = 3
    Fatal = 4


MODEL_EXCHANGE, CO_SIMULATION = range(2)
#: Types that have functions of their own; enumerations are integers.
TYPES = ("Real", "Integer", "Boolean", "String")
TERMINATED_KIND, LAST_SUCCESSFUL_TIME_KIND = 3, 2

#: Arguments after the component: a pointer, a number of things, an int or a double.
SIGNATURES = {
    "SetDebugLogging": "inp",
    "SetupExperiment": "iddid",
    "EnterInitializationMode": "",
    "ExitInitializationMode": "",
    "Terminate": "",
    "Reset": "",
    "CancelStep": "",
    **{f"{verb}{fmi_type}": "pnp" for fmi_type in TYPES for verb in ("Get", "Set")},
    **dict.fromkeys(("GetFMUstate", "SetFMUstate", "FreeFMUstate"), "p"),
    "SerializedFMUstateSize": "pp",
    "SerializeFMUstate": "ppn",
    "DeSerializeFMUstate": "pnp",
    "GetDirectionalDerivative": "pnpnpp",
    "SetRealInputDerivatives": "pnpp",
    "GetRealOutputDerivatives": "pnpp",
    "DoStep": "ddi",
    **{f"Get{fmi_type}Status": "ip" for fmi_type in ("", *TYPES)},
}
OF_MODEL_EXCHANGE = {
    "EnterEventMode": "", "NewDiscreteStates": "p", "EnterContinuousTimeMode": "",
    "CompletedIntegratorStep": "ipp", "SetTime": "d", "SetContinuousStates": "pn",
    "GetDerivatives": "pn", "GetEventIndicators": "pn", "GetContinuousStates": "pn",
    "GetNominalsOfContinuousStates": "pn",
}  # fmt: skip


def harmless() -> dict[str, list[Any]]:
    """Arguments for each function that do no harm: zero, or room for what a pointer asks for."""
    zeros = {"i": c_int, "d": c_double, "n": c_size_t, "p": c_double * 8}
    return {
        f"fmi2{name}": [zeros[kind]() for kind in signature]
        for name, signature in {**SIGNATURES, **OF_MODEL_EXCHANGE}.items()
    }


Logger = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)


class Callbacks(Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", Logger),
        ("allocate", c_void_p),
        ("release", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


#: calloc and free of this process.
_LIBC = CDLL(None)

#: Types of C for the types of FMI 2.0.
C_TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}


class Variable(NamedTuple):
    """A scalar variable, as modelDescription.xml declares it."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    start: Any
    minimum: float | None
    maximum: float | None


@dataclass(frozen=True, eq=False)
class Description:
    """modelDescription.xml; importing fmpy would take a second in each process."""

    name: str
    guid: str
    identifier: str
    variables: tuple[Variable, ...]
    kind: str = PYTHON

    def of(self, causality: str, fmi_type: str | None = None) -> list[Variable]:
        """The variables of a causality."""
        found = (v for v in self.variables if v.causality == causality)
        return [v for v in found if fmi_type in (None, v.type)]

    @cached_property
    def names(self) -> dict[tuple[int, str], str]:
        """By value reference and type."""
        return {(v.reference, v.type): v.name for v in self.variables}

    @cached_property
    def fault(self) -> Variable:
        return self.find("fault")

    def find(self, name: str) -> Variable:
        return next(v for v in self.variables if v.name == name)


def read_description(folder: Path) -> Description:
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    return description_in(root, NATIVE if (folder / "sources").is_dir() else PYTHON)


def description_in(root: ElementTree.Element, kind: str) -> Description:
    implementation = root.find("CoSimulation")
    assert implementation is not None
    return Description(
        root.attrib["modelName"],
        root.attrib["guid"],
        implementation.attrib["modelIdentifier"],
        tuple(_variable(element) for element in root.iterfind("ModelVariables/ScalarVariable")),
        kind,
    )


def _variable(element: ElementTree.Element) -> Variable:
    [value] = [child for child in element if child.tag in (*TYPES, "Enumeration")]
    fmi_type = "Integer" if value.tag == "Enumeration" else value.tag
    return variable(element, fmi_type, value, value.get("start"))


def variable(
    element: ElementTree.Element, fmi_type: str, limited: ElementTree.Element, start: str | None
) -> Variable:
    """A variable of an element, with the limits of one, and a start value as text."""
    convert = {"Real": float, "Integer": int, "Boolean": "true".__eq__, "String": str}[fmi_type]
    return Variable(
        element.attrib["name"],
        int(element.attrib["valueReference"]),
        fmi_type,
        element.get("causality", "local"),
        element.get("variability", "continuous"),
        None if start is None else convert(start),
        *(None if limit is None else float(limit) for limit in map(limited.get, ("min", "max"))),
    )


class Library:
    """The functions of an unpacked FMU."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.description = read_description(folder)
        self.functions = CDLL(
            str(folder / "binaries" / "linux64" / f"{self.description.identifier}.so")
        )
        self.functions.fmi2Instantiate.restype = c_void_p
        self.functions.fmi2FreeInstance.restype = None
        self.functions.fmi2GetVersion.restype = c_char_p
        self.functions.fmi2GetTypesPlatform.restype = c_char_p

    @property
    def answers(self) -> bool:
        """True if refusals are answered at the call: PythonFMU's own library cannot."""
        loaders = self.folder.glob("binaries/linux64/*_pythonfmu.so")
        return self.description.kind == NATIVE or any(loaders)

    @property
    def location(self) -> str:
        return (self.folder / "resources").as_uri()


class Message(NamedTuple):
    """A message of an FMU."""

    status: Status
    category: str
    text: str


class _Arrays:
    """Arrays for repeated get calls of the same variables."""

    def __init__(self, fmi_type: str, variables: Sequence[Variable]) -> None:
        self.type = fmi_type
        self.names = [variable.name for variable in variables]
        self.n = c_size_t(len(variables))
        self.references = (c_uint * len(variables))(*(v.reference for v in variables))
        self.values = (C_TYPES[fmi_type] * len(variables))()


class Host:
    """One instance, its callbacks, and the messages it has sent."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.description = library.description
        self.messages: list[Message] = []
        #: Called by the logger; what it does is the test's business.
        self.when_told: Callable[[], object] = lambda: None
        self._logger = Logger(self._log)
        memory = (cast(_LIBC.calloc, c_void_p), cast(_LIBC.free, c_void_p))
        self.callbacks = Callbacks(self._logger, *memory, None, None)
        self.component: int | None = None
        self._arrays = {
            type_: _Arrays(type_, [v for v in self.description.variables if v.type == type_])
            for type_ in TYPES
        }
        self._outputs = _Arrays("Real", self.description.of("output", "Real"))

    def _log(self, _environment: int, _name: bytes, status: int, category: bytes, text: bytes):
        texts = (word.decode("utf-8", "replace") for word in (category or b"", text or b""))
        self.messages.append(Message(Status(status), *texts))
        self.when_told()

    def instantiate(
        self,
        name: bytes | None = b"raw",
        kind: int = CO_SIMULATION,
        guid: bytes | None = b"as declared",
        location: bytes | None = b"as unpacked",
        callbacks: str = "all",
        logging: bool = True,
    ) -> bool:
        """Make an instance; True if there is one. The defaults are a good call."""
        if guid == b"as declared":
            guid = self.description.guid.encode()
        if location == b"as unpacked":
            location = self.library.location.encode()
        if callbacks == "no logger":
            self.callbacks.logger = Logger()
        self.component = self.library.functions.fmi2Instantiate(
            c_char_p(name),
            kind,
            c_char_p(guid),
            c_char_p(location),
            None if callbacks == "none" else byref(self.callbacks),
            0,
            int(logging),
        )
        return self.component is not None

    def free(self) -> None:
        if self.component is not None:
            self.library.functions.fmi2FreeInstance(c_void_p(self.component))
            self.component = None

    def call(self, function: str, *arguments: Any) -> Status:
        """Call a function on the instance."""
        return self.call_on(self.component, function, *arguments)

    def call_on(self, component: int | None, function: str, *arguments: Any) -> Status:
        """Call a function on anything; arguments are what ctypes takes."""
        return Status(getattr(self.library.functions, function)(c_void_p(component), *arguments))

    # Good calls, in short

    def setup(self, start: float = 0.0, stop: float | None = None) -> Status:
        return self.call(
            "fmi2SetupExperiment",
            0, c_double(0.0),
            c_double(start),
            int(stop is not None), c_double(stop or 0.0),
        )  # fmt: skip

    def enter(self) -> Status:
        return self.call("fmi2EnterInitializationMode")

    def exit(self) -> Status:
        return self.call("fmi2ExitInitializationMode")

    def step(self, time: float, h: float) -> Status:
        return self.call("fmi2DoStep", c_double(time), c_double(h), 1)

    def set(self, fmi_type: str, references: Sequence[int], values: Sequence[Any]) -> Status:
        n = len(references)
        return self.call(
            f"fmi2Set{fmi_type}",
            (c_uint * n)(*references),
            c_size_t(n),
            (C_TYPES[fmi_type] * n)(*values),
        )

    def get(self, fmi_type: str, references: Sequence[int]) -> tuple[Status, list[Any]]:
        n = len(references)
        values = (C_TYPES[fmi_type] * n)()
        status = self.call(f"fmi2Get{fmi_type}", (c_uint * n)(*references), c_size_t(n), values)
        return status, list(values)

    def value(self, variable: Variable) -> Any:
        status, [value] = self.get(variable.type, [variable.reference])
        assert status == Status.OK, f"{variable.name} cannot be read: {status.name}"
        return value

    def _read(self, arrays: _Arrays) -> list[Any]:
        """Values of variables; all None if there are no outputs for lack of a start."""
        status = self.call(f"fmi2Get{arrays.type}", arrays.references, arrays.n, arrays.values)
        if status == Status.Error:
            return [None] * len(arrays.names)
        assert status == Status.OK, f"values cannot be read: {status.name}"
        return list(arrays.values)

    def values(self) -> dict[str, Any]:
        """The values of all ports, by name."""
        found: dict[str, Any] = {}
        for arrays in self._arrays.values():
            if arrays.names:
                found |= zip(arrays.names, self._read(arrays), strict=True)
        return found

    def outputs(self) -> list[float]:
        """The values of the Real outputs, which take least time."""
        return self._read(self._outputs)

    def fault(self) -> bool:
        return bool(self.value(self.description.fault))

    def get_state(self) -> int:
        state = c_void_p()
        status = self.call("fmi2GetFMUstate", byref(state))
        assert status == Status.OK and state.value is not None, f"no state: {status.name}"
        return state.value

    def set_state(self, state: int | None) -> Status:
        return self.call("fmi2SetFMUstate", c_void_p(state))

    def free_state(self, state: int) -> Status:
        return self.call("fmi2FreeFMUstate", byref(c_void_p(state)))

    def serialised(self, state: int) -> bytes:
        size = c_size_t()
        status = self.call("fmi2SerializedFMUstateSize", c_void_p(state), byref(size))
        assert status == Status.OK, f"no size of a state: {status.name}"
        content = create_string_buffer(size.value)
        status = self.call("fmi2SerializeFMUstate", c_void_p(state), content, size)
        assert status == Status.OK, f"a state cannot be serialised: {status.name}"
        return string_at(content, size.value)

    def deserialised(self, content: bytes) -> tuple[Status, int | None]:
        state = c_void_p()
        status = self.call("fmi2DeSerializeFMUstate", content, c_size_t(len(content)), byref(state))
        return status, state.value

    def content(self) -> bytes:
        """The serialised state as it is now."""
        state = self.get_state()
        try:
            return self.serialised(state)
        finally:
            self.free_state(state)


@contextmanager
def instance(library: Library, **arguments: Any) -> Iterator[Host]:
    """An instance, freed in the end."""
    host = Host(library)
    assert host.instantiate(**arguments), [message.text for message in host.messages]
    try:
        yield host
    finally:
        host.free()


@contextmanager
def initialised(library: Library, **arguments: Any) -> Iterator[Host]:
    """An instance that can step, without messages."""
    with instance(library, **arguments) as host:
        assert host.setup() == host.enter() == host.exit() == Status.OK
        host.messages.clear()
        yield host
