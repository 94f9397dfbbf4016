"""The stack that a translation takes, counted by hand; runs are in tests/fmu/test_stack.py."""

from __future__ import annotations

import re

from fmus.discovery import components, source_of
from fmus.native.stack import deepest
from fmus.native.translator import translated

TEXT = """\
typedef struct {
    double v[100]; /* Vector9 v[10]; */
} Vector100;

typedef struct {
    Vector100 v[10];
} Matrix10x100;

typedef Vector100 model_inputs;

static Vector100 own_sum(Vector100 a, Vector100 b) {
    const Vector100 c = a, d = b;
    return c;
}

static double own_last(const Matrix10x100 *M, Vector100 x) {
    return own_first((Vector100){{0.0, 1.0}});
}

static void model_start(const model_inputs *inputs, double t) {
    const Vector100 x = own_sum(own_sum(*inputs, *inputs), *inputs);
    own_last(&M, x);
}
"""


def test_depth_is_that_of_the_calls_within_each_other():
    """What start holds: x and two sums; what a call of own_sum does: arguments, c and d."""
    assert deepest(TEXT) == (800 * (3 + 2 + 2), "model_start")


def test_structures_and_functions_of_components_are_all_found():
    """A type or a head that is written in another way would count for nothing."""
    for name in components():
        text = re.sub(r"/\*.*?\*/", "", translated(source_of(name).definition), flags=re.S)
        heads = re.findall(r"^static (?!const)[^=;]*?\{$", text, re.M | re.S)
        assert len(re.findall(r"^\}$", text, re.M)) == len(heads)
        assert deepest(text)[0] > 0
