"""Units of ports: products of SI symbols, in terms of base units.

A unit is written as in FMI, `kg.m2/s3`: factors are separated by dots, powers follow their symbols,
and a slash comes before each divisor, or before several divisors in brackets.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from math import pi
from typing import NamedTuple


class Unit(NamedTuple):
    """A unit: x of it are factor * x + offset in base units.

    Attributes:
        type_name: name of the type of variables with this unit.
        exponents: exponents of the base units; None for an unknown unit.

    """

    type_name: str
    exponents: Mapping[str, int] | None = None
    factor: float = 1.0
    offset: float = 0.0


#: Names of types by their units; types with other units are named after the unit.
_NAMES = {
    "1": "Dimensionless",
    "%": "Percentage",
    "1/s": "Rate",
    "A": "Current",
    "Hz": "Frequency",
    "J": "Energy",
    "K": "Temperature",
    "N": "Force",
    "N.m": "Torque",
    "N/m": "Stiffness",
    "Ohm": "Resistance",
    "Pa": "Pressure",
    "V": "Voltage",
    "W": "Power",
    "degC": "CelsiusTemperature",
    "kg": "Mass",
    "kg.m2": "MomentOfInertia",
    "kg.m2/s": "AngularDamping",
    "kg/m": "QuadraticDamping",
    "kg/m3": "Density",
    "kg/s": "LinearDamping",
    "m": "Length",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "m2": "Area",
    "m3": "Volume",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "s": "Time",
}

#: Symbols that may have a prefix, as powers of base units.
_SYMBOLS: dict[str, dict[str, int]] = {
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Hz": {"s": -1},
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "S": {"kg": -1, "m": -2, "s": 3, "A": 2},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}

#: Symbols without prefixes: factors and powers of base units.
_OTHERS: dict[str, tuple[float, dict[str, int]]] = {
    "1": (1.0, {}),
    "%": (0.01, {}),
    "g": (1e-3, {"kg": 1}),
    "kg": (1.0, {"kg": 1}),
    "t": (1e3, {"kg": 1}),
    "L": (1e-3, {"m": 3}),
    "bar": (1e5, {"kg": 1, "m": -1, "s": -2}),
    "min": (60.0, {"s": 1}),
    "h": (3600.0, {"s": 1}),
    "deg": (pi / 180.0, {"rad": 1}),
    "rpm": (pi / 30.0, {"rad": 1, "s": -1}),
    "degC": (1.0, {"K": 1}),
}

#: Offsets of units whose zero differs from the zero of their base unit.
_OFFSETS = {"degC": 273.15}

_PREFIXES = {"G": 1e9, "M": 1e6, "k": 1e3, "c": 1e-2, "m": 1e-3, "u": 1e-6, "n": 1e-9}

#: A symbol and its power; a slash with one divisor, or with several in brackets.
_FACTOR = re.compile(r"([A-Za-z]+|[%1])\^?(-?\d+)?")
_DIVIDED = re.compile(r"/\(([^()]*)\)|/([^./()]*)")


@cache
def unit_of(text: str) -> Unit:
    """Read a unit."""
    name = _NAMES.get(text, f"Quantity in {text}")
    if text in _OFFSETS:
        factor, exponents = _OTHERS[text]
        return Unit(name, exponents, factor, _OFFSETS[text])
    factor, exponents = 1.0, {}
    divisors = [brackets or divisor for brackets, divisor in _DIVIDED.findall(text)]
    product = _DIVIDED.sub("", text)
    if divisors and not text.startswith(f"{product}/"):
        return Unit(name)  # a / b.c is ambiguous
    for factors, sign in ((product, 1), *((divisor, -1) for divisor in divisors)):
        for part in factors.split("."):
            match = _FACTOR.fullmatch(part)
            known = _symbol(match[1]) if match else None
            if match is None or known is None:
                return Unit(name)
            power = sign * int(match[2] or 1)
            factor *= known[0] ** power
            for base, exponent in known[1].items():
                exponents[base] = exponents.get(base, 0) + power * exponent
    return Unit(name, {base: n for base, n in exponents.items() if n}, factor)


def rate_of(text: str) -> str:
    """Return the unit of a rate of a quantity with a unit; empty if it has no short form."""
    product, slash, divisor = text.partition("/")
    power = re.fullmatch(r"s(\d*)", divisor)
    if not text or unit_of(text).offset or (slash and not power):
        return ""
    return f"{product}/s{int(power[1] or 1) + 1}" if power else f"{text}/s"


def _symbol(symbol: str) -> tuple[float, dict[str, int]] | None:
    """Return the factor and the base units of a symbol; None for an unknown symbol."""
    if symbol in _OTHERS:
        return _OTHERS[symbol]
    if symbol in _SYMBOLS:
        return 1.0, _SYMBOLS[symbol]
    prefix, rest = symbol[:1], symbol[1:]
    if prefix in _PREFIXES and rest in _SYMBOLS:
        return _PREFIXES[prefix], _SYMBOLS[rest]
    return None
