"""Run a component of one file by its hooks, without an FMU."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from importlib.util import module_from_spec, spec_from_file_location
from inspect import signature
from math import ceil
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any, NamedTuple, get_args, get_type_hints

EXAMPLES = Path(__file__).parents[2] / "examples"

#: An output of a run: one value a communication point, under the name of its port.
Run = dict[str, list[Any]]


class _Nothing(NamedTuple):
    pass


def load(name: str) -> ModuleType:
    """The module of an example."""
    spec = spec_from_file_location(f"examples_{name}", EXAMPLES / name / f"{name}.py")
    assert spec and spec.loader
    module = module_from_spec(spec)
    # Its annotations are text, which is evaluated where it was written.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def run(
    module: ModuleType,
    parameters: Mapping[str, Any] | None = None,
    inputs: Callable[[float], Mapping[str, Any]] = lambda t: {},
    *,
    stop_time: float,
    step: float,
    h_max: float = 0.02,
) -> Run:
    """Outputs of a component, and the times at which they are seen.

    Args:
        module: of the component.
        parameters: by port, where they are not the defaults.
        inputs: by port, from the time at the beginning of a step, over which they are held.
        stop_time: of the run, which starts at zero [s].
        step: between communication points [s].
        h_max: longest internal step of a component that takes n of them [s].

    """
    given: dict[str, Any] = {"t": 0.0}
    given["parameters"] = _filled(module, "Parameters", parameters or {})
    given["inputs"] = _filled(module, "Inputs", inputs(0.0))
    if hasattr(module, "check"):
        _call(module.check, given)
    noise = Random(_call(module.seed, given)) if hasattr(module, "seed") else Random(0)
    given["state"], outputs = _step(module.begin, given)
    seen: Run = {"time": []}
    _record(module, seen, 0.0, _measured(module, given, outputs, noise))
    if "n" in signature(module.advance).parameters:
        given["n"] = ceil(step / h_max * (1.0 - 1e-9))
        given["h"] = step / given["n"]
    else:
        given["h"] = step
    for k in range(round(stop_time / step)):
        given["t"] = k * step
        given["inputs"] = _filled(module, "Inputs", inputs(k * step))
        given["state"], outputs = _step(module.advance, given)
        _record(module, seen, (k + 1) * step, _measured(module, given, outputs, noise))
    return seen


def _call(hook: Callable[..., Any], given: Mapping[str, Any]) -> Any:
    """What a hook returns; it takes those arguments that it has."""
    return hook(*(given[name] for name in signature(hook).parameters))


def _step(hook: Callable[..., Any], given: Mapping[str, Any]) -> tuple[Any, Any]:
    """State and outputs; a component without a state returns its outputs only."""
    found = _call(hook, given)
    return (_Nothing(), found) if hasattr(found, "_asdict") else found


def _filled(module: ModuleType, name: str, values: Mapping[str, Any]) -> Any:
    """A NamedTuple of the module with some values, by port, that are not the defaults."""
    if not hasattr(module, name):
        assert not values
        return _Nothing()
    filled = getattr(module, name)()
    for port, value in values.items():
        field, *places = re.split(r"[.\[,\]]+", port.rstrip("]"))
        old = getattr(filled, field)
        if places:
            indices = [_place(module, name, field, place) for place in places]
            if len(indices) == 2:
                value = old[indices[0]].replaced(indices[1], value)
            value = old.replaced(indices[0], value)
        assert type(value) is type(old), port
        filled = filled._replace(**{field: value})
    return filled


def _place(module: ModuleType, name: str, field: str, member: str) -> int:
    if member.isdigit():
        return int(member) - 1
    return _members(module, name, field).index(member)


def _members(module: ModuleType, name: str, field: str) -> tuple[str, ...]:
    """Names of the elements of a field, if it has names."""
    hint = get_type_hints(getattr(module, name), include_extras=True)[field]
    declared = [one.members for one in get_args(hint) if getattr(one, "members", None)]
    return declared[0] if declared else ()


def _measured(module: ModuleType, given: Mapping[str, Any], outputs: Any, noise: Random) -> Any:
    """The outputs, one of them with noise."""
    if not hasattr(module, "measured"):
        return outputs
    (name,) = set(signature(module.measured).parameters) - {"parameters", "n"}
    draws = len(get_args(get_type_hints(module.measured)["n"]))
    n = tuple(noise.gauss(0.0, 1.0) for _ in range(draws))
    noisy = _call(module.measured, {**given, name: getattr(outputs, name), "n": n})
    return outputs._replace(**{name: noisy})


def _record(module: ModuleType, seen: Run, t: float, outputs: Any) -> None:
    seen["time"].append(t)
    hints = get_type_hints(module.Outputs)
    for field, value in outputs._asdict().items():
        if not isinstance(value, tuple):
            assert isinstance(value, hints[field]), (field, value)
            seen.setdefault(field, []).append(value)
            continue
        members = _members(module, "Outputs", field)
        for i, one in enumerate(value):
            row = one if isinstance(one, tuple) else None
            for j, element in enumerate(row or (one,)):
                assert isinstance(element, float), (field, element)
                port = f"{field}[{i + 1},{j + 1}]" if row else f"{field}[{i + 1}]"
                seen.setdefault(f"{field}.{members[i]}" if members else port, []).append(element)
