"""Whether a fresh instance could have reached a state by legal calls with legal values.

Told from modelDescription.xml, from states that runs have led to, and from what the equations keep
true: independent of the code that restores states. What it finds no fault with may still be out of
reach; what it finds fault with is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, pairwise
from math import hypot, isclose, isfinite
from typing import Any

from auv_fmu import plant
from auv_fmu.attitude import rotation_from_quaternion
from auv_fmu.plant import PlantState
from fmus.discovery import ports_of
from fmus.ports.groups import reals_first, slices
from fmus.ports.port import Refusal
from support import states
from support.raw import Description, Variable
from support.settings import behaviour_of, choices_of, parameters_of
from support.status_table import MODES

#: Rounding of what is 1, or equal, in exact arithmetic.
TOLERANCE = 1e-9

#: Of the Mersenne Twister that makes noise: words of its state, and one more number, its place.
_TWISTER, _WORD = 624, 2**32

#: Where the groups eta, nu, y, dy and tau_applied of the plant's outputs begin and end.
_PLANT_OUTPUTS = (0, 6, 12, 15, 18, 21, 27)

#: random.gauss cannot go further from zero: it takes the logarithm of a number of 53 bits.
_MOST_SIGMAS = 8.6


def faults(said: Any, description: Description, samples: Sequence[dict[str, Any]]) -> list[str]:
    """What speaks against a state; nothing: it may have been reached.

    Args:
        said: the state.
        description: of its FMU.
        samples: states that runs have led to.

    """
    if not isinstance(said, dict) or said.keys() != samples[0].keys():
        return ["other parts than those of a state"]
    found = [*_faults(said, description, samples)]
    if found or said["state"] is None:
        return found
    try:
        kept_true = _INVARIANTS.get(description.name, lambda said: ())
        return [*kept_true(said), *_follows(said, description.name)]
    except (ArithmeticError, ValueError) as error:
        return [f"nothing follows from it: {error}"]


def _faults(
    said: dict[str, Any], description: Description, samples: Sequence[dict[str, Any]]
) -> Iterator[str]:
    if said["identity"] != samples[0]["identity"]:
        yield "another component"
    if said["mode"] not in MODES:
        yield "no mode"
    if not _is_number(said["start_time"]):
        yield "the start time is no number"
    for key, causality in (("inputs", "input"), ("outputs", "output")):
        all_ports = [port for port in description.of(causality) if port.name != "fault"]
        ports, values = reals_first(all_ports), said[key]
        if not isinstance(values, list) or len(values) != len(ports):
            yield f"other {key}"
        else:
            yield from (
                f"{p.name} = {v!r:.30}"
                for p, v in zip(ports, values, strict=True)
                if not _fits(description, p, v)
            )
    parameters = {port.name: port for port in description.of("parameter")}
    values = said["parameters"]
    if not isinstance(values, dict) or values.keys() != parameters.keys():
        yield "other parameters"
    else:
        yield from (
            f"{n} = {v!r:.30}"
            for n, v in values.items()
            if not _fits(description, parameters[n], v)
        )
    if not isinstance(said["fault"], bool):
        yield "fault is neither true nor false"
    yield from _faults_of_state(said, samples)


def _faults_of_state(said: dict[str, Any], samples: Sequence[dict[str, Any]]) -> Iterator[str]:
    state = said["state"]
    if state is None:
        if said["hidden"] is not None:
            yield "something hidden without a state"
        if said["mode"] == MODES[2]:
            yield "steps without a state"
        return
    if said["mode"] == MODES[0]:
        yield "a state before the initialisation"
    reached = [sample for sample in samples if sample["state"] is not None]
    if not any(_alike(state, sample["state"]) for sample in reached):
        yield "a state of another shape"
    elif any(not isfinite(x) for x in _numbers(state)):
        yield "a state that is not finite"


def _is_number(value: Any) -> bool:
    """Whether it is a float, or an integer that is one."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return isfinite(value)
    except OverflowError:
        return False


def _fits(fmu: Description, port: Variable, value: Any) -> bool:
    if port.type == "String":
        return value in choices_of(fmu.name, port.name)
    if port.type == "Boolean":
        return isinstance(value, bool)
    if port.type == "Integer" and not isinstance(value, int):
        return False
    if not _is_number(value) or (port.type == "Integer" and not -(2**31) <= value < 2**31):
        return False
    low, high = port.minimum, port.maximum
    return (low is None or low <= value) and (high is None or value <= high)


