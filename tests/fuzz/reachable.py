"""Whether a fresh instance could have reached a state by legal calls with legal values.

Told from modelDescription.xml, from states that runs have led to, and from what the equations keep
true: independent of the code that restores states. What it finds no fault with may still be out of
reach; what it finds fault with is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import hypot, inf, isfinite
from typing import Any

from auv_fmu.language.variable import Refusal
from auv_fmu.paper.attitude import rotation_from_quaternion
from fmus.ports.groups import filled, reals_first
from support import states
from support.raw import Description, Variable
from support.settings import behaviour_of, choices_of, parameters_of
from support.status_table import MODES

#: Rounding of what is 1, or equal, in exact arithmetic.
TOLERANCE = 1e-9

#: Of the Mersenne Twister that makes noise: words of its state, and one more number, its place.
_TWISTER, _WORD = 624, 2**32

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
    yield from _faults_of_times(said["start_time"], said["stop_time"])
    if said["mode"] in MODES[:2] and said["time"] != said["start_time"]:
        yield "a time that is not the start time"
    keeps = behaviour_of(description.name).is_sampled and said["state"] is not None
    for key, causality in (("inputs", "input"), *([("outputs", "output")] * keeps)):
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
    for truth in ("fault", "fresh", "held"):
        if not isinstance(said[truth], bool):
            yield f"{truth} is neither true nor false"
    if not keeps and said["outputs"] not in ([], ()):
        yield "outputs that are not kept"
    yield from _faults_of_state(said, samples)


def _faults_of_times(start: Any, stop: Any) -> Iterator[str]:
    if not _is_number(start):
        yield "the start time is no number"
    elif not (_is_number(stop) or stop == inf):
        yield "the stop time is no number"
    elif not start < stop:
        yield "the stop time is not after the start time"


def _faults_of_state(said: dict[str, Any], samples: Sequence[dict[str, Any]]) -> Iterator[str]:
    state = said["state"]
    if state is None:
        if said["generator"] is not None or said["draws"] not in ([], ()):
            yield "noise without a state"
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
    if choices := choices_of(fmu.name, port.name):
        return type(value) is int and value in choices
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


def _is_unit(vector: Sequence[float]) -> bool:
    return abs(hypot(*vector) - 1.0) <= TOLERANCE


def _plant(said: dict[str, Any]) -> Iterator[str]:
    _, quaternion, nu_r, acting, _ = said["state"]
    if not _is_unit(quaternion):
        yield f"a quaternion that is no unit: {quaternion}"
        return
    parameters = said["parameters"]
    rotation = rotation_from_quaternion(quaternion)
    if not parameters["roll"] and (nu_r[3] or abs(rotation[1][2]) > TOLERANCE):
        yield "roll where there is none"
    limits = ((parameters[f"tau_min.{k}"], parameters[f"tau_max.{k}"]) for k in "uqr")
    if not all(
        low - TOLERANCE * (high - low) <= value <= high + TOLERANCE * (high - low)
        for value, (low, high) in zip(acting, limits, strict=True)
    ):
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
    """What a behaviour says of a state, and of the noise that goes with it."""
    behaviour = behaviour_of(name)
    if behaviour.draws:
        yield from _generator(said["generator"])
        draws = said["draws"]
        if not isinstance(draws, (list, tuple)) or not all(
            _is_number(draw) and abs(draw) <= _MOST_SIGMAS for draw in draws
        ):
            yield "noise that no generator makes"
    check = behaviour.hooks["check_state"]
    if check is None:
        return
    given = {
        "parameters": parameters_of(name).of(said["parameters"]),
        "state": filled(behaviour.state, _numbers(said["state"])),
    }
    try:
        check(*(given[argument] for argument in behaviour.arguments("check_state")))
    except Refusal as refusal:
        yield str(refusal)


#: What is told of a state without asking the behaviour.
_INVARIANTS: dict[str, Callable[[dict[str, Any]], Iterator[str]]] = {"AuvPlant": _plant}


def without_checksum(content: bytes) -> dict[str, Any] | None:
    """What a state says, if it is JSON."""
    said = states.read(content)
    if said is not None:
        said.pop(states.CHECKSUM, None)
    return said
