"""The stack that equations take, counted by hand; runs are in tests/fmu/test_stack.py."""

from __future__ import annotations

from fmus.language.build import program_of
from fmus.native.stack import deepest
from support.language import HEAD, module_of

TEXT = """
M = Matrix((0.0 for _ in range(100)) for _ in range(10))


def own_sum(a: Annotated[Vector, 100], b: Annotated[Vector, 100]) -> Annotated[Vector, 100]:
    c, d = a, b
    return c


def start(x: Annotated[Vector, 100]) -> Annotated[Vector, 10]:
    y = own_sum(own_sum(x, x), x)
    return M @ y
"""


def test_depth_is_that_of_the_calls_within_each_other(tmp_path):
    """What start holds: x, y, its result, two sums and a product; own_sum: two arguments, c and d.

    The matrix is not copied.
    """
    module = module_of(HEAD + TEXT, tmp_path, "deep")
    size, function = deepest(program_of(module.start).functions.values())
    assert function is not None and function.name == "start"
    assert size == 8 * (100 + 100 + 10 + 2 * 100 + 10 + 2 * 100 + 2 * 100)
