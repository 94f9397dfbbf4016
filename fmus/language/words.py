"""Names of Python's constructs in messages, and advice on replacing some of them."""

from __future__ import annotations

import ast
from collections.abc import Mapping

#: Names by the classes of Python's syntax tree.
_WORDS: Mapping[str, str] = {
    "AnnAssign": "a variable without a value",
    "Assert": "assert",
    "AsyncFor": "async for",
    "AsyncFunctionDef": "async def",
    "AsyncWith": "async with",
    "Attribute": "a field",
    "AugAssign": "a changed variable",
    "Await": "await",
    "BitAnd": "&",
    "BitOr": "|",
    "BitXor": "^",
    "ClassDef": "a class",
    "Delete": "del",
    "Dict": "a dict",
    "DictComp": "a dict with a for",
    "Expr": "a line that does nothing",
    "For": "for",
    "FunctionDef": "def",
    "GeneratorExp": "an expression with a for",
    "Global": "global",
    "If": "if",
    "Import": "import",
    "ImportFrom": "import",
    "Invert": "~",
    "JoinedStr": "an f-string",
    "Lambda": "lambda",
    "List": "a list",
    "ListComp": "a list with a for",
    "LShift": "<<",
    "MatMult": "@",
    "Match": "match",
    "NamedExpr": ":=",
    "Nonlocal": "nonlocal",
    "RShift": ">>",
    "Set": "a set",
    "SetComp": "a set with a for",
    "Slice": "a slice",
    "Starred": "a star",
    "Subscript": "an element",
    "TemplateStr": "a t-string",
    "Try": "try",
    "TryStar": "try",
    "TypeAlias": "type",
    "UAdd": "+",
    "While": "while",
    "With": "with",
    "Yield": "yield",
    "YieldFrom": "yield from",
}

#: Advice for constructs outside the language.
INSTEAD: Mapping[str, str] = {
    "** with other than a whole constant": "write math.pow(x, y), or sqrt(x)",
    ":=": "write the assignment on a line of its own",
    "a comparison other than of size": "write == or <, or an or of them",
    "a dict with a for": "use a NamedTuple",
    "a dict": "use a NamedTuple",
    "a line that does nothing": "leave it out",
    "a list with a for": "write Vector(... for ...)",
    "a list": "write a tuple, or Vector((...))",
    "a name twice in one assignment": "use _ for what is not needed",
    "a raise with from": "leave from out",
    "a raise without a text": 'write raise Refusal("...")',
    "a set with a for": "write Vector(... for ...)",
    "a set": "write a tuple",
    "a value of _": "give it a name: _ is for what is not used",
    "a variable without a value": "give it a value",
    "a while that changes nothing in its condition": "write for _ in range(most): and break",
    "all of a list": "leave its brackets out",
    "an argument _": "give it a name: _ is for what is not used",
    "an assignment to a field": "write x = x._replace(field=...)",
    "an assignment to a star": "write w = v[1:]",
    "an assignment to an element of a matrix": "write A = A.replaced(i, A[i].replaced(j, x))",
    "an assignment to an element": "write v = v.replaced(k, x)",
    "an expression with a for": "write it in Vector(...), Matrix(...) or tuple(...)",
    "an f-string": 'texts are for raise Refusal(f"...") only',
    "any of a list": "leave its brackets out",
    "async def": "write def",
    "del": "leave it out",
    "global": "keep it in State",
    "import": "import at the top of the file",
    "lambda": "write def",
    "max of a list": "leave its brackets out",
    "min of a list": "leave its brackets out",
    "nonlocal": "return the value",
    "sum of a list": "leave its brackets out",
    "sum of floats": "write Vector(... for ...).sum(): Python's sum rounds otherwise from 3.12 on",
    "the name all": "write all(... for ...), or an and",
    "the name any": "write any(... for ...), or an or",
    "the name dict": "use a NamedTuple",
    "the name divmod": "write // and %",
    "the name hypot": "write sqrt(x * x + y * y): Python's hypot has an algorithm of its own",
    "the name list": "use a Vector or a tuple",
    "the name np": "use Vector and Matrix of auv_fmu",
    "the name numpy": "use Vector and Matrix of auv_fmu",
    "the name pow": "write math.pow",
    "the name print": "use a debugger, or an output",
    "the name random": "use the hooks seed and measured",
    "the name sorted": "use min, max or a loop",
    "the name str": 'texts are for raise Refusal(f"...") only',
    "the name sum": "write v.sum() of a Vector: Python's sum rounds differently from 3.12 on",
    "the operator &": "write and, or arithmetic such as k % 8",
    "the operator <<": "write a product",
    "the operator >>": "write // of a power of two",
    "the operator ^": "write !=, or arithmetic",
    "the operator |": "write or, or arithmetic",
    "try": "test before: if x <= 0.0",
    "with": "files and locks are for plain PythonFMU",
}


def word_of(node: ast.AST) -> str:
    """Return the name of a construct."""
    name = type(node).__name__
    return _WORDS.get(name, name)


def advice(what: str) -> str:
    """Return advice on replacing a construct, as the end of a message, or an empty text."""
    known = what.replace("the name math.", "the name ")
    return f"; {INSTEAD[known]}" if known in INSTEAD else ""