def _alike(value: Any, sample: Any) -> bool:
    """Whether two values are of the same shape, number for number."""
    if isinstance(sample, list):
        return (
            isinstance(value, list)
            and len(value) == len(sample)
            and all(map(_alike, value, sample))
        )
    if isinstance(sample, (int, float)) and not isinstance(sample, bool):
        try:
            float(value)
        except (TypeError, ValueError, OverflowError):
            return False
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    return type(value) is type(sample)


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, list):
        for element in value:
            yield from _numbers(element)
    else:
        yield float(value)


# What the equations keep true


def _near(values: Sequence[float], others: Sequence[float]) -> bool:
    """Whether values are equal but for the rounding of another machine."""
    close = partial(isclose, rel_tol=2 * TOLERANCE, abs_tol=2 * TOLERANCE)
    return all(map(close, values, others))


def _is_unit(vector: Sequence[float]) -> bool:
    return abs(hypot(*vector) - 1.0) <= TOLERANCE


def _plant(said: dict[str, Any]) -> Iterator[str]:
    position, quaternion, nu_r, acting, _ = said["state"]
    if not _is_unit(quaternion):
        yield f"a quaternion that is no unit: {quaternion}"
        return
    parameters, outputs = said["parameters"], said["outputs"]
    state = PlantState(*map(tuple, said["state"]))
    rotation = rotation_from_quaternion(state.quaternion)
    known = parameters_of("AuvPlant").of(parameters)
    euler, y, dy, nu, _ = plant.outputs(state, rotation, known.ell, known.roll.rolls)
    if not parameters["roll"] and (nu_r[3] or abs(rotation[1][2]) > TOLERANCE):
        yield "roll where there is none"
    parts = (outputs[i:j] for i, j in pairwise(_PLANT_OUTPUTS))
    eta, found_nu, found_y, found_dy, tau, found_nu_r = parts
    shown = [*eta, *found_nu, *found_dy, *tau, *found_nu_r]
    if not _near(shown, [*position, *euler, *nu, *dy, *acting, *nu_r]):
        yield "outputs that are not those of the state"
    most = _MOST_SIGMAS * parameters["noise.std"] + TOLERANCE * hypot(*y)
    if any(abs(measured - true) > most for measured, true in zip(found_y, y, strict=True)):
        yield "noise that no generator makes"
    limits = ((parameters[f"tau_min.{k}"], parameters[f"tau_max.{k}"]) for k in "uqr")
    if not all(low <= value <= high for value, (low, high) in zip(tau, limits, strict=True)):
        yield "applied forces beyond the limits"


def _generator(hidden: Any) -> Iterator[str]:
    """Random.getstate(): version, words and place, and a number that may be kept for later."""
    if not isinstance(hidden, list) or len(hidden) != 3:
        yield "no generator of noise"
        return
    version, words, kept = hidden
    if version != 3 or isinstance(version, (bool, float)):
        yield "a generator of another version"
    if not isinstance(words, list) or len(words) != _TWISTER + 1:
        yield "a generator of another size"
    elif not all(type(word) is int and 0 <= word < _WORD for word in words):
        yield "words that are none"
    elif words[-1] > _TWISTER:
        yield "a place beyond the generator"
    elif not any(words[:-1]):
        yield "a generator that gives zeros"
    if kept is not None and not _is_number(kept):
        yield "a number kept that is none"


def _follows(said: dict[str, Any], name: str) -> Iterator[str]:
    """What a behaviour says of the outputs that belong to a state."""
    behaviour, declared = behaviour_of(name), ports_of(name)
    expected = behaviour.hooks["expected"]
    if behaviour.noisy:
        yield from _generator(said["hidden"])
    if expected is None:
        return
    places = slices([port for port in declared if port.causality == "output"])
    given = {
        "parameters": parameters_of(name).of(said["parameters"]),
        "state": behaviour.state(*(tuple(x) if isinstance(x, list) else x for x in said["state"])),
        "outputs": {group: tuple(said["outputs"][place]) for group, place in places.items()},
    }
    try:
        groups = expected(*(given[argument] for argument in behaviour.arguments("expected")))
    except Refusal as refusal:
        yield str(refusal)
    else:
        if not _near(said["outputs"], [*chain(*groups.values())]):
            yield "outputs that are not those of the state"


#: What is told of a state without asking the behaviour.
_INVARIANTS: dict[str, Callable[[dict[str, Any]], Iterator[str]]] = {"AuvPlant": _plant}


def without_checksum(content: bytes) -> dict[str, Any] | None:
    """What a state says, if it is JSON."""
    said = states.read(content)
    if said is not None:
        said.pop(states.CHECKSUM, None)
    return said
