"""Equations as numba compiles them, on a text of the test's own."""

from __future__ import annotations

import sys
from math import tanh
from types import ModuleType

import pytest

pytest.importorskip("numba", reason="needs the extra `studies`")

from orchestrator.studies.batch.compilation import equations
from orchestrator.studies.batch.kernel import flat

TEXT = '''
"""An equation that refuses."""

from __future__ import annotations

from math import tanh

from auv_fmu.language import vectors
from auv_fmu.language.vectors import Vector3


class TooLong(ArithmeticError):
    """A vector of more than one."""


def bounded(x: Vector3) -> float:
    if vectors.norm(x) > 1.0:
        raise TooLong(f"|x| is {vectors.norm(x):.1f}")
    return tanh(x[0])
'''


@pytest.fixture
def equation(tmp_path, monkeypatch) -> ModuleType:
    path = tmp_path / "bounded_equation.py"
    path.write_text(TEXT)
    monkeypatch.syspath_prepend(tmp_path)
    import bounded_equation  # noqa: PLC0415

    yield bounded_equation
    del sys.modules["bounded_equation"]


def test_functions_give_what_their_text_gives_and_raise_without_a_text(equation):
    compiled = equations(equation)
    # What is called from Python must have what Python calls it by.
    import numba  # noqa: PLC0415

    bounded = numba.njit(compiled.bounded.py_func)
    assert bounded((0.1, 0.2, 0.3)) == tanh(0.1) == equation.bounded((0.1, 0.2, 0.3))
    with pytest.raises(equation.TooLong, match=r"^$"):
        bounded((1.0, 1.0, 1.0))


def test_flat_is_the_same_in_both():
    import numba  # noqa: PLC0415

    value = (1.0, (2.0, (3.0, 4.0)), ((5.0,), 6.0))
    assert flat(value) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)

    @numba.njit
    def compiled(x):
        return flat(x)

    assert compiled(value) == flat(value)
