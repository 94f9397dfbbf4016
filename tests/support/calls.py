"""The calls of docs/status.md: with which arguments each is made, and how it is made.

A call is data: it can be printed, pickled, and made again on any instance of the same FMU. States
are named by slots, so that it does not matter where they lie in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import (
    addressof,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    create_string_buffer,
    string_at,
)
from dataclasses import dataclass, field
from math import copysign, inf, nan, nextafter
from random import Random
from typing import Any, NamedTuple

from support import states
from support.raw import (
    KINDS,
    LAST_SUCCESSFUL_TIME_KIND,
    TERMINATED_KIND,
    Description,
    Host,
    Status,
    Variable,
)
from support.raw_fmi import OF_MODEL_EXCHANGE
from support.settings import choices_of, trials_of

Arguments = dict[str, Any]

#: A reference that no FMU of this size has.
UNKNOWN = 4_294_967_295

#: Byte 0xff, which no UTF-8 has, as a string that keeps it (`surrogateescape`).
NOT_UTF_8 = "\udcff"

#: Times a reference stands in the longest calls.
MANY = 100_000

#: The functions of FMI 2.0 that only model exchange has.
MODEL_EXCHANGE_FUNCTIONS = tuple(f"fmi2{name}" for name in OF_MODEL_EXCHANGE)

#: More than this many internal steps are taken for a mistake.
MOST_INTERNAL_STEPS = 1_000_000

_C_TYPES = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}
_MISSING: dict[str, Any] = {"Real": 0.0, "Integer": 0, "Boolean": 0, "String": b""}


class Call(NamedTuple):
    """One call on an instance: function and case, as the table names them, and arguments."""

    function: str
    case: str
    arguments: Arguments

    def shown(self, description: Description) -> str:
        """The call as a line to be read."""
        said = dict(self.arguments)
        names = {v.reference: v.name for v in description.variables}
        if "items" in said:
            items = said.pop("items")
            values = [f"{names.get(item.reference, item.reference)}={_short(item.value)}"
                      for item in items[:4]]  # fmt: skip
            said[""] = ", ".join([*values, "..."] if len(items) > len(values) else values)
        text = ", ".join(f"{key}={_short(value)}" if key else value for key, value in said.items())
        return f"{self.function}({text})" + (f"   # {self.case}" if self.case else "")


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:50]}... ({len(text)} characters)"


class Item(NamedTuple):
    """A value reference in a call, the value for it, and whether they can go together."""

    reference: int
    value: Any = None
    good: bool = True


@dataclass
class Saved:
    """The states that a host has, by slot, and those it has no more."""

    states: dict[str, int] = field(default_factory=dict)
    freed: dict[str, int] = field(default_factory=dict)
    #: A serialised state of another FMU.
    foreign: bytes = b"{}"


@dataclass
class Draw:
    """What arguments are drawn from."""

    random: Random
    description: Description
    #: Slots of states of instances of this FMU, own and others.
    own: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)
    freed: list[str] = field(default_factory=list)
    time: float = 0.0
    #: What slots of this instance begin with.
    prefix: str = ""
    #: Values of parameters that are others than at the start, by name.
    values: Mapping[str, Any] = field(default_factory=dict)

    def slot(self) -> str:
        return f"{self.prefix}s{self.random.randrange(4)}"

    def any_of(self, variables: list[Variable]) -> Variable | None:
        return self.random.choice(variables) if variables else None

    def good_value(self, variable: Variable) -> Any:
        """One that a run goes on well with."""
        start, low, high = variable.start, variable.minimum, variable.maximum
        if variable.kind == "String":
            return self.random.choice(choices_of(self.description.name, variable.name) or (start,))
        if variable.kind == "Boolean":
            return self.random.randrange(2)
        if variable.kind == "Integer":
            some = (-(2**31), -1, 0, 1, 42, 2**31 - 1) if low is None else (start,)
            return self.random.choice(some)
        spread = trials_of(self.description.name).spread
        value = (start or 0.0) * self.random.uniform(1.0 - spread, 1.0 + spread)
        value = value or self.random.uniform(-0.5, 0.5)
        value = value if low is None else max(low, value)
        return value if high is None else min(high, value)

    def value(self, variable: Variable) -> Any:
        """What a parameter is now."""
        return self.values.get(variable.name, variable.start)

    def settable(self, kind: str) -> list[Variable]:
        """Ports that can be set before the initialisation."""
        of = self.description.of
        return [*of("input", kind), *of("parameter", kind)]


#: The case of a Boolean that is no truth value of C.
ODD_TRUTH = "neither 0 nor 1, which is true"

#: The case of a fixed parameter that keeps its value.
SAME = "a fixed parameter, to the value that it has"

CASES: dict[tuple[str, str], Callable[[Draw], Arguments | None]] = {}


def _case(function: str, case: str = "") -> Callable[[Any], Any]:
    def add(draw: Callable[[Draw], Arguments | None]) -> Any:
        assert (function, case) not in CASES
        CASES[function, case] = draw
        return draw

    return add


def _items(*items: Item, **more: Any) -> Arguments:
    return {"items": [*items], **more}


def _item(variable: Variable | None, value: Any, good: bool = True) -> Arguments | None:
    return None if variable is None else _items(Item(variable.reference, value, good))


# Values


def _of_another_kind(draw: Draw, kind: str) -> Variable | None:
    return draw.any_of([v for v in draw.description.variables if v.kind != kind])


def _text_port(draw: Draw) -> Variable | None:
    return draw.any_of([v for v in draw.description.variables if v.kind == "String"])


def _value_cases(kind: str) -> None:
    """The cases that are the same for all types."""
    some: Any = {"Real": 1.0, "Integer": 1, "Boolean": 1, "String": "x"}[kind]

    def parameters(draw: Draw, *variabilities: str) -> Variable | None:
        found = draw.description.of("parameter", kind)
        return draw.any_of([v for v in found if v.variability in variabilities])

    def good(draw: Draw, variable: Variable | None) -> Arguments | None:
        return None if variable is None else _item(variable, draw.good_value(variable))

    for action in ("Get", "Set"):
        function = f"fmi2{action}{kind}"
        _case(function, "n = 0, with NULL")(lambda draw: _items(null="both"))
        _case(function, "references NULL, n > 0")(
            lambda draw: _items(Item(0, some, False), null="references")
        )
        _case(function, "values NULL, n > 0")(
            lambda draw: _items(Item(0, some, False), null="values")
        )
        if kind == "Real":
            _case(function, "n = 2^60")(lambda draw: _items(Item(0, some, False), n=2**60))
        _case(function, "an unknown reference")(
            lambda draw: _items(
                Item(draw.random.choice((UNKNOWN, 2**31, len(draw.description.variables))),
                     some, False)
            )
        )  # fmt: skip
        if function == "fmi2GetReal":
            _case(function, "a String")(lambda draw: _item(_text_port(draw), some, False))
        else:
            _case(function, "a port of another type")(
                lambda draw: _item(_of_another_kind(draw, kind), some, False)
            )
    _case(f"fmi2Get{kind}", "all ports")(
        lambda draw: _items(
            *(Item(v.reference) for v in draw.description.variables if v.kind == kind)
        )
    )

    @_case(f"fmi2Set{kind}", "a fixed parameter")
    def _fixed(draw: Draw) -> Arguments | None:
        variable = parameters(draw, "fixed")
        found = [] if variable is None else [draw.good_value(variable) for _ in range(20)]
        others = [value for value in found if value != draw.value(variable)]
        return _item(variable, others[0]) if others else None

    @_case(f"fmi2Set{kind}", SAME)
    def _same(draw: Draw) -> Arguments | None:
        variable = parameters(draw, "fixed")
        return None if variable is None else _item(variable, draw.value(variable))

    if kind in ("Real", "Boolean"):
        _case(f"fmi2Set{kind}", "an output")(
            lambda draw: _item(draw.any_of(draw.description.of("output", kind)), some, False)
        )
    if kind == "Real":
        _case("fmi2SetReal", "a tunable parameter")(
            lambda draw: good(draw, parameters(draw, "tunable"))
        )
        _case("fmi2SetReal", "an input")(
            lambda draw: good(draw, draw.any_of(draw.description.of("input")))
        )


for _kind in KINDS:
    _value_cases(_kind)


@_case("fmi2SetReal", "all inputs")
def _all_inputs(draw: Draw) -> Arguments | None:
    inputs = draw.description.of("input", "Real")
    return _items(*(Item(v.reference, draw.good_value(v)) for v in inputs)) if inputs else None


def _changeable(draw: Draw) -> Variable | None:
    """A Real port that can be set at any time before the end."""
    found = draw.settable("Real")
    return draw.any_of([v for v in found if v.variability != "fixed"])


@_case("fmi2SetReal", "the same twice")
def _same_twice(draw: Draw) -> Arguments | None:
    port = _changeable(draw)
    if port is None:
        return None
    return _items(*(Item(port.reference, draw.good_value(port)) for _ in range(2)))


@_case("fmi2SetReal", "100,000 times the same")
def _many(draw: Draw) -> Arguments | None:
    port = _changeable(draw)
    return None if port is None else _items(Item(port.reference, draw.good_value(port)), times=MANY)


@_case("fmi2GetReal", "100,000 times the same")
def _many_to_get(draw: Draw) -> Arguments | None:
    port = draw.any_of([v for v in draw.description.variables if v.kind == "Real"])
    return None if port is None else _items(Item(port.reference), times=MANY)


def _tunable(draw: Draw) -> list[Variable]:
    found = draw.description.of("parameter", "Real")
    return [v for v in found if v.variability == "tunable"]


for _whose, _found in (
    ("input", lambda draw: draw.description.of("input", "Real")),
    ("parameter", lambda draw: _tunable(draw) or draw.description.of("parameter", "Real")),
):
    _article = "an" if _whose == "input" else "a"

    @_case("fmi2SetReal", f"NaN for {_article} {_whose}")
    def _set_nan(draw: Draw, found: Callable[[Draw], Any] = _found) -> Arguments | None:
        return _item(draw.any_of(found(draw)), nan, False)

    @_case("fmi2SetReal", f"an infinite value for {_article} {_whose}")
    def _set_infinite(draw: Draw, found: Callable[[Draw], Any] = _found) -> Arguments | None:
        return _item(draw.any_of(found(draw)), draw.random.choice((inf, -inf)), False)


def _beyond(limit: float, direction: float, random: Random) -> float:
    return random.choice((nextafter(limit, direction), copysign(1e300, direction)))


@_case("fmi2SetReal", "below the range")
def _below(draw: Draw) -> Arguments | None:
    port = draw.any_of([v for v in draw.settable("Real") if v.minimum is not None])
    if port is None:
        return None
    return _item(port, _beyond(port.minimum, -inf, draw.random), False)


@_case("fmi2SetReal", "above the range")
def _above(draw: Draw) -> Arguments | None:
    port = draw.any_of([v for v in draw.settable("Real") if v.maximum is not None])
    if port is None:
        return None
    return _item(port, _beyond(port.maximum, inf, draw.random), False)


for _whose, _found in (
    ("inputs", lambda draw: draw.description.of("input", "Real")),
    ("parameters", _tunable),
):

    @_case("fmi2SetReal", f"one bad among good {_whose}")
    def _one_bad(draw: Draw, found: Callable[[Draw], Any] = _found) -> Arguments | None:
        ports = found(draw)
        if len(ports) < 2:
            return None
        first, second = draw.random.sample(ports, 2)
        items = [Item(first.reference, draw.good_value(first)), Item(second.reference, nan, False)]
        draw.random.shuffle(items)
        return _items(*items)


@_case("fmi2SetReal", "an unknown reference among good")
def _unknown_among_good(draw: Draw) -> Arguments | None:
    port = _changeable(draw)
    if port is None:
        return None
    items = [Item(port.reference, draw.good_value(port), False), Item(UNKNOWN, 1.0, False)]
    draw.random.shuffle(items)
    return _items(*items)


@_case("fmi2GetReal", "one bad among good")
def _one_bad_to_get(draw: Draw) -> Arguments | None:
    good = draw.any_of(draw.description.of("output", "Real"))
    bad = draw.random.choice((_text_port(draw), None))
    if good is None:
        return None
    items = [Item(good.reference), Item(UNKNOWN if bad is None else bad.reference, None, False)]
    draw.random.shuffle(items)
    return _items(*items)


@_case("fmi2GetReal", "all Integers and Booleans")
def _numbers(draw: Draw) -> Arguments | None:
    kinds = ("Integer", "Boolean")
    return _items(*(Item(v.reference) for v in draw.description.variables if v.kind in kinds))


@_case("fmi2SetBoolean", ODD_TRUTH)
def _odd_boolean(draw: Draw) -> Arguments | None:
    found = draw.description.of("parameter", "Boolean")
    port = draw.any_of([variable for variable in found if not draw.value(variable)])
    return _item(port, draw.random.choice((2, -1, 2**31 - 1)))


def _text(text: str) -> Callable[[Draw], Arguments | None]:
    return lambda draw: _item(draw.any_of(draw.settable("String")), text, False)


_case("fmi2SetString", "a text that is no choice")(_text("sigmoid"))
_case("fmi2SetString", "a text of 100,000 characters")(_text("x" * MANY))
_case("fmi2SetString", "a text that is not UTF-8")(_text(f"ta{NOT_UTF_8}nh"))


@_case("fmi2SetString", "a text that is NULL")
def _null_text(draw: Draw) -> Arguments | None:
    return _item(draw.any_of(draw.settable("String")), None, False)


# Logging, initialisation and end, steps


def _logging(case: str, on: int, categories: list[str | None], null: bool = False) -> None:
    _case("fmi2SetDebugLogging", case)(
        lambda draw: {"on": on, "categories": categories, "null": null}
    )


_logging("on, no categories", 1, [])
_logging("off", 0, [])
_logging("a category that is not declared", 1, ["undeclared"])
_logging("categories NULL, n > 0", 1, ["x"], null=True)
_logging("a category that is NULL", 1, [None])
_logging("a category that is not UTF-8", 1, [NOT_UTF_8])


def _setup(case: str, arguments: Callable[[Draw], Arguments]) -> None:
    _case("fmi2SetupExperiment", case)(
        lambda draw: {"start": 0.0, "stop": None, "tolerance": None, **arguments(draw)}
    )


_setup("start", lambda draw: {"start": draw.random.choice((0.0, 1.5, -3.0))})
_setup("start, stop, tolerance", lambda draw: {"stop": 10.0, "tolerance": 1e-6})
_setup("stop infinite", lambda draw: {"stop": inf})
_setup(
    "stop NaN or before start, tolerance NaN, which nothing uses",
    lambda draw: {"stop": draw.random.choice((nan, -1.0, -inf)), "tolerance": nan},
)
_setup("start NaN or infinite", lambda draw: {"start": draw.random.choice((nan, inf, -inf))})

for _mode_call in (
    "fmi2EnterInitializationMode",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
    "fmi2CancelStep",
):
    _case(_mode_call)(lambda draw: {})


@_case("fmi2ExitInitializationMode", "values that give no start")
def _no_start(draw: Draw) -> Arguments | None:
    return {} if trials_of(draw.description.name).no_start else None


@_case("fmi2GetReal", "outputs of values that give no start")
def _outputs_of_no_start(draw: Draw) -> Arguments | None:
    if trials_of(draw.description.name).no_start is None:
        return None
    return _items(*(Item(v.reference) for v in draw.description.of("output", "Real")))


def _step(case: str, arguments: Callable[[Draw], Arguments]) -> None:
    _case("fmi2DoStep", case)(lambda draw: {"time": draw.time, "h": 0.02, **arguments(draw)})


_step("a step", lambda draw: {})
_step("a step of another length", lambda draw: {"h": draw.random.choice((1e-9, 0.001, 0.05, 0.1))})
_step("a time that does not follow", lambda draw: {"time": draw.random.choice((-1.0, 0.37, 55.0))})
_step("a step of zero, which changes nothing", lambda draw: {"h": draw.random.choice((0.0, -0.0))})
_step("a step that is negative", lambda draw: {"h": draw.random.choice((-0.02, -1e-300, -1e300))})
_step("a step that is NaN or infinite", lambda draw: {"h": draw.random.choice((nan, inf, -inf))})
_step("a time that is NaN or infinite", lambda draw: {"time": draw.random.choice((nan, inf, -inf))})


@_case("fmi2DoStep", "more than 1,000,000 times h_max")
def _too_long(draw: Draw) -> Arguments | None:
    if not any(v.name == "h_max" for v in draw.description.variables):
        return None
    return {"time": draw.time, "h": draw.random.choice((2.0, 1e3, 1e200)) * MOST_INTERNAL_STEPS}


@_case("fmi2DoStep", "values that the equations overflow with")
def _overflow(draw: Draw) -> Arguments | None:
    setting = trials_of(draw.description.name).overflow
    return None if setting is None else {"time": draw.time + setting.time, "h": 0.02}


# States


@_case("fmi2GetFMUstate")
def _get_state(draw: Draw) -> Arguments:
    return {"slot": draw.slot()}


@_case("fmi2GetFMUstate", "into a state from before")
def _get_state_again(draw: Draw) -> Arguments | None:
    return {"slot": draw.random.choice(draw.own), "again": True} if draw.own else None


for _state_call in (
    "fmi2SetFMUstate",
    "fmi2FreeFMUstate",
    "fmi2SerializedFMUstateSize",
    "fmi2SerializeFMUstate",
):

    @_case(_state_call, "a state")
    def _own_state(draw: Draw) -> Arguments | None:
        return {"slot": draw.random.choice(draw.own)} if draw.own else None

    @_case(_state_call, "a state that was freed")
    def _freed_state(draw: Draw) -> Arguments | None:
        return {"freed": draw.random.choice(draw.freed)} if draw.freed else None

    @_case(_state_call, "NULL")
    def _null_state(draw: Draw) -> Arguments:
        return {"null": True}

    if _state_call != "fmi2SerializeFMUstate":

        @_case(_state_call, "a pointer to something else")
        def _stray_state(draw: Draw) -> Arguments:
            return {"stray": True}


@_case("fmi2FreeFMUstate", "a state that is NULL")
def _free_null(draw: Draw) -> Arguments:
    return {"nothing": True}


@_case("fmi2SetFMUstate", "a state of another instance")
def _others_state(draw: Draw) -> Arguments | None:
    return {"slot": draw.random.choice(draw.others)} if draw.others else None


@_case("fmi2SetFMUstate", "a state that was serialised")
def _serialised(draw: Draw) -> Arguments | None:
    return {"bytes of": draw.random.choice(draw.own), "change": None} if draw.own else None


def _changed(case: str, change: str) -> None:
    @_case("fmi2SetFMUstate", case)
    def _draw(draw: Draw) -> Arguments | None:
        if not draw.own:
            return None
        seed = draw.random.randrange(2**32)
        return {"bytes of": draw.random.choice(draw.own), "change": change, "seed": seed}


_changed("bytes that are no state", "noise")
_changed("bytes that were cut off", "cut")
_changed("bytes that were changed", "changed")
_changed("values that no run leads to, checksum and all", "impossible")


@_case("fmi2SetFMUstate", "bytes of another FMU's state")
def _foreign(draw: Draw) -> Arguments:
    return {"foreign": True}


for _case_name, _arguments in (
    ("too few bytes", {"more": -1}),
    ("too many bytes", {"more": 8}),
    ("bytes NULL", {"no bytes": True}),
):

    @_case("fmi2SerializeFMUstate", _case_name)
    def _serialise(draw: Draw, more: Arguments = _arguments) -> Arguments | None:
        return {"slot": draw.random.choice(draw.own), **more} if draw.own else None


_case("fmi2GetFMUstate", "NULL")(lambda draw: {"null": True})


@_case("fmi2DeSerializeFMUstate", "bytes of a state")
def _deserialise(draw: Draw) -> Arguments | None:
    return {"bytes of": draw.random.choice(draw.own)} if draw.own else None


_case("fmi2DeSerializeFMUstate", "bytes that are none, refused when they are set")(
    lambda draw: {"bytes": draw.random.choice((b"[" * 5000, b"\xff\x00", b"{}", b"null"))}
)
_case("fmi2DeSerializeFMUstate", "n = 0")(lambda draw: {"bytes": b""})
for _state_call in ("fmi2GetFMUstate", "fmi2DeSerializeFMUstate"):

    @_case(_state_call, "into a state that was freed")
    def _into_freed(draw: Draw) -> Arguments | None:
        return {"bytes": b"{}", "freed": draw.random.choice(draw.freed)} if draw.freed else None


_case("fmi2DeSerializeFMUstate", "bytes NULL, n > 0")(lambda draw: {"no bytes": True})
_case("fmi2DeSerializeFMUstate", "state NULL")(lambda draw: {"bytes": b"{}", "null": True})

# What is not supported

_UNSUPPORTED = (
    "fmi2SetRealInputDerivatives",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetDirectionalDerivative",
    *MODEL_EXCHANGE_FUNCTIONS,
)
for _function in _UNSUPPORTED:
    _case(_function, "anything")(lambda draw: {})

for _kind_of_status, _number in (("Real", LAST_SUCCESSFUL_TIME_KIND), ("Boolean", TERMINATED_KIND)):
    _named = {"Real": "fmi2LastSuccessfulTime", "Boolean": "fmi2Terminated"}[_kind_of_status]
    for _case_name, _arguments in (
        (_named, {"kind": _number}),
        ("another kind", {"kind": 0}),
        ("NULL", {"kind": _number, "null": True}),
    ):
        _case(f"fmi2Get{_kind_of_status}Status", _case_name)(
            lambda draw, arguments=_arguments: dict(arguments)
        )
for _function in ("fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"):
    _case(_function, "anything")(lambda draw: {"kind": draw.random.randrange(4)})
    _case(_function, "NULL")(lambda draw: {"kind": draw.random.randrange(4), "null": True})


# Making calls


def make(host: Host, call: Call, saved: Saved) -> Status:
    """Make a call on an instance; what it gives is checked as far as it does not depend on it."""
    how = _MADE.get(call.function)
    return host.call(call.function) if how is None else how(host, call, saved)


def _encoded(text: str | None) -> bytes | None:
    return None if text is None else text.encode("utf-8", "surrogateescape")


def _make_values(host: Host, call: Call, saved: Saved) -> Status:
    action, kind = call.function[4:7], call.function[7:]
    items, null = call.arguments["items"], call.arguments.get("null")
    times = call.arguments.get("times", 1)
    n = len(items) * times
    values = [item.value for item in items] * times
    if kind == "String":
        values = [_encoded(value) for value in values]
    references = (c_uint * n)(*[item.reference for item in items] * times)
    array = (_C_TYPES[kind] * n)(*(values if action == "Set" else ()))
    status = host.call(
        call.function,
        None if null in ("references", "both") else references,
        c_size_t(call.arguments.get("n", n)),
        None if null in ("values", "both") else array,
    )
    if action == "Get" and null is None:
        for item, value in zip(items, array, strict=False):
            wanted = _MISSING[kind]
            if item.good and status != Status.OK:
                _, [wanted] = host.get(kind, [item.reference])
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


#: Memory that is no state and no instance.
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
    if not call.arguments.keys().isdisjoint(("bytes", "bytes of", "foreign")):
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
    if "bytes of" not in call.arguments:
        content: bytes = call.arguments["bytes"]
        return content
    content = host.serialised(saved.states[call.arguments["bytes of"]])
    change = call.arguments.get("change")
    return states.changed(content, change, call.arguments["seed"]) if change else content


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
    target = None if call.arguments.get("no bytes") else room
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
    if call.arguments.get("no bytes"):
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
    **{f"fmi2{action}{kind}": _make_values for action in ("Get", "Set") for kind in KINDS},
}
