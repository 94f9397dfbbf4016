"""Units are products of SI symbols; any other unit is only a name."""

from __future__ import annotations

from math import pi
from xml.etree import ElementTree

import pytest

from fmus.ports.description import unit_definitions
from fmus.ports.units import Unit, rate_of, unit_of


@pytest.mark.parametrize(
    ("text", "exponents"),
    [
        ("1", {}), ("m/s2", {"m": 1, "s": -2}), ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N/m", {"kg": 1, "s": -2}), ("kg.m2/s3", {"kg": 1, "m": 2, "s": -3}),
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}), ("V.A", {"kg": 1, "m": 2, "s": -3}),
        ("Ohm.A/V", {}), ("F.Ohm", {"s": 1}), ("H/Ohm", {"s": 1}),
        ("W/(m2.K)", {"kg": 1, "s": -3, "K": -1}), ("J/kg/K", {"m": 2, "s": -2, "K": -1}),
        ("s-1", {"s": -1}), ("m^2", {"m": 2}), ("Wb/m2/T", {}), ("C/s", {"A": 1}), ("S.Ohm", {}),
        ("cd", {"cd": 1}), ("mol/m3", {"mol": 1, "m": -3}),
    ],
)  # fmt: skip
def test_products_come_down_to_base_units(text, exponents):
    assert unit_of(text)[1:] == (exponents, 1.0, 0.0)


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        ("km/h", 1.0 / 3.6), ("mV", 1e-3), ("kPa", 1e3), ("MW", 1e6), ("bar", 1e5), ("%", 0.01),
        ("L/min", 1e-3 / 60.0), ("deg", pi / 180.0), ("rpm", pi / 30.0), ("g", 1e-3), ("t", 1e3),
        ("mm2", 1e-6), ("min", 60.0), ("us", 1e-6),
    ],
)  # fmt: skip
def test_others_are_some_of_them(text, factor):
    assert unit_of(text).factor == pytest.approx(factor)


def test_degrees_celsius_begin_elsewhere_but_not_in_a_product():
    assert unit_of("degC") == Unit("CelsiusTemperature", {"K": 1}, 1.0, 273.15)
    assert unit_of("J/degC").offset == 0.0


@pytest.mark.parametrize(
    "text", ["furlong", "", "m/s.kg", "m//s", "/s", "m s", "2m", "s-", "kkg", "m/(s", "°C"]
)
def test_what_cannot_be_read_has_no_base_units(text):
    assert unit_of(text) == Unit(f"Quantity in {text}", None)


def test_a_description_says_it():
    definitions = unit_definitions(["%", "degC", "furlong", "1", "m/s"])
    assert ElementTree.tostring(definitions, encoding="unicode") == (
        '<UnitDefinitions><Unit name="%"><BaseUnit factor="0.01" /></Unit>'
        '<Unit name="degC"><BaseUnit K="1" offset="273.15" /></Unit>'
        '<Unit name="furlong" /><Unit name="1"><BaseUnit factor="1" /></Unit>'
        '<Unit name="m/s"><BaseUnit m="1" s="-1" /></Unit></UnitDefinitions>'
    )


@pytest.mark.parametrize(
    ("unit", "rate"),
    [("m", "m/s"), ("1", "1/s"), ("rad/s", "rad/s2"), ("kg.m2/s3", "kg.m2/s4"), ("K/W", ""),
     ("degC", ""), ("", "")],
)  # fmt: skip
def test_units_of_rates(unit, rate):
    assert rate_of(unit) == rate
