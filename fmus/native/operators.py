"""Operators, comparisons and conditions of the language of equations in C."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence

from fmus.native import arrays
from fmus.native.expressions import (
    AND,
    EQUALITY,
    NUMBERS,
    OR,
    POSTFIX,
    PRODUCT,
    RELATION,
    SUM,
    TERNARY,
    UNARY,
    WHOLE,
    Code,
    Expressions,
)
from fmus.native.language import word_of
from fmus.native.program import number_in_c
from fmus.native.shapes import BOOLEAN, DOUBLE, INTEGER, Shape
from fmus.native.variables import is_dotted_name

_BINARY = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
_COMPARE = {
    ast.Lt: ("<", RELATION), ast.LtE: ("<=", RELATION), ast.Gt: (">", RELATION),
    ast.GtE: (">=", RELATION), ast.Eq: ("==", EQUALITY), ast.NotEq: ("!=", EQUALITY),
}  # fmt: skip

#: What has an address in C: a variable, or a member of one.
_STORED = re.compile(r"[\w.]+")

#: Functions of arithmetic.h for operators of integers, which may exceed 32 bits.
_OF_INTEGERS = {ast.Add: "ADD", ast.Sub: "SUB", ast.Mult: "MUL"}

#: Functions of arithmetic.h for operators that may raise, of floats and of integers.
_DIVISIONS = {
    ast.Div: ("DIV", "INT_DIV"),
    ast.FloorDiv: ("FLOORDIV", "INT_FLOORDIV"),
    ast.Mod: ("MOD", "INT_MOD"),
}


class Operators(Expressions):
    """Translates what operators make, and the other expressions of a function."""

    def _binop(self, node: ast.BinOp, wanted: Shape | None) -> Code:
        left = self.code(node.left)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left)
        right = self.code(node.right)
        if arrays.is_array(left.shape) or arrays.is_array(right.shape):
            return self._of_arrays(node, left, right)
        for side, code in ((node.left, left), (node.right, right)):
            if code.shape not in NUMBERS:
                raise self.fail(side, f"{code.shape.word} where a number is wanted")
        is_float = DOUBLE in (left.shape, right.shape)
        if is_float:
            left, right = self.number(node.left, left), self.number(node.right, right)
        if type(node.op) in _DIVISIONS:
            return self._divided(node, left, right, is_float)
        if type(node.op) not in _BINARY:
            raise self.fail(node, f"the operator {word_of(node.op)}")
        sign, binding = _BINARY[type(node.op)]
        if is_float:
            text = f"{left.within(binding)} {sign} {right.within(binding + 1)}"
            return Code(text, DOUBLE, binding)
        self.made.raises = True
        return Code(f"{_OF_INTEGERS[type(node.op)]}({left.argument}, {right.argument})", INTEGER)

    def _divided(self, node: ast.BinOp, left: Code, right: Code, is_float: bool) -> Code:
        of_floats, of_integers = _DIVISIONS[type(node.op)]
        is_quotient = isinstance(node.op, ast.Div)
        if is_float and is_quotient and isinstance(node.right, ast.Constant) and node.right.value:
            return Code(f"{left.within(PRODUCT)} / {right.text}", DOUBLE, PRODUCT)
        self.made.raises = True
        function = of_floats if is_float else of_integers
        shape = DOUBLE if is_float or is_quotient else INTEGER
        return Code(f"{function}({left.argument}, {right.argument})", shape)

    def _power(self, node: ast.BinOp, base: Code) -> Code:
        exponent = self.constant(node.right)
        if exponent is None or not float(exponent).is_integer():
            why = "** with other than a constant whole number: write math.pow(x, y), or sqrt(x)"
            raise self.fail(node, why)
        if base.shape not in NUMBERS:
            raise self.fail(node.left, f"{base.shape.word} where a number is wanted")
        self.made.raises = True
        if base.shape in WHOLE and isinstance(exponent, int) and exponent >= 0:
            return Code(f"INT_POW({base.argument}, {number_in_c(exponent)})", INTEGER)
        number = self.number(node.left, base)
        return Code(f"RAISED({number.argument}, {number_in_c(float(exponent))})", DOUBLE)

    def _of_arrays(self, node: ast.BinOp, left: Code, right: Code) -> Code:
        is_stored = _STORED.fullmatch(left.text) is not None
        operation = arrays.binary(self.program, node.op, left.shape, right.shape, is_stored)
        if operation is None:
            sign = _sign_of(node.op)
            raise self.fail(node, f"{left.shape.word} {sign} {right.shape.word} is not defined")
        operands = [self.number(x, c).text if c.shape in NUMBERS else c.text
                    for x, c in ((node.left, left), (node.right, right))]  # fmt: skip
        if operation.by_address:
            operands[0] = f"&{operands[0]}"
        return self.calling(operation.function, operands[::-1] if operation.swapped else operands)

    def alike(self, left: ast.expr, right: ast.expr) -> tuple[Code, Code]:
        """Two operands of a comparison; whole numbers beside a double become one."""
        one, other = self.code(left), self.code(right)
        if DOUBLE in (one.shape, other.shape):
            return self.number(left, one), self.number(right, other)
        for node, code in ((left, one), (right, other)):
            if code.shape not in NUMBERS:
                raise self.fail(node, f"a comparison of {code.shape.word}")
        return one, other

    def _unaryop(self, node: ast.UnaryOp, wanted: Shape | None) -> Code:
        if isinstance(node.op, ast.Not):
            operand = self.condition(node.operand)
            if operand.text.endswith(" != 0.0") and operand.binding == EQUALITY:
                return Code(f"{operand.text[:-7]} == 0.0", BOOLEAN, EQUALITY)
            return Code(f"!{operand.within(UNARY)}", BOOLEAN, UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.fail(node, f"the operator {word_of(node.op)}")
        if isinstance(node.operand, ast.Constant) and type(node.operand.value) is int:
            return Code(number_in_c(-node.operand.value), INTEGER, UNARY)
        operand = self.code(node.operand)
        if arrays.is_array(operand.shape):
            return self.calling(arrays.negative(self.program, operand.shape), [operand.text])
        if operand.shape in WHOLE:
            self.made.raises = True
            return Code(f"NEG({operand.argument})", INTEGER)
        if operand.shape not in NUMBERS:
            raise self.fail(node, f"{operand.shape.word} where a number is wanted")
        return Code(f"-{operand.within(POSTFIX)}", DOUBLE, UNARY)

    def condition(self, node: ast.expr) -> Code:
        """An expression as a truth value."""
        if isinstance(node, ast.BoolOp):
            return self._joined(node, [self.condition(value) for value in node.values])
        code = self.code(node)
        if code.shape == DOUBLE:
            return Code(f"{code.within(RELATION)} != 0.0", BOOLEAN, EQUALITY)
        if code.shape not in WHOLE:
            raise self.fail(node, f"{code.shape.word} as a condition")
        return code

    def _boolop(self, node: ast.BoolOp, wanted: Shape | None) -> Code:
        codes = [self.code(value) for value in node.values]
        for value, code in zip(node.values, codes):
            if code.shape != BOOLEAN:
                word = code.shape.word
                raise self.fail(value, f"{word} before or after and, or: write a comparison")
        return self._joined(node, codes)

    @staticmethod
    def _joined(node: ast.BoolOp, codes: Sequence[Code]) -> Code:
        sign, binding = ("||", OR) if isinstance(node.op, ast.Or) else ("&&", AND)
        # Compilers want brackets around one kind of them within the other.
        return Code(f" {sign} ".join(code.within(EQUALITY) for code in codes), BOOLEAN, binding)

    def _compare(self, node: ast.Compare, wanted: Shape | None) -> Code:
        operands = [node.left, *node.comparators]
        if not all(map(is_dotted_name, operands[1:-1])):
            raise self.fail(node, "what stands between two comparisons must be a name")
        parts = []
        for operator, left, right in zip(node.ops, operands, operands[1:]):
            if type(operator) not in _COMPARE:
                raise self.fail(node, "a comparison other than of size")
            sign, binding = _COMPARE[type(operator)]
            one, other = self.alike(left, right)
            text = f"{one.within(binding + 1)} {sign} {other.within(binding + 1)}"
            parts.append(Code(text, BOOLEAN, binding))
        if len(parts) == 1:
            return parts[0]
        return Code(" && ".join(part.text for part in parts), BOOLEAN, AND)

    def _ifexp(self, node: ast.IfExp, wanted: Shape | None) -> Code:
        condition = self.condition(node.test).within(OR)
        one, other = self.code(node.body, wanted), self.code(node.orelse, wanted)
        if other.shape == DOUBLE:
            one = self.fit(node.body, one, DOUBLE)
        other = self.fit(node.orelse, other, one.shape)
        text = f"{condition} ? {one.within(OR)} : {other.text}"
        return Code(text, one.shape, TERNARY)


def _sign_of(operator: ast.operator) -> str:
    return ast.unparse(ast.BinOp(ast.Name("a"), operator, ast.Name("b")))[2:-2]
