"""The kernel and the equations, compiled by numba once for each set of blocks and kept.

It is the same code, except for the texts of refusals: numba makes no texts, so exceptions of
compiled equations have none. As in Python, each operation is rounded separately, nothing is
contracted or reordered, and sine and the like come from the same library.
"""

from __future__ import annotations

import ast
import inspect
import math
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import serialize
from numba.core.compiler import CompileResult
from numba.extending import intrinsic, overload

from auv_fmu.guidance import path_planner
from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import solve
from auv_fmu.loop.blocks import Blocks, SeaWaves
from auv_fmu.loop.closed_loop import Moment, Setting
from orchestrator.machine.cache import read_cached, write_cached
from orchestrator.studies.batch import kernel
from orchestrator.studies.batch.support import digest

#: It would look for its configuration in the current folder before each compilation.
numba.core.config._config_fname = os.devnull

#: What the compiled kernels are in the user's cache folder.
_CATEGORY = "batch"

#: Where a number is not finite, Python raises in some places; here it is found afterwards.
_OPTIONS: Any = {"nogil": True, "error_model": "numpy"}

#: A call costs as much as what most of them compute. Only compiled ones call them: what Python
#: and C would call them by takes half of the time to compile.
_WITHIN: Any = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}

#: The package of the equations.
_PACKAGE = "auv_fmu"


def _pure(name: str) -> Any:
    """A function of LLVM, which is what the C library has by that name, and has no memory."""

    @intrinsic
    def function(_: Any, x: Any) -> Any:
        def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            double = context.get_value_type(types.float64)
            return builder.call(builder.module.declare_intrinsic(name, [double]), arguments)

        return types.float64(types.float64), call

    return function


def _places(numba_type: Any, place: str = "value") -> list[str]:
    """Expressions for all numbers of a nested tuple of some type."""
    if not isinstance(numba_type, types.BaseTuple):
        return [place]
    parts: Any = numba_type
    return [one for i, part in enumerate(parts) for one in _places(part, f"{place}[{i}]")]


def _tree(terms: list[str]) -> str:
    """A sum as a tree, whose branches a processor computes side by side."""
    half = len(terms) // 2
    return f"({_tree(terms[:half])} + {_tree(terms[half:])})" if half else "".join(terms) or "0.0"


#: What is another expression for each type of tuple, and its text.
_WRITTEN_OUT: dict[Any, Callable[[list[str]], str]] = {
    kernel.flat: lambda xs: f"({', '.join(xs)},)",
    kernel.square: lambda xs: _tree([f"{x} * {x}" for x in xs]),
    kernel.nought: lambda xs: _tree([f"0.0 * {x}" for x in xs]),
}


def _overload(function: Any, text: Callable[[list[str]], str]) -> None:
    overload(function)(lambda value: eval(f"lambda value: {text(_places(value))}"))


for _function, _text in _WRITTEN_OUT.items():
    _overload(_function, _text)


@intrinsic
def _fmod(_: Any, x: Any, y: Any) -> Any:
    """The instruction of LLVM that calls what the C library has by that name."""

    def call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.frem(*arguments)

    return types.float64(types.float64, types.float64), call


#: What numba does not know; and sine and cosine of an angle, which are computed once, together,
#: wherever they are needed.
_PURE: dict[Any, Any] = {math.sin: _pure("llvm.sin"), math.cos: _pure("llvm.cos"), math.fmod: _fmod}


def _as_it_is(value: Any) -> Any:
    """A vector is a tuple here, and a matrix a tuple of rows."""
    return value


def _solved(A: Any, b: Any) -> Any:
    """What :func:`solve` gives, with its operations in the same order, as an array."""
    n = len(b)
    M, x = np.empty((n, n)), np.empty(n)
    for i in range(n):
        x[i] = b[i]
        for j in range(n):
            M[i, j] = A[i][j]
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(M[i, k]) > abs(M[p, k]):
                p = i
        largest, right = M[p, k], x[p] / M[p, k]
        for j in range(n):
            M[p, j], M[k, j] = M[k, j], M[p, j] / largest
        x[p], x[k] = x[k], right
        for i in range(n):
            if i != k:
                factor = M[i, k]
                for j in range(n):
                    M[i, j] = M[i, j] - factor * M[k, j]
                x[i] = x[i] - factor * right
    return x


#: What numba does not know, and what stands for it.
_OWN: dict[Any, Any] = {
    known: numba.njit(function, **_OPTIONS, **_WITHIN)
    for known, function in ((Vector, _as_it_is), (Matrix, _as_it_is), (solve, _solved))
}


def equations(module: ModuleType) -> ModuleType:
    """A module made anew, of which all functions are compiled when they are first called.

    What it takes from other modules of equations is compiled too. Types and constants stay the
    modules' own: a state is of the same type on both sides.
    """
    made = ModuleType(module.__name__)
    tree = ast.parse(inspect.getsource(module))
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
    names = {one.name for one in functions if vars(module)[one.name] not in _WRITTEN_OUT}
    scope = vars(made)
    for name, value in vars(module).items():
        if name not in names:
            scope[name] = _counterpart(value)
    exec(_code([one for one in functions if one.name in names], str(module.__file__)), scope)
    for name in names:
        scope[name] = numba.njit(scope[name], **_OPTIONS, **_WITHIN)
    return made


