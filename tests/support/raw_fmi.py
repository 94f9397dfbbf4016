"""The C functions of an FMU as they are, with nothing between them and the test."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any, NamedTuple

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
MODEL_EXCHANGE, CO_SIMULATION = range(2)

Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)

#: What the functions of model exchange take after the component.
OF_MODEL_EXCHANGE: dict[str, tuple[Any, ...]] = {
    "EnterEventMode": (),
    "NewDiscreteStates": (c_void_p,),
    "EnterContinuousTimeMode": (),
    "CompletedIntegratorStep": (c_int, POINTER(c_int), POINTER(c_int)),
    "SetTime": (c_double,),
    "SetContinuousStates": (POINTER(c_double), c_size_t),
    "GetDerivatives": (POINTER(c_double), c_size_t),
    "GetEventIndicators": (POINTER(c_double), c_size_t),
    "GetContinuousStates": (POINTER(c_double), c_size_t),
    "GetNominalsOfContinuousStates": (POINTER(c_double), c_size_t),
}

#: What each function takes after the component.
SIGNATURES: dict[str, tuple[Any, ...]] = {
    "SetDebugLogging": (c_int, c_size_t, POINTER(c_char_p)),
    "SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "EnterInitializationMode": (),
    "ExitInitializationMode": (),
    "Terminate": (),
    "Reset": (),
    **{f"{verb}{kind}": (POINTER(c_uint), c_size_t, POINTER(value))
       for kind, value in (
           ("Real", c_double), ("Integer", c_int), ("Boolean", c_int), ("String", c_char_p))
       for verb in ("Get", "Set")},
    "GetFMUstate": (POINTER(c_void_p),),
    "SetFMUstate": (c_void_p,),
    "FreeFMUstate": (POINTER(c_void_p),),
    "SerializedFMUstateSize": (c_void_p, POINTER(c_size_t)),
    "SerializeFMUstate": (c_void_p, c_char_p, c_size_t),
    "DeSerializeFMUstate": (c_char_p, c_size_t, POINTER(c_void_p)),
    "GetDirectionalDerivative": (POINTER(c_uint), c_size_t, POINTER(c_uint), c_size_t,
                                 POINTER(c_double), POINTER(c_double)),
    "SetRealInputDerivatives": (POINTER(c_uint), c_size_t, POINTER(c_int), POINTER(c_double)),
    "GetRealOutputDerivatives": (POINTER(c_uint), c_size_t, POINTER(c_int), POINTER(c_double)),
    "DoStep": (c_double, c_double, c_int),
    "CancelStep": (),
    "GetStatus": (c_int, POINTER(c_int)),
    "GetRealStatus": (c_int, POINTER(c_double)),
    "GetIntegerStatus": (c_int, POINTER(c_int)),
    "GetBooleanStatus": (c_int, POINTER(c_int)),
    "GetStringStatus": (c_int, POINTER(c_char_p)),
    **OF_MODEL_EXCHANGE,
}  # fmt: skip


class Message(NamedTuple):
    instance: str
    status: int
    category: str
    text: str


class Callbacks(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", Logger),
        ("allocate", c_void_p),
        ("release", c_void_p),
        ("step_finished", c_void_p),
        ("environment", c_void_p),
    )


class RawFmu:
    """An unpacked FMU; `fmu.DoStep(component, ...)` is fmi2DoStep and gives its status."""

    def __init__(self, folder: Path) -> None:
        self.location = f"file://{folder}/resources".encode()
        [library] = (
            path
            for path in folder.glob("binaries/linux64/*.so")
            if not path.stem.endswith("_pythonfmu")
        )
        self.library = ctypes.CDLL(str(library))
        for name, signature in SIGNATURES.items():
            getattr(self.library, f"fmi2{name}").argtypes = (c_void_p, *signature)
        self.library.fmi2Instantiate.restype = c_void_p
        self.library.fmi2Instantiate.argtypes = (
            c_char_p, c_int, c_char_p, c_char_p, c_void_p, c_int, c_int,
        )  # fmt: skip
        self.library.fmi2FreeInstance.argtypes = (c_void_p,)
        self.library.fmi2FreeInstance.restype = None
        self.messages: list[Message] = []
        #: Called by the logger; what it does is the test's business.
        self.when_told = lambda: None
        self._callbacks = Callbacks(Logger(self._log), None, None, None, None)

    def _log(self, environment: Any, instance: bytes, status: int, category: bytes, text: bytes):
        self.messages.append(Message(instance.decode(), status, category.decode(), text.decode()))
        self.when_told()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.library, f"fmi2{name}")

    def instantiate(
        self,
        name: bytes | None = b"raw",
        kind: int = CO_SIMULATION,
        guid: bytes | None = None,
        location: bytes | None = b"",
        callbacks: Any = ...,
        logging: int = 1,
    ) -> int | None:
        """The component; None if there is none. Empty location: that of the FMU."""
        if callbacks is ...:
            callbacks = ctypes.byref(self._callbacks)
        if location == b"":
            location = self.location
        made: int | None = self.library.fmi2Instantiate(
            name, kind, guid, location, callbacks, 0, logging
        )
        return made

    def initialised(self) -> int:
        """A component that can step."""
        component = self.instantiate()
        assert component is not None
        assert self.SetupExperiment(component, 0, 0.0, 0.0, 0, 0.0) == OK
        assert self.EnterInitializationMode(component) == OK
        assert self.ExitInitializationMode(component) == OK
        return component
