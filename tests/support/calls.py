"""The calls of fmi-answers.md: their arguments, and how each is made on an instance.

States are named by slots, so that their addresses do not matter.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import (
    addressof,
    byref,
    c_char_p,
    c_double,
    c_size_t,
    c_uint,
    c_void_p,
    create_string_buffer,
    string_at,
)
from dataclasses import dataclass, field
from functools import partial
from math import copysign, inf, nan, nextafter
from random import Random
from typing import Any, NamedTuple, TypeVar

from support import states
from support.raw import (
    C_TYPES,
    LAST_SUCCESSFUL_TIME_KIND,
    OF_MODEL_EXCHANGE,
    TERMINATED_KIND,
    TYPES,
    Description,
    Host,
    Status,
    Variable,
)
from support.settings import Setting, choices_of, trials_of

Arguments = dict[str, Any]
T = TypeVar("T")

#: A reference that no FMU of this size has.
UNKNOWN = 4_294_967_295

#: Byte 0xff, which no UTF-8 has, as a string that keeps it (`surrogateescape`).
NOT_UTF_8 = "\udcff"

#: Number of references in the longest calls.
MANY = 100_000

#: The functions of FMI 2.0 that only model exchange has.
MODEL_EXCHANGE_FUNCTIONS = tuple(f"fmi2{name}" for name in OF_MODEL_EXCHANGE)

#: More than this many internal steps are taken for a mistake.
MOST_INTERNAL_STEPS = 100_000

_MISSING: dict[str, Any] = {"Real": 0.0, "Integer": 0, "Boolean": 0, "String": b""}


class Call(NamedTuple):
    """One call on an instance: function and case, as the table names them, and arguments."""

    function: str
    case: str
    arguments: Arguments


class Item(NamedTuple):
    """A value reference in a call, the value for it, and whether they can go together."""

    reference: int
    value: Any = None
    good: bool = True


@dataclass
class Saved:
    """States of a host by slot, and those that it has freed."""

    states: dict[str, int] = field(default_factory=dict)
    freed: dict[str, int] = field(default_factory=dict)
    #: A serialised state of another FMU.
    foreign: bytes = b"{}"


class Lacking(Exception):
    """An FMU has no port for a case."""


#: Slots of states: of the instance itself, of another one, and freed.
OWN, OTHER, FREED = "own", "other", "freed"


@dataclass
class Draw:
    """Arguments for calls on an FMU."""

    random: Random
    description: Description
    time: float
    stop: float

    def any_of(self, found: Sequence[T]) -> T:
        """One of several things.

        Raises:
            Lacking: there is none.

        """
        if not found:
            raise Lacking
        return self.random.choice(found)

    def good_value(self, variable: Variable) -> Any:
        """A value that does not end a run."""
        start, low, high = variable.start, variable.minimum, variable.maximum
        if choices := choices_of(self.description.name, variable.name):
            return self.random.choice(choices)
        if variable.type == "String":
            return start
        if variable.type == "Boolean":
            return self.random.randrange(2)
        if variable.type == "Integer":
            return self.random.choice((-(2**31), 0, 42) if low is None else (start,))
        value = self.random.uniform(0.99, 1.01) * (start or 0.1)
        value = value if low is None else max(low, value)
        return value if high is None else min(high, value)

    def settable(self, fmi_type: str) -> list[Variable]:
        """Ports that can be set before the initialisation."""
        having = self.description.of
        return [*having("input", fmi_type), *having("parameter", fmi_type)]


#: The case of a step that ends too late.
BEYOND = "a step beyond the stop time"

CASES: dict[tuple[str, str], Callable[[Draw], Arguments | None]] = {}


def _case(function: str, case: str = "") -> Callable[[Any], Any]:
    """Add a case, whose arguments are None for an FMU that lacks what it needs."""

    def add(arguments: Callable[..., Arguments]) -> Any:
        def drawn(draw: Draw) -> Arguments | None:
            try:
                return arguments(draw)
            except Lacking:
                return None

        assert (function, case) not in CASES
        CASES[function, case] = drawn
        return arguments

    return add


def _plain(function: str, case: str = "", **arguments: Any) -> None:
    """Add a case whose arguments are the same for all FMUs."""
    _case(function, case)(lambda draw: dict(arguments))


def _items(*items: Item, **more: Any) -> Arguments:
    return {"items": [*items], **more}


def _item(variable: Variable, value: Any, good: bool = True) -> Arguments:
    return _items(Item(variable.reference, value, good))


def _shuffled(draw: Draw, *items: Item) -> Arguments:
    found = [*items]
    draw.random.shuffle(found)
    return _items(*found)


# Values


def _inputs(draw: Draw) -> list[Variable]:
    return draw.description.of("input", "Real")


def _parameters(draw: Draw, variability: str, fmi_type: str = "Real") -> list[Variable]:
    found = draw.description.of("parameter", fmi_type)
    return [v for v in found if v.variability == variability]


def _tunable(draw: Draw) -> list[Variable]:
    return _parameters(draw, "tunable")


def _of_type(draw: Draw, *types: str) -> list[Variable]:
    return [v for v in draw.description.variables if v.type in types]


def _changeable(draw: Draw) -> Variable:
    """A Real port that can be set at any time before the end."""
    return draw.any_of([v for v in draw.settable("Real") if v.variability != "fixed"])


def _good(found: Callable[[Draw], list[Variable]]) -> Callable[[Draw], Arguments]:
    def arguments(draw: Draw) -> Arguments:
        variable = draw.any_of(found(draw))
        return _item(variable, draw.good_value(variable))

    return arguments


def _value_cases(fmi_type: str) -> None:
    """The cases that are the same for all types."""
    some: Any = {"Real": 1.0, "Integer": 1, "Boolean": 1, "String": "x"}[fmi_type]
    others = [other for other in TYPES if other != fmi_type]
    bad = Item(0, some, False)
    for action in ("Get", "Set"):
        function = f"fmi2{action}{fmi_type}"
        _case(function, "n = 0, with NULL")(lambda draw: _items(null="both"))
        _case(function, "references NULL, n > 0")(lambda draw: _items(bad, null="references"))
        _case(function, "values NULL, n > 0")(lambda draw: _items(bad, null="values"))
        if fmi_type == "Real":
            _case(function, "n = 2^60")(lambda draw: _items(bad, n=2**60))
        _case(function, "an unknown reference")(
            lambda draw: _items(
                Item(draw.random.choice((UNKNOWN, 2**31, len(draw.description.variables))),
                     some, False)
            )
        )  # fmt: skip
        # Hosts read Integers and Booleans as Reals.
        if function != "fmi2GetReal":
            _case(function, "a port of another type")(
                lambda draw: _item(draw.any_of(_of_type(draw, *others)), some, False)
            )
    _case(f"fmi2Get{fmi_type}", "all ports")(
        lambda draw: _items(*(Item(v.reference) for v in _of_type(draw, fmi_type)))
    )

    if fmi_type == "String":
        return  # no port is one

    @_case(f"fmi2Set{fmi_type}", "a fixed parameter")
    def _fixed(draw: Draw) -> Arguments:
        variable = draw.any_of(_parameters(draw, "fixed", fmi_type))
        found = [draw.good_value(variable) for _ in range(20)]
        others = [value for value in found if value != variable.start]
        if not others:
            raise Lacking
        return _item(variable, others[0])

    @_case(f"fmi2Set{fmi_type}", "a fixed parameter, to the value that it has")
    def _same(draw: Draw) -> Arguments:
        variable = draw.any_of(_parameters(draw, "fixed", fmi_type))
        return _item(variable, variable.start)

    if fmi_type in ("Real", "Boolean"):
        _case(f"fmi2Set{fmi_type}", "an output")(
            lambda draw: _item(draw.any_of(draw.description.of("output", fmi_type)), some, False)
        )


for _fmi_type in TYPES:
    _value_cases(_fmi_type)
_case("fmi2SetReal", "a tunable parameter")(_good(_tunable))
_case("fmi2SetReal", "an input")(_good(_inputs))


@_case("fmi2SetReal", "all inputs")
def _all_inputs(draw: Draw) -> Arguments:
    draw.any_of(_inputs(draw))
    return _items(*(Item(v.reference, draw.good_value(v)) for v in _inputs(draw)))


@_case("fmi2SetReal", "the same twice")
def _same_twice(draw: Draw) -> Arguments:
    port = _changeable(draw)
    return _items(*(Item(port.reference, draw.good_value(port)) for _ in range(2)))


@_case("fmi2SetReal", "100,000 times the same")
def _many(draw: Draw) -> Arguments:
    port = _changeable(draw)
    return _items(Item(port.reference, draw.good_value(port)), times=MANY)


_case("fmi2GetReal", "100,000 times the same")(
    lambda draw: _items(Item(draw.any_of(_of_type(draw, "Real")).reference), times=MANY)
)


def _bad(
    case: str, found: Callable[[Draw], list[Variable]], value: Callable[[Variable, Random], float]
) -> None:
    """Add a case of a Real port and a value that it does not take."""

    @_case("fmi2SetReal", case)
    def arguments(draw: Draw) -> Arguments:
        port = draw.any_of(found(draw))
        return _item(port, value(port, draw.random), False)


for _whose, _found in (("an input", _inputs), ("a parameter", _tunable)):
    _bad(f"NaN for {_whose}", _found, lambda port, random: nan)
    _bad(f"an infinite value for {_whose}", _found, lambda port, random: random.choice((inf, -inf)))
for _side, _limit, _end in (("below", "minimum", -inf), ("above", "maximum", inf)):
    _bad(
        f"{_side} the range",
        lambda draw, limit=_limit: [
            port
            for port in draw.settable("Real")
            if port.variability != "fixed" and getattr(port, limit) is not None
        ],
        lambda port, random, limit=_limit, end=_end: random.choice(
            (nextafter(getattr(port, limit), end), copysign(1e300, end))
        ),
    )


for _whose, _found in (("inputs", _inputs), ("parameters", _tunable)):

    @_case("fmi2SetReal", f"one bad among good {_whose}")
    def _one_bad(draw: Draw, found: Callable[[Draw], Any] = _found) -> Arguments:
        ports = found(draw)
        if len(ports) < 2:
            raise Lacking
        first, second = draw.random.sample(ports, 2)
        good = Item(first.reference, draw.good_value(first))
        return _shuffled(draw, good, Item(second.reference, nan, False))


@_case("fmi2SetReal", "an unknown reference among good")
def _unknown_among_good(draw: Draw) -> Arguments:
    port = _changeable(draw)
    good = Item(port.reference, draw.good_value(port), False)
    return _shuffled(draw, good, Item(UNKNOWN, 1.0, False))


@_case("fmi2GetReal", "one bad among good")
def _one_bad_to_get(draw: Draw) -> Arguments:
    good = draw.any_of(draw.description.of("output", "Real"))
    return _shuffled(draw, Item(good.reference), Item(UNKNOWN, None, False))


_case("fmi2GetReal", "all Integers and Booleans")(
    lambda draw: _items(*(Item(v.reference) for v in _of_type(draw, "Integer", "Boolean")))
)


@_case("fmi2SetBoolean", "neither 0 nor 1, which is true")
def _odd_boolean(draw: Draw) -> Arguments:
    found = draw.description.of("parameter", "Boolean")
    port = draw.any_of([variable for variable in found if not variable.start])
    return _item(port, draw.random.choice((2, -1, 2**31 - 1)))


@_case("fmi2SetInteger", "a number that its Enumeration lacks")
def _no_item(draw: Draw) -> Arguments:
    found = draw.description.of("parameter", "Integer")
    items = {port: choices_of(draw.description.name, port.name) for port in found}
    port = draw.any_of([port for port in found if items[port]])
    return _item(port, draw.random.choice((min(items[port]) - 1, max(items[port]) + 1)), False)


for _case_name, _text in (
    ("a text that is not UTF-8", f"ta{NOT_UTF_8}nh"),
    ("a text that is NULL", None),
):
    _case("fmi2SetString", _case_name)(
        lambda draw, text=_text: _item(draw.any_of(draw.description.variables), text, False)
    )

# Logging, initialisation and end, steps

for _case_name, _arguments in (
    ("on, no categories", {"on": 1, "categories": []}),
    ("off", {"on": 0, "categories": []}),
    ("a category that is not declared", {"on": 1, "categories": ["undeclared"]}),
    ("categories NULL, n > 0", {"on": 1, "categories": ["x"], "null": True}),
    ("a category that is NULL", {"on": 1, "categories": [None]}),
    ("a category that is not UTF-8", {"on": 1, "categories": [NOT_UTF_8]}),
):
    _plain("fmi2SetDebugLogging", _case_name, **{"null": False, **_arguments})


def _one_of(function: str, before: Callable[[Draw], Arguments], case: str, **values: Any) -> None:
    """Add a case in which arguments are drawn from tuples; the others are what they were."""
    _case(function, case)(
        lambda draw: {
            **before(draw),
            **{
                name: draw.random.choice(value) if isinstance(value, tuple) else value
                for name, value in values.items()
            },
        }
    )


_setup = partial(
    _one_of, "fmi2SetupExperiment", lambda draw: {"start": 0.0, "stop": None, "tolerance": None}
)
_setup("start", start=(0.0, 1.5, -3.0))
_setup("start, stop, tolerance", stop=10.0, tolerance=1e-6)
_setup("stop infinite", stop=inf)
_setup(
    "stop NaN or not after start, which stands for none, tolerance NaN",
    stop=(nan, -1.0, -inf),
    tolerance=nan,
)
_setup("start NaN or infinite", start=(nan, inf, -inf))

for _function in (
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2CancelStep",
):
    _plain(_function)


def _setting(found: Setting | None) -> Setting:
    if found is None:
        raise Lacking
    return found


@_case("fmi2ExitInitializationMode", "values that give no start")
def _no_start(draw: Draw) -> Arguments:
    _setting(trials_of(draw.description.name).no_start)
    return {}


@_case("fmi2GetReal", "outputs of values that give no start")
def _outputs_of_no_start(draw: Draw) -> Arguments:
    _setting(trials_of(draw.description.name).no_start)
    return _items(*(Item(v.reference) for v in draw.description.of("output", "Real")))


_step = partial(_one_of, "fmi2DoStep", lambda draw: {"time": draw.time, "h": 0.02})
_step("a step")
_step("a step of another length", h=(1e-9, 0.001, 0.05, 0.1))
_step("a time that does not follow", time=(-1.0, 0.37, 55.0))
_step("a step of zero, which changes nothing", h=(0.0, -0.0))
_step("a step that is negative", h=(-0.02, -1e-300, -1e300))
_step("a step that is NaN or infinite", h=(nan, inf, -inf))
_step("a time that is NaN or infinite", time=(nan, inf, -inf))


@_case("fmi2DoStep", BEYOND)
def _beyond(draw: Draw) -> Arguments:
    return {"time": draw.time, "h": draw.stop - draw.time + draw.random.choice((0.02, 1e3))}


@_case("fmi2DoStep", "more than 100,000 times h_max")
def _too_long(draw: Draw) -> Arguments:
    draw.any_of([v for v in draw.description.variables if v.name == "h_max"])
    return {"time": draw.time, "h": draw.random.choice((2.0, 1e3, 1e200)) * MOST_INTERNAL_STEPS}


@_case("fmi2DoStep", "values that the equations overflow with")
def _overflow(draw: Draw) -> Arguments:
    setting = _setting(trials_of(draw.description.name).overflow)
    return {"time": draw.time + setting.time, "h": 0.02}


# States

_plain("fmi2GetFMUstate", slot="new")
_plain("fmi2GetFMUstate", "into a state from before", slot=OWN, again=True)
for _state_call in (
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
):
    _plain(_state_call, "a state", slot=OWN)
    _plain(_state_call, "a state that was freed", freed=FREED)
    _plain(_state_call, "NULL", null=True)
    if _state_call != "fmi2SerializeFMUstate":
        _plain(_state_call, "a pointer to something else", stray=True)
_plain("fmi2FreeFMUstate", "a state that is NULL", nothing=True)
_plain("fmi2SetFMUstate", "a state of another instance", slot=OTHER)
_plain("fmi2SetFMUstate", "a state that was serialised", bytes_of=OWN)
for _case_name, _change in (
    ("bytes that are not a state", "noise"),
    ("bytes that were cut off", "cut"),
    ("bytes that were changed", "changed"),
    ("values that no run leads to, checksum and all", "impossible"),
):
    _plain("fmi2SetFMUstate", _case_name, bytes_of=OWN, change=_change)
_plain("fmi2SetFMUstate", "bytes of another FMU's state", foreign=True)
_plain("fmi2SerializeFMUstate", "too few bytes", slot=OWN, more=-1)
_plain("fmi2SerializeFMUstate", "too many bytes", slot=OWN, more=1000)
_plain("fmi2SerializeFMUstate", "bytes NULL", slot=OWN, no_bytes=True)
_plain("fmi2GetFMUstate", "NULL", null=True)
_plain("fmi2DeSerializeFMUstate", "bytes of a state", bytes_of=OWN)
_plain(
    "fmi2DeSerializeFMUstate",
    "bytes that are not a state, refused when they are set",
    bytes=b"[" * 5000,
)
_plain("fmi2DeSerializeFMUstate", "n = 0", bytes=b"")
for _state_call in ("fmi2GetFMUstate", "fmi2DeSerializeFMUstate"):
    _plain(_state_call, "into a state that was freed", bytes=b"{}", freed=FREED)
_plain("fmi2DeSerializeFMUstate", "bytes NULL, n > 0", no_bytes=True)
_plain("fmi2DeSerializeFMUstate", "state NULL", bytes=b"{}", null=True)

# Unsupported functions

_UNSUPPORTED = (
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
    *MODEL_EXCHANGE_FUNCTIONS,
)
for _function in _UNSUPPORTED:
    _plain(_function, "anything")
for _function, _case_name, _number in (
    ("fmi2GetRealStatus", "fmi2LastSuccessfulTime", LAST_SUCCESSFUL_TIME_KIND),
    ("fmi2GetBooleanStatus", "fmi2Terminated", TERMINATED_KIND),
):
    _plain(_function, _case_name, kind=_number)
    _plain(_function, "another kind", kind=0)
    _plain(_function, "NULL", kind=_number, null=True)
for _function in ("fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"):
    _plain(_function, "anything", kind=1)
    _plain(_function, "NULL", kind=1, null=True)


# Making calls


def make(host: Host, call: Call, saved: Saved) -> Status:
    """Make a call on an instance; results that are the same in all states are checked."""
    how = _MADE.get(call.function)
    return host.call(call.function) if how is None else how(host, call, saved)


def _encoded(text: str | None) -> bytes | None:
    return None if text is None else text.encode("utf-8", "surrogateescape")


def _make_values(host: Host, call: Call, saved: Saved) -> Status:
    action, fmi_type = call.function[4:7], call.function[7:]
    items, null = call.arguments["items"], call.arguments.get("null")
    times = call.arguments.get("times", 1)
    n = len(items) * times
    values = [item.value for item in items] * times
    if fmi_type == "String":
        values = [_encoded(value) for value in values]
    references = (c_uint * n)(*[item.reference for item in items] * times)
    array = (C_TYPES[fmi_type] * n)(*(values if action == "Set" else ()))
    status = host.call(
        call.function,
        None if null in ("references", "both") else references,
        c_size_t(call.arguments.get("n", n)),
        None if null in ("values", "both") else array,
    )
    if action == "Get" and null is None:
        for item, value in zip(items, array, strict=False):
            wanted = _MISSING[fmi_type]
            if item.good and status != Status.OK:
                _, [wanted] = host.get(fmi_type, [item.reference])
            assert (item.good and status == Status.OK) or repr(value) == repr(wanted), (
                f"{value!r} for {wanted!r}"
            )
    return status


def _make_logging(host: Host, call: Call, saved: Saved) -> Status:
    categories = [_encoded(text) for text in call.arguments["categories"]]
    n = len(categories)
    array = None if call.arguments["null"] or not n else (c_char_p * n)(*categories)
    return host.call(call.function, call.arguments["on"], c_size_t(n), array)


def _make_setup(host: Host, call: Call, saved: Saved) -> Status:
    start, stop, tolerance = (call.arguments[key] for key in ("start", "stop", "tolerance"))
    return host.call(
        call.function,
        int(tolerance is not None), c_double(tolerance or 0.0),
        c_double(start),
        int(stop is not None), c_double(0.0 if stop is None else stop),
    )  # fmt: skip


def _make_step(host: Host, call: Call, saved: Saved) -> Status:
    return host.step(call.arguments["time"], call.arguments["h"])


#: Memory that holds neither a state nor an instance.
_STRAY = create_string_buffer(256)


def _handle(call: Call, saved: Saved) -> int | None:
    if call.arguments.get("stray"):
        return addressof(_STRAY)
    if "freed" in call.arguments:
        return saved.freed[call.arguments["freed"]]
    return saved.states[call.arguments["slot"]] if "slot" in call.arguments else None


def _make_get_state(host: Host, call: Call, saved: Saved) -> Status:
    if call.arguments.get("null"):
        return host.call(call.function, None)
    if "freed" in call.arguments:
        return host.call(call.function, byref(c_void_p(_handle(call, saved))))
    slot = call.arguments["slot"]
    before = saved.states.pop(slot, None)
    state = c_void_p(before if call.arguments.get("again") else None)
    if before is not None and not call.arguments.get("again"):
        host.free_state(before)
    status = host.call(call.function, byref(state))
    if state.value is not None:
        saved.states[slot] = state.value
    return status


def _make_set_state(host: Host, call: Call, saved: Saved) -> Status:
    if not call.arguments.keys().isdisjoint(("bytes", "bytes_of", "foreign")):
        status, state = host.deserialised(_content(host, call, saved))
        assert status == Status.OK, f"fmi2DeSerializeFMUstate: {status.name}"
        status = host.set_state(state)
        assert state is not None
        assert host.free_state(state) == Status.OK
        return status
    return host.set_state(_handle(call, saved))


def _content(host: Host, call: Call, saved: Saved) -> bytes:
    if "foreign" in call.arguments:
        return saved.foreign
    if "bytes_of" not in call.arguments:
        content: bytes = call.arguments["bytes"]
        return content
    content = host.serialised(saved.states[call.arguments["bytes_of"]])
    change = call.arguments.get("change")
    return states.changed(content, change) if change else content


def _make_free_state(host: Host, call: Call, saved: Saved) -> Status:
    if call.arguments.get("null"):
        return host.call(call.function, None)
    handle = _handle(call, saved)
    state = c_void_p(handle)
    status = host.call(call.function, byref(state))
    if "slot" in call.arguments and status == Status.OK:
        del saved.states[call.arguments["slot"]]
        saved.freed[call.arguments["slot"]] = handle or 0
        assert state.value is None, "a freed state is not NULL"
    return status


def _make_size(host: Host, call: Call, saved: Saved) -> Status:
    return host.call(call.function, c_void_p(_handle(call, saved)), byref(c_size_t()))


def _make_serialise(host: Host, call: Call, saved: Saved) -> Status:
    handle = _handle(call, saved)
    if "slot" not in call.arguments:
        return host.call(call.function, c_void_p(handle), create_string_buffer(16), c_size_t(16))
    content = host.serialised(handle) if handle is not None else b""
    more = call.arguments.get("more", 0)
    room = create_string_buffer(b"\xaa" * (len(content) + 64), len(content) + 64)
    size = len(content) + more
    target = None if call.arguments.get("no_bytes") else room
    status = host.call(call.function, c_void_p(handle), target, c_size_t(size))
    written = string_at(room, len(room))
    if target is not None and status == Status.OK:
        assert written.startswith(content), "other bytes than before"
        content_end = len(content)
    else:
        content_end = 0
    assert set(written[content_end:]) <= {0xAA}, "bytes were written beyond the state"
    return status


def _make_deserialise(host: Host, call: Call, saved: Saved) -> Status:
    state = c_void_p(_handle(call, saved))
    if call.arguments.get("no_bytes"):
        return host.call(call.function, None, c_size_t(8), byref(state))
    content = _content(host, call, saved)
    target = None if call.arguments.get("null") else byref(state)
    status = host.call(call.function, content, c_size_t(len(content)), target)
    if status == Status.OK:
        assert state.value is not None
        assert host.free_state(state.value) == Status.OK
    return status


def _make_unsupported(host: Host, call: Call, saved: Saved) -> Status:
    # As many NULLs as any of these functions has arguments.
    return host.call(call.function, None, c_size_t(0), None, c_size_t(0), None, None)


def _make_status(host: Host, call: Call, saved: Saved) -> Status:
    value = c_double()
    target = None if call.arguments.get("null") else byref(value)
    return host.call(call.function, call.arguments["kind"], target)


_MADE: dict[str, Callable[[Host, Call, Saved], Status]] = {
    "fmi2SetDebugLogging": _make_logging,
    "fmi2SetupExperiment": _make_setup,
    **dict.fromkeys(_UNSUPPORTED, _make_unsupported),
    "fmi2GetRealStatus": _make_status,
    "fmi2GetIntegerStatus": _make_status,
    "fmi2GetBooleanStatus": _make_status,
    "fmi2GetStringStatus": _make_status,
    "fmi2GetStatus": _make_status,
    "fmi2GetFMUstate": _make_get_state,
    "fmi2SetFMUstate": _make_set_state,
    "fmi2FreeFMUstate": _make_free_state,
    "fmi2SerializedFMUstateSize": _make_size,
    "fmi2SerializeFMUstate": _make_serialise,
    "fmi2DeSerializeFMUstate": _make_deserialise,
    "fmi2DoStep": _make_step,
    **{f"fmi2{action}{fmi_type}": _make_values for action in ("Get", "Set") for fmi_type in TYPES},
}
