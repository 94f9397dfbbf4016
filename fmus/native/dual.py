"""Trees in C for dual numbers: the same functions, which also give derivatives."""

from __future__ import annotations

from collections.abc import Iterable

from fmus.language import tree
from fmus.language.mathematics import FUNCTIONS
from fmus.language.tree import Expression, Function, Number, Operation, Operator
from fmus.language.types import FLOAT, Scalar, Type
from fmus.native.emit import POSTFIX, TERNARY, Definition, Emitter, call, number_in_c
from fmus.native.pieces import function

#: Functions of dual.h.
_CALLED: dict[Operator, str] = {
    tree.ADD: "dual_add", tree.SUBTRACT: "dual_sub", tree.MULTIPLY: "dual_mul",
    tree.OVER: "dual_over", tree.NEGATIVE: "dual_neg", tree.DIVIDE: "dual_div",
    tree.FLOOR_DIVIDE: "dual_floordiv", tree.MODULO: "dual_mod", tree.POWER: "dual_pow_whole",
    tree.NEAREST: "dual_nearest", tree.MIN: "dual_smaller", tree.MAX: "dual_larger",
}  # fmt: skip


class DualEmitter(Emitter):
    """Functions of dual numbers in C, beside the functions of floats."""

    real, explains = "Dual", False

    def __init__(self, functions: Iterable[Function], beside: Emitter) -> None:
        """Choose names that the emitter of the functions of floats has not chosen."""
        super().__init__(functions, taken=beside.taken | {f"dual_{name}" for name in FUNCTIONS})

    def unused(self, name: str) -> str:
        """Return a name that no other structure, function or constant has."""
        return super().unused(f"Dual{name}" if name[0].isupper() else f"dual_{name}")

    def is_number(self, type_: Type) -> bool:
        """Return True for a number of C."""
        return type_ != FLOAT and super().is_number(type_)

    def numeral(self, value: float, type_: Scalar) -> str:
        """Return the initializer of a number."""
        text = number_in_c(value)
        return f"{{{text}, 0.0}}" if type_ == FLOAT else text

    def wrap(self, name: str) -> None:
        """Define a function of `math` with its derivative."""
        about = FUNCTIONS[name]
        names = ("x", "y")[: about.arguments]
        value = call(f"math_{name}" if about.raises else name, names, bool(about.raises))
        parts = [
            f"dual_chain({slope}, d{argument}.d)" for argument, slope in zip(names, about.slopes)
        ]
        given = [f"Dual d{argument}" for argument in names] + ["Error *error"] * bool(about.raises)
        head = f"static inline {self.real} dual_{name}({', '.join(given)})"
        numbers = ", ".join(f"{argument} = d{argument}.v" for argument in names)
        result = f"return (Dual){{z, {' + '.join(parts) or '0.0'}}};"
        self._wrappers[name] = function(head, [f"const double {numbers}, z = {value};", result], ())

    def _defined(self, function: Function) -> str:
        return _Definition(self, function).text()


class _Definition(Definition):
    """The translation of one function for dual numbers."""

    def number(self, expression: Expression, within: int = TERNARY) -> str:
        """Return a number that is not differentiated, in brackets if necessary."""
        if expression.type == FLOAT:
            return f"{self.expression(expression, POSTFIX)}.v"
        return super().number(expression, within)

    def bound(self, expression: Expression) -> tuple[str, int]:
        """Return an expression and the precedence of its outermost operator."""
        text, binding = super().bound(expression)
        if isinstance(expression, Number) and expression.type == FLOAT:
            return f"dual_fixed({text})", POSTFIX
        return text, binding

    def operation(self, operation: Operation) -> tuple[str, int]:
        """Return an operation and its precedence; operations of ints are as for floats."""
        op = operation.operator
        named = "fabs" if op == tree.ABS else op.function
        if op in _CALLED or (named and operation.type == FLOAT):
            if named:
                self._emitter.wrap(named)
            name = _CALLED.get(op, f"dual_{named}")
            return call(name, map(self.expression, operation.parts), op.fails), POSTFIX
        text, binding = super().operation(operation)
        return (f"dual_fixed({text})", POSTFIX) if operation.type == FLOAT else (text, binding)
