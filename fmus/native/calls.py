"""Calls of the language of equations in C: mathematics, classes, methods and functions."""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from types import BuiltinFunctionType, FunctionType
from typing import Any

from auv_fmu.language.arrays import Matrix, Vector
from fmus.native import arrays
from fmus.native.expressions import (
    EQUALITY,
    NUMBERS,
    PRODUCT,
    UNARY,
    WHOLE,
    Code,
)
from fmus.native.flat import has_only_doubles
from fmus.native.layout import laid_out
from fmus.native.loops import loop_over
from fmus.native.operators import Operators
from fmus.native.program import Function, literal, number_in_c
from fmus.native.shapes import (
    BOOLEAN,
    DOUBLE,
    INTEGER,
    Shape,
    Structure,
    has_no_size,
    in_c,
    matrix,
    shape_of,
    structure,
    vector,
)
from fmus.native.variables import free_names, is_dotted_name, is_fixed_name, names_in, renamed
from fmus.ports.groups import hints_of

#: Functions that never raise, and arithmetic.h's for the others.
_PLAIN: dict[Any, str] = {
    math.atan: "atan", math.atan2: "atan2", math.asinh: "asinh", math.copysign: "copysign",
    math.fabs: "fabs", math.tanh: "tanh",
}  # fmt: skip
_RAISING: dict[Any, str] = {
    math.acos: "ACOS", math.acosh: "ACOSH", math.asin: "ASIN", math.atanh: "ATANH",
    math.cos: "COS", math.cosh: "COSH", math.exp: "EXP", math.expm1: "EXPM1", math.fmod: "FMOD",
    math.log: "LOG", math.log10: "LOG10", math.log1p: "LOG1P", math.log2: "LOG2",
    math.pow: "POW", math.sin: "SIN", math.sinh: "SINH", math.sqrt: "SQRT", math.tan: "TAN",
}  # fmt: skip
_TESTS: dict[Any, str] = {
    math.isfinite: "isfinite", math.isinf: "isinf", math.isnan: "isnan",
}  # fmt: skip

#: What makes an int of a float, and the function of C before that.
_TO_INTEGER: dict[Any, str] = {
    int: "trunc", math.ceil: "ceil", math.floor: "floor", math.trunc: "trunc", round: "nearest",
}  # fmt: skip

#: What takes a number by a constant factor, as Python's math computes it.
_FACTORS: dict[Any, float] = {
    math.degrees: math.degrees(1.0), math.radians: math.radians(1.0),
}  # fmt: skip

#: All that takes one number and is no function of C.
_OF_ONE = (abs, bool, float, len, *_TESTS, *_TO_INTEGER, *_FACTORS)

_TWO = frozenset((math.atan2, math.copysign, math.fmod, math.pow))


