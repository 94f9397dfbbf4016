"""Equations as numba compiles them: the same text, except what refusals say.

Numba makes no texts, so what compiled equations raise has none. The rest is Python's: each
operation is rounded by itself, nothing is contracted or reordered, and sine and the like come from
the same library.
"""

from __future__ import annotations

import ast
import inspect
import math
import sys
from collections.abc import Callable
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic

from orchestrator.studies.batch import accumulator, kernel
from orchestrator.studies.batch.numbers import overload_all

#: Where a number is not finite, Python raises in some places; here it is found afterwards.
OPTIONS: Any = {"nogil": True, "error_model": "numpy"}

#: A call costs as much as what most of them compute. Only compiled ones call them: what Python
#: and C would call them by takes half of the time to compile.
_WITHIN: Any = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: What is compiled besides the package of the equations.
_PACKAGE, _MODULES = "auv_fmu", (kernel.__name__, accumulator.__name__)

overload_all()


def _pure(name: str) -> Any:
    """A function of LLVM, which is what the C library has by that name, and has no memory."""

    @intrinsic
    def function(_: Any, x: Any) -> Any:
        def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            double = context.get_value_type(types.float64)
            return builder.call(builder.module.declare_intrinsic(name, [double]), arguments)

        return types.float64(types.float64), call

    return function


#: Sine and cosine of an angle are computed once, together, wherever they are needed.
_PURE = {math.sin: _pure("llvm.sin"), math.cos: _pure("llvm.cos")}


class Equations:
    """Modules of functions that are compiled when they are first called.

    Types and constants stay the modules' own: a state is of the same type on both sides.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self._made: dict[str, ModuleType] = {}

    def module(self, module: ModuleType) -> ModuleType:
        """A module of which everything is compiled, with what it takes from others."""
        if module.__name__ not in self._made:
            self._made[module.__name__] = ModuleType(module.__name__)
            self._fill(self._made[module.__name__], module, str(inspect.getsourcefile(module)))
        return self._made[module.__name__]

    def anew(self, module: ModuleType, path: Path) -> ModuleType:
        """The same, made anew, with functions that say they are from another file."""
        made = ModuleType(module.__name__)
        self._fill(made, module, str(path))
        return made

    def _fill(self, made: ModuleType, module: ModuleType, path: str) -> None:
        tree = ast.parse(inspect.getsource(module))
        functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
        names = {function.name for function in functions}
        scope = vars(made)
        for name, value in vars(module).items():
            if name not in names:
                scope[name] = self._counterpart(value)
        exec(_code(functions, path), scope)
        for name in names:
            scope[name] = numba.njit(scope[name], **OPTIONS, **_WITHIN)

    def function(self, function: Callable[..., Any]) -> Any:
        """A function, compiled."""
        return vars(self.module(sys.modules[function.__module__]))[function.__name__]

    def _counterpart(self, value: Any) -> Any:
        if isinstance(value, BuiltinFunctionType):
            return _PURE.get(value, value)
        if isinstance(value, ModuleType) and _is_compiled(value.__name__):
            return self.module(value)
        if isinstance(value, FunctionType) and _is_compiled(value.__module__):
            return self.function(value)
        return value


#: The equations of this process.
EQUATIONS = Equations()


def _is_compiled(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] == _PACKAGE or module in _MODULES


def _code(functions: list[ast.FunctionDef], path: str) -> CodeType:
    """The functions without types, and without what their refusals say."""
    for function in functions:
        function.returns = None
        for argument in function.args.args:
            argument.annotation = None
        for node in ast.walk(function):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                node.exc = node.exc.func
    return compile(ast.Module([*functions], []), path, "exec")
