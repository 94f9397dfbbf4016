"""The state of an FMU: complete, exact, in memory and as bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, TypedDict

from fmus.ports.port import Refusal, Value
from fmus.slave.store import Store


class Snapshot(TypedDict):
    """Everything that the rest of a run depends on, fit for JSON."""

    identity: str  #: class and version that it is a state of
    mode: str
    start_time: float
    parameters: dict[str, Value]
    inputs: list[float]
    outputs: list[float]
    state: Any  #: NamedTuple of the component, None before the initialisation
    hidden: Any  #: what the component keeps outside its state
    fault: bool
    refused: dict[str, str]


def to_bytes(snapshot: Mapping[str, Any]) -> bytes:
    """JSON, which gives every float back bit for bit."""
    return json.dumps(snapshot).encode("utf-8")


def from_bytes(content: bytes) -> dict[str, Any]:
    """What was made into bytes; what is no state at all becomes an empty one.

    It is refused when it is set: nothing can be reported where PythonFMU calls this.
    """
    try:
        saved = json.loads(content)
    except ValueError:
        saved = None
    return saved if isinstance(saved, dict) else {}


def checked(saved: Mapping[str, Any], identity: str, store: Store) -> Snapshot:
    """A copy of what was saved, if it can be a state of this component.

    Raises:
        Refusal: it belongs to another component or version, or has other ports.
        Exception: a part is missing or of another type.

    """
    if saved.get("identity") != identity:
        raise Refusal(f"not a state of {identity}")
    copy = Snapshot(
        identity=identity,
        mode=str(saved["mode"]),
        start_time=float(saved["start_time"]),
        parameters=dict(saved["parameters"]),
        inputs=[float(value) for value in saved["inputs"]],
        outputs=[float(value) for value in saved["outputs"]],
        state=_frozen(saved["state"]),
        hidden=_frozen(saved["hidden"]),
        fault=bool(saved["fault"]),
        refused=dict(saved["refused"]),
    )
    if (len(copy["inputs"]), len(copy["outputs"]), copy["parameters"].keys()) != (
        len(store.inputs),
        len(store.outputs),
        store.parameters.keys(),
    ):
        raise Refusal("a state with other ports")
    return copy


def _frozen(value: Any) -> Any:
    """Lists, as JSON gives them, back to the tuples that states are made of."""
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value