class Calls(Operators):
    """Translates calls, and the other expressions of a function."""

    def _call(self, node: ast.Call, wanted: Shape | None) -> Code:
        local = node.func.id if isinstance(node.func, ast.Name) else ""
        if local in self.functions:
            if self.assigned is not None and local not in self.assigned:
                raise self.fail(node, f"{local} may have no value here")
            function, captured = self.functions[local]
            n = len(function.arguments) - len(captured)
            codes = self._arguments(node, list(function.arguments)[:n])
            given = self._fitted(node, codes, list(function.arguments.values())[:n])
            return self.calling(function, [*given, *self._values(node, captured)])
        called = self.known(node.func)
        if called is None and isinstance(node.func, ast.Attribute):
            return self._method(node, node.func)
        if called in (Vector, Matrix, tuple):
            return self._array(node, called)
        simple = self._mathematics(node, called)
        if simple is not None:
            return simple
        if isinstance(called, type) and hasattr(called, "_fields"):
            return self._record(node, called)
        if isinstance(called, FunctionType):
            return self._function(node, called)
        raise self.fail(node, f"{ast.unparse(node.func)} is not a function of equations")

    def _mathematics(self, node: ast.Call, called: Any) -> Code | None:
        """A function of Python's own; None: it is none of them."""
        if not isinstance(called, (type, BuiltinFunctionType)):
            return None
        if called in (min, max, *_PLAIN, *_RAISING, *_OF_ONE):
            self.check_plain(node, called.__name__)
        arguments = 1 + (called in _TWO)
        if called in (*_PLAIN, *_RAISING, *_OF_ONE) and len(node.args) != arguments:
            raise self.fail(node, f"{called.__name__} with {len(node.args)} arguments")
        if called in (min, max):
            return self._extreme(node, called.__name__)
        if called in _PLAIN or called in _RAISING:
            texts = [self.number(argument).argument for argument in node.args]
            self.made.raises |= called in _RAISING
            return Code(f"{(_PLAIN | _RAISING)[called]}({', '.join(texts)})", DOUBLE)
        if called is len:
            return self._length(node)
        return self._of_number(node.args[0], called) if called in _OF_ONE else None

    def _of_number(self, node: ast.expr, called: Any) -> Code:
        operand = self.code(node)
        if operand.shape not in NUMBERS:
            raise self.fail(node, f"{called.__name__} of {operand.shape.word}")
        is_whole = operand.shape in WHOLE
        code = operand
        if called in _FACTORS:
            number = self.number(node, operand)
            text = f"{number.within(PRODUCT)} * {number_in_c(_FACTORS[called])}"
            code = Code(text, DOUBLE, PRODUCT)
        elif called in _TESTS:
            number = Code(f"(double){operand.within(UNARY)}", DOUBLE)
            code = Code(f"{_TESTS[called]}({number.argument}) != 0", BOOLEAN, EQUALITY)
        elif called is bool:
            code = Code(f"{operand.within(EQUALITY + 1)} != 0", BOOLEAN, EQUALITY)
        elif called is float:
            code = Code(f"(double){operand.within(UNARY)}", DOUBLE, UNARY) if is_whole else operand
        elif called is abs and is_whole:
            code = Code(f"ABS({operand.argument})", INTEGER)
        elif called is abs:
            code = Code(f"fabs({operand.text})", DOUBLE)
        elif is_whole:
            code = Code(operand.text, INTEGER, operand.binding)
        else:
            code = Code(f"INT_OF({_TO_INTEGER[called]}({operand.argument}))", INTEGER)
        self.made.raises |= code.text.startswith(("ABS", "INT_OF"))
        return code

    def _length(self, node: ast.Call) -> Code:
        shape = self.code(node.args[0]).shape
        if not isinstance(shape, Structure) or not is_fixed_name(node.args[0]):
            raise self.fail(node, "len of a number, or of something that has no name")
        return Code(str(len(shape.parts)), INTEGER)

    def _extreme(self, node: ast.Call, word: str) -> Code:
        if len(node.args) == 1:
            code = self.code(node.args[0])
            shape = code.shape
            if not isinstance(shape, Structure) or not shape.is_array:
                raise self.fail(node, f"{word} of {shape.word}")
            if shape.parts[0][1] not in NUMBERS:
                raise self.fail(node, f"{word} of {shape.parts[0][1].word}")
            return self.calling(arrays.extreme(self.program, shape, word), [code.text])
        codes = [self.code(argument) for argument in node.args]
        is_float = any(code.shape == DOUBLE for code in codes)
        is_bool = all(code.shape == BOOLEAN for code in codes)
        kind = DOUBLE if is_float else BOOLEAN if is_bool else INTEGER
        codes = [self.fit(argument, code, DOUBLE) if is_float else code
                 for argument, code in zip(node.args, codes)]  # fmt: skip
        for argument, code in zip(node.args, codes):
            if code.shape not in NUMBERS:
                raise self.fail(argument, f"{word} of {code.shape.word}")
        function = arrays.extreme_of_two(word, kind)
        text = codes[0].text
        for code in codes[1:]:
            text = f"{function}({text}, {code.text})"
        return Code(text, kind)

    # Vectors, matrices and tuples

    def _array(self, node: ast.Call, made: Any) -> Code:
        if len(node.args) != 1 or node.keywords:
            raise self.fail(node, f"{made.__name__} of other than one argument")
        [given] = node.args
        if isinstance(given, ast.GeneratorExp):
            return self._comprehension(given, made)
        if isinstance(given, (ast.List, ast.Tuple)) and made is Matrix:
            rows = [self._row(row) for row in given.elts]
        elif isinstance(given, (ast.List, ast.Tuple)):
            codes = self.elements(given.elts, ())
            return self.literal(self._array_of(node, made, codes), codes)
        else:
            code = self.code(given)
            is_same = isinstance(code.shape, Structure) and code.shape.made is made
            if is_same and made is not tuple:
                return code
            if not is_dotted_name(given):
                raise self.fail(node, f"{made.__name__} of something that has no name")
            parts = self.parts(given, code)
            if made is not Matrix:
                return self.literal(self._array_of(node, made, parts), parts)
            rows = [self._as_row(given, part) for part in parts]
        if len({row.shape for row in rows}) != 1:
            raise self.fail(node, "a Matrix of rows of different lengths")
        return self.literal(matrix(len(rows), *arrays.sizes(rows[0].shape)), rows)

    def _array_of(self, node: ast.AST, made: Any, codes: Sequence[Code]) -> Structure:
        if made is tuple:
            return structure([code.shape for code in codes])
        for code in codes:
            if code.shape not in NUMBERS:
                raise self.fail(node, f"{code.shape.word} in a Vector")
        return vector(len(codes))

    def _row(self, node: ast.expr) -> Code:
        if isinstance(node, (ast.List, ast.Tuple)):
            codes = self.elements(node.elts, ())
            return self.literal(self._array_of(node, Vector, codes), codes)
        if isinstance(node, ast.GeneratorExp):
            return self._comprehension(node, Vector)
        code = self.code(node)
        return self._as_row(node, code)

    def _as_row(self, node: ast.expr, code: Code) -> Code:
        if isinstance(code.shape, Structure) and code.shape.made is Vector:
            return code
        if not is_dotted_name(node):
            raise self.fail(node, "a row that is neither a Vector nor written out")
        parts = self.parts(node, code)
        return self.literal(self._array_of(node, Vector, parts), parts)

    def _comprehension(self, node: ast.GeneratorExp, made: Any) -> Code:
        """A vector of what an expression gives in a loop: a function of its own."""
        if len(node.generators) > 1 or node.generators[0].ifs:
            raise self.fail(node, "an expression with more than one for, or with an if")
        around = {*free_names(node.generators[0].iter), *self._captured(node)}
        outer = around & names_in(node.generators[0].target)
        node = renamed(node, {name: self.unused(f"{name}_in") for name in sorted(outer)})
        [first] = node.generators
        inner, captured = self.inside(node, f"each{next(self.numbers)}")
        target = names_in(first.target)
        inner.names |= target
        elements, place = inner.unused("elements"), inner.unused("place")
        loop = loop_over(inner, first.target, first.iter, set())
        if loop.turns is None or loop.turns < 1:
            raise self.fail(node, "a number of elements that is not a constant above 0")
        lines = [line for text in loop.before for line in laid_out(text, "    ")]
        lines += laid_out(loop.head(may_raise=False), "    ")
        for name, code in loop.bound:
            inner.local[name] = code.shape
            if inner.assigned is not None:
                inner.assigned.add(name)
            if code.text != in_c(name):
                self.program.defined(code.shape)
                lines += laid_out(f"const {code.shape.name} {in_c(name)} = {code.text};", " " * 8)
        is_matrix = made is Matrix
        element = inner._row(node.elt) if is_matrix else inner.code(node.elt)
        shape = self._comprehended(node, made, element, loop.turns)
        self.program.defined(shape)
        inner.made.returns = shape
        lines += laid_out(f"{elements}.v[{place}++] = {element.text};", " " * 8)
        begin = [
            *laid_out(inner.made.head, ""),
            f"    {shape.name} {elements};",
            f"    int {place} = 0;",
        ]
        inner.made.text = "\n".join([*begin, *lines, "    }", f"    return {elements};", "}"])
        self.program.functions[inner.made.name] = inner.made
        return self.calling(inner.made, self._values(node, captured))

    def _comprehended(self, node: ast.AST, made: Any, element: Code, n: int) -> Structure:
        if made is Matrix:
            return matrix(n, *arrays.sizes(element.shape))
        if made is tuple:
            return structure([element.shape] * n)
        return self._array_of(node, Vector, [element] * n)

    def _values(self, node: ast.AST, captured: Sequence[str]) -> list[str]:
        """Names that a function within this one captures, as its arguments."""
        names = (ast.copy_location(ast.Name(name, ast.Load()), node) for name in captured)
        return [self.code(name).text for name in names]

    def inside(self, node: ast.AST, word: str) -> tuple[Calls, list[str]]:
        """What translates a function within this one, and the names that it captures."""
        used = [*free_names(node), *self._captured(node)]
        captured = [n for n in dict.fromkeys(used) if n in self.names and n not in self.functions]
        for name in captured:
            if name not in self.local:
                raise self.fail(node, f"{name} may have no value here")
        owner = (self.made.name, word, type(node))
        name = self.program.name(owner, f"{self.made.name}_{word}")
        made = Function(name, {n: self.local[n] for n in captured}, None)
        inner = type(self)(self.program, self.path, self.scope, made, set(captured), self.words)
        if self.assigned is not None:
            known = self.assigned & self.functions.keys()
            inner.functions = {name: self.functions[name] for name in known}
            inner.assigned = (self.assigned & set(captured)) | known
        return inner, captured

    def _captured(self, node: ast.AST) -> list[str]:
        """The names that functions within this one capture which are used in an expression."""
        return [n for name in free_names(node) for n in self.functions.get(name, (None, []))[1]]

    # Methods, records and functions

    def _method(self, node: ast.Call, method: ast.Attribute) -> Code:
        owner = self.code(method.value)
        shape = owner.shape
        if method.attr == "_replace" and isinstance(shape, Structure) and shape.made:
            return self._changed(node, method, owner)
        if method.attr not in arrays.METHODS or not arrays.is_array(shape):
            raise self.fail(node, f"{shape.word} has no method {method.attr} in the language")
        assert isinstance(shape, Structure)
        if method.attr == "sum" and len(arrays.sizes(shape)) != 1:
            raise self.fail(node, f"{shape.word} has no method sum")
        self.check_plain(node, method.attr)
        function = arrays.METHODS[method.attr](self.program, shape)
        _, *wanted = function.arguments.values()
        if len(node.args) != len(wanted):
            raise self.fail(node, f"{method.attr} with {len(node.args)} arguments")
        codes = [self.number(argument) if shape == DOUBLE else self.fitting(argument, shape)
                 for argument, shape in zip(node.args, wanted)]  # fmt: skip
        return self.calling(function, [owner.text, *(code.text for code in codes)])

    def _changed(self, node: ast.Call, method: ast.Attribute, owner: Code) -> Code:
        """A record with other values of some fields."""
        if not is_dotted_name(method.value) or node.args:
            raise self.fail(node, "_replace of something that has no name, or without names")
        assert isinstance(owner.shape, Structure)
        given = {in_c(str(keyword.arg)): keyword.value for keyword in node.keywords}
        codes = []
        for suffix, part in owner.shape.parts:
            value = given.pop(suffix[1:], None)
            old = Code(f"{owner.text}{suffix}", part)
            codes.append(old if value is None else self.fitting(value, part))
        for name in given:
            raise self.fail(node, f"{name} is not a field of {owner.shape.word}")
        return self.literal(owner.shape, codes)

    def _record(self, node: ast.Call, made: Any) -> Code:
        shape = shape_of(made)
        assert isinstance(shape, Structure)
        wanted = {suffix[1:]: part for suffix, part in shape.parts}
        given = self.elements(node.args, list(wanted.values()))
        if len(given) > len(wanted):
            raise self.fail(node, f"{len(given)} values for {len(wanted)} fields")
        codes = dict(zip(wanted, given))
        for keyword in node.keywords:
            name = in_c(str(keyword.arg))
            if name not in wanted or name in codes:
                raise self.fail(node, f"{keyword.arg} is not a further field of {shape.word}")
            codes[name] = self.fitting(keyword.value, wanted[name])
        for name, value in made._field_defaults.items():
            if in_c(name) not in codes:
                codes[in_c(name)] = self._default(node, made, name, value, wanted[in_c(name)])
        if len(codes) != len(wanted):
            raise self.fail(node, f"{len(codes)} values for {len(wanted)} fields")
        return self.literal(shape, [codes[name] for name in wanted])

    def _default(self, node: ast.AST, made: Any, name: str, value: Any, wanted: Shape) -> Code:
        if not isinstance(wanted, Structure):
            return Code(literal(value, wanted, f"the default value of {name}"), wanted)
        text, shape = self.program.constant(made.__module__, f"{made.__name__}_{name}", value)
        if shape != wanted:
            raise self.fail(node, f"the default value of {name} is {shape.word}")
        return Code(text, wanted)

    def _function(self, node: ast.Call, called: FunctionType) -> Code:
        hints = hints_of(called)
        names = [name for name in hints if name != "return"]
        if called.__code__.co_argcount != len(names):
            raise self.fail(node, f"{ast.unparse(node.func)} is not made by def with types")
        given = self._arguments(node, names)
        if any(has_no_size(hints[name]) for name in names):
            # What has no size of its own has the one that is passed.
            codes = [self.code(argument) for argument in given]
            for argument, code, name in zip(given, codes, names):
                if has_no_size(hints[name]) and not has_only_doubles(code.shape):
                    why = f"{code.shape.word} with other than floats: write them as 1.0"
                    raise self.fail(argument, why)
            function = self.program.function(called, [code.shape for code in codes])
            wanted = list(function.arguments.values())
            texts = [self.fit(*each).text for each in zip(given, codes, wanted)]
        else:
            function = self.program.function(called)
            texts = self._fitted(node, given, list(function.arguments.values()))
        return self.calling(function, texts)

    def _arguments(self, node: ast.Call, names: Sequence[str]) -> list[ast.expr]:
        """The arguments in their order, those with a name after the others."""
        given = {str(keyword.arg): keyword.value for keyword in node.keywords}
        is_starred = any(isinstance(a, ast.Starred) for a in node.args)
        rest = [] if is_starred else names[len(node.args) :]
        too_many = len(node.args) > len(names) and not is_starred
        if too_many or (set(given) != set(rest) and (given or rest)):
            raise self.fail(node, f"arguments other than {', '.join(names)}")
        return [*node.args, *(given[name] for name in rest)]

    def _fitted(
        self, node: ast.Call, given: Sequence[ast.expr], wanted: Sequence[Shape]
    ) -> list[str]:
        codes = self.elements(given, wanted)
        if [code.shape for code in codes] != list(wanted):
            raise self.fail(node, f"arguments that do not match {ast.unparse(node.func)}")
        return [code.text for code in codes]