#: The equations of this process: one module of each name.
_equations = cache(equations)


def _counterpart(value: Any) -> Any:
    if isinstance(value, BuiltinFunctionType):
        return _PURE.get(value, value)
    if isinstance(value, type | FunctionType) and value in _OWN:
        return _OWN[value]
    if isinstance(value, ModuleType) and _is_compiled(value.__name__):
        return _equations(value)
    if isinstance(value, FunctionType) and _is_compiled(value.__module__):
        return vars(_equations(sys.modules[value.__module__]))[value.__name__]
    return value


def _is_compiled(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] == _PACKAGE


def _code(functions: list[ast.FunctionDef], path: str) -> CodeType:
    """The functions without types, and without what their refusals say."""
    for function in functions:
        _InNumba().visit(function)
        function.returns = None
        for argument in function.args.args:
            argument.annotation = None
        for node in ast.walk(function):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                node.exc = node.exc.func
    return compile(ast.fix_missing_locations(ast.Module([*functions], [])), path, "exec")


class _InNumba(ast.NodeTransformer):
    """What numba has other words for: elements of matrices, and rows that are taken apart."""

    def __init__(self) -> None:
        """Begin a function."""
        self._rows: set[str] = set()

    def visit_For(self, node: ast.For) -> ast.AST:
        """Note what a loop calls a row."""
        if isinstance(node.target, ast.Name):
            self._rows.add(node.target.id)
        return self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        """Take a row apart by places: of an array, numba does not know how many it has."""
        target, value = node.targets[0], node.value
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Name) and value.id in self._rows:
            places = [
                ast.Subscript(ast.Name(value.id, ast.Load()), ast.Constant(i), ast.Load())
                for i in range(len(target.elts))
            ]
            node.value = ast.Tuple([*places], ast.Load())
        return self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Write A[i, j] as A[i][j]: a matrix is a tuple of tuples."""
        self.generic_visit(node)
        if isinstance(node.slice, ast.Tuple) and isinstance(node.ctx, ast.Load):
            value = node.value
            for place in node.slice.elts:
                value = ast.Subscript(value, place, ast.Load())
            return value
        return node


@cache
def compile_run(blocks: Blocks) -> Callable[..., Moment]:
    """Compile the function :func:`.kernel.run` for a loop with some blocks.

    It is compiled when it is first called, which takes some ten seconds, unless some process of
    this user has done so before. It takes the setting of the loop as :func:`packed` makes it.
    """
    made = equations(kernel)
    all_blocks: Any = blocks
    compiled = (type(one)(*map(_counterpart, one)) for one in all_blocks)
    vars(made)["blocks"] = Blocks(*compiled)
    run: Callable[..., Moment] = numba.njit(made.run.py_func, **_OPTIONS)
    functions = [f"{one.__module__}.{one.__name__}" for block in blocks for one in block]
    vars(run)["_cache"] = _Kept(" ".join(functions))
    return run


def packed(setting: Setting) -> Setting:
    """A setting with arrays instead of long tuples, which would be as many arguments each."""
    planner: Any = setting.planner
    water: Any = setting.water
    if isinstance(planner, path_planner.Parameters):
        way: Any = planner.waypoints
        x, y, z, t = map(np.array, (way.x, way.y, way.z, way.t))
        way = way._replace(x=x, y=y, z=z, t=t)
        setting = setting._replace(planner=planner._replace(waypoints=way))
    if isinstance(water, SeaWaves):
        waves: Any = np.array(water.waves)
        setting = setting._replace(water=water._replace(waves=waves))
    return setting


class _Kept:
    """What numba asks for code that was compiled earlier, instead of its own cache.

    Numba's cache is where its configuration says, and takes whatever is there.
    """

    cache_path = None

    def __init__(self, name: str) -> None:
        """Take the name of a variant of the kernel."""
        self._name = name

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The code for the types of arguments, or None."""
        target.refresh()
        rebuild: Any = CompileResult._rebuild
        for content in read_cached(_CATEGORY, self._key(signature, target.codegen())).values():
            return rebuild(target, *pickle.loads(content))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep code."""
        dumps: Any = serialize.dumps
        key = self._key(signature, result.codegen)
        # What cannot be kept is compiled again.
        with suppress(OSError):
            if not read_cached(_CATEGORY, key):
                write_cached(_CATEGORY, key, {"kernel": dumps(result._reduce())})

    def _key(self, signature: Any, codegen: Any) -> str:
        text = repr((self._name, signature, numba.__version__, sys.version, codegen.magic_tuple()))
        return f"{digest()}-{sha256(text.encode()).hexdigest()[:16]}"
