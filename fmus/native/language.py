"""The language of equations: the part of Python that every kind of FMU can run.

`docs/explanation/language.md` describes it for readers; this module finds code outside it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from operator import itemgetter
from pathlib import Path

import auv_fmu

#: Functions of `math` that equations may use.
MATHEMATICS = frozenset(
    (
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "ceil", "copysign", "cos",
        "cosh", "degrees", "exp", "expm1", "fabs", "floor", "fmod", "isfinite", "isinf", "isnan",
        "log", "log10", "log1p", "log2", "pow", "radians", "sin", "sinh", "sqrt", "tan", "tanh",
        "trunc",
    )
)  # fmt: skip

#: Its constants.
CONSTANTS = frozenset(("e", "inf", "nan", "pi", "tau"))

#: What else may be called without being imported.
BUILT_IN = frozenset(
    (
        "abs", "bool", "enumerate", "float", "int", "len", "max", "min", "range", "round", "tuple",
        "zip", "ArithmeticError", "OverflowError", "ValueError", "ZeroDivisionError",
    )
)  # fmt: skip

#: Functions and classes that stand among the equations and are none, with the reason.
OUTSIDE = {
    "plant.white_noise": "makes the generator of the standard library that has the state",
    "euler.internal_steps": "makes an integer; the runtime in C has a twin, which looks first",
    "closed_loop.blocks_of": "selects functions by the types of parameters, before a run",
    "closed_loop.closed_loop": "is the generator of instants that all else is checked against",
}

#: Where these stand: a user's module may have the same name.
_EQUATIONS = Path(str(auv_fmu.__file__)).resolve().parent

#: What readers call the parts of a program, by the names that Python's syntax tree has for them.
_WORDS = {
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

#: What to write instead of what is outside the language.
INSTEAD = {
    ":=": "write the assignment on a line of its own",
    "** with other than a whole constant": "write math.pow(x, y), or sqrt(x)",
    "a comparison other than of size": "write == or <, or an or of them",
    "a dict": "use a NamedTuple",
    "a dict with a for": "use a NamedTuple",
    "a line that does nothing": "leave it out",
    "a list": "write a tuple, or Vector((...))",
    "a list with a for": "write Vector(... for ...)",
    "a raise without a text": 'write raise Refusal("...")',
    "a set": "write a tuple",
    "a set with a for": "write Vector(... for ...)",
    "a value of _": "give it a name: _ is for what is not used",
    "a variable without a value": "give it a value",
    "a while that changes nothing in its condition": "write for _ in range(most): and break",
    "all of an expression with a for": "write a loop with break",
    "an argument _": "give it a name: _ is for what is not used",
    "an assignment to a field": "write x = x._replace(field=...)",
    "an assignment to a star": "write w = v[1:]",
    "an assignment to an element": "write v = v.replaced(k, x)",
    "an assignment to an element of a matrix": "write A = A.replaced(i, A[i].replaced(j, x))",
    "an expression with a for": "write it in Vector(...), Matrix(...) or tuple(...)",
    "an f-string": 'texts are for raise Refusal(f"...") only',
    "any of an expression with a for": "write a loop with break",
    "assert": 'write if not ...: raise Refusal("...")',
    "async def": "write def",
    "del": "leave it out",
    "global": "keep it in State",
    "if at the level of the module": "put what is no equation into a file of its own",
    "import": "import at the top of the file",
    "lambda": "write def",
    "match": "write if and elif",
    "max of an expression with a for": "write max(Vector(... for ...))",
    "min of an expression with a for": "write min(Vector(... for ...))",
    "more names than one for a value": "write one assignment a line",
    "a name twice in one assignment": "use _ for what is not needed",
    "nonlocal": "return the value",
    "sum of an expression with a for": "write Vector(... for ...).sum()",
    "the name all": "write a loop with break, or an and",
    "the name any": "write a loop with break, or an or",
    "the name dict": "use a NamedTuple",
    "the name divmod": "write // and %",
    "the name hypot": "write sqrt(x * x + y * y): Python's hypot has an algorithm of its own",
    "the name list": "use a Vector or a tuple",
    "the name np": "use Vector and Matrix of auv_fmu",
    "the name numpy": "use Vector and Matrix of auv_fmu",
    "the name pow": "write math.pow",
    "the name print": "use a debugger, or an output",
    "the name random": "use the hooks seed and measured",
    "the name reversed": "write range(n - 1, -1, -1)",
    "the name sorted": "use min, max or a loop",
    "the name str": 'texts are for raise Refusal(f"...") only',
    "the name sum": "write v.sum() of a Vector: Python's sum rounds differently from 3.12 on",
    "the operator &": "write and, or arithmetic such as k % 8",
    "the operator +": "leave it out",
    "the operator <<": "write a product",
    "the operator >>": "write // of a power of two",
    "the operator ^": "write !=, or arithmetic",
    "the operator |": "write or, or arithmetic",
    "try": "test before: if x <= 0.0",
    "with": "files and locks are for plain PythonFMU",
}

#: Packages whose functions, tuples and constants equations share.
_PACKAGES = frozenset(("auv_fmu", "fmus"))

_BASES = frozenset(("NamedTuple", "ArithmeticError", "IntEnum"))
_OPERATORS = (
    ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod, ast.Pow, ast.MatMult, ast.USub,
    ast.Not,
)  # fmt: skip
_COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
_CONSTANTS = (float, int, bool)
_MODULE_LEVEL = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign)

#: What may take an expression with a for, or a list.
_COLLECTIONS = frozenset(("Matrix", "Vector", "tuple"))

#: What is often made of an expression with a for, and may not take one here.
_REDUCTIONS = frozenset(("all", "any", "max", "min", "sum"))

#: Conditions that are false when a module is imported.
_NEVER_RUN = ("__name__ == '__main__'", "TYPE_CHECKING", "typing.TYPE_CHECKING")


def foreign(path: Path) -> list[str]:
    """What is outside the language in a module: one line each that an editor can jump to."""
    try:
        tree = ast.parse(path.read_bytes())
    except SyntaxError as error:
        return [f"{path}:{error.lineno}: {error.msg}"]
    _drop_aliases(tree)
    return [
        f"{path}:{line}: {what} is not in the language of equations{_advice(what)}"
        for line, what in sorted(_module(tree, path), key=itemgetter(0))
    ]


def _advice(what: str) -> str:
    if what.startswith("the module "):
        return f"; write from {what.rsplit(maxsplit=1)[-1]} import ..."
    known = what.replace("the name math.", "the name ")
    return f"; {INSTEAD[known]}" if known in INSTEAD else ""


def word_of(node: ast.AST) -> str:
    """What readers call a part of a program."""
    name = type(node).__name__
    return _WORDS.get(name, name)


def _drop_aliases(tree: ast.Module) -> None:
    """Call Vector and Matrix by their names where they were imported by others."""
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    names = {
        alias.asname: alias.name
        for node in imports
        for alias in node.names
        if alias.asname and alias.name in _COLLECTIONS
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            node.id = names.get(node.id, node.id)


_Found = Iterator["tuple[int, str]"]


def _module(tree: ast.Module, path: Path) -> _Found:
    known = set(_known(tree, path))
    modules = dict(_modules(tree, path))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            is_ours = _EQUATIONS in path.resolve().parents
            if not (is_ours and f"{path.stem}.{node.name}" in OUTSIDE):
                yield from _function(node)
                yield from _names(node, known, modules)
        elif isinstance(node, ast.ClassDef):
            yield from _class(node)
        elif not (isinstance(node, _MODULE_LEVEL) or is_text(node) or _never_runs(node)):
            yield node.lineno, f"{word_of(node)} at the level of the module"


def _never_runs(node: ast.stmt) -> bool:
    """Whether a statement of a module does nothing when the module is imported."""
    is_if = isinstance(node, ast.If) and not node.orelse
    return is_if and ast.unparse(node.test) in _NEVER_RUN  # type: ignore[attr-defined]


def _class(node: ast.ClassDef) -> _Found:
    bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
    if len(bases) != 1 or bases[0] not in _BASES or node.decorator_list:
        yield node.lineno, f"the class {node.name}"
    wanted = ast.Assign if bases == ["IntEnum"] else ast.AnnAssign
    for part in node.body:
        if not isinstance(part, wanted) and not is_text(part):
            yield part.lineno, f"{word_of(part)} in the class {node.name}"


def _known(tree: ast.Module, path: Path) -> Iterator[str]:
    """Names that a module's functions may use."""
    yield from BUILT_IN
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = [n for target in targets for n in ast.walk(target)]
            yield from (name.id for name in names if isinstance(name, ast.Name))
        elif isinstance(node, ast.Import):
            yield from ("math" for alias in node.names if alias.name == "math")
        elif isinstance(node, ast.ImportFrom):
            names_in = {alias.name: alias.asname or alias.name for alias in node.names}
            package = str(node.module).split(".")[0]
            if node.module == "math":
                allowed = MATHEMATICS | CONSTANTS
                yield from (own for name, own in names_in.items() if name in allowed)
            elif package in _PACKAGES or _lies_beside(path, package):
                yield from (own if name not in _COLLECTIONS else name
                            for name, own in names_in.items())  # fmt: skip


def _modules(tree: ast.Module, path: Path) -> Iterator[tuple[str, str]]:
    """Names here of whole modules, from which functions must be imported one by one."""
    for node in tree.body:
        for alias in node.names if isinstance(node, ast.Import) else ():
            package = alias.name.split(".")[0]
            if package in (*_PACKAGES, "math") or _lies_beside(path, package):
                yield alias.asname or package, alias.name


def _lies_beside(path: Path, module: str) -> bool:
    return path.with_name(f"{module}.py").is_file() or path.with_name(module).is_dir()


def _names(function: ast.FunctionDef, known: set[str], modules: Mapping[str, str]) -> _Found:
    local = set(known)
    used: list[ast.Name] = []
    for node in ast.walk(function):
        if isinstance(node, ast.FunctionDef):
            local |= {node.name, *(argument.arg for argument in node.args.args)}
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            local.add(node.id)
    for statement in function.body:
        used += _used(statement)
    for name in used:
        if name.id == "_" and isinstance(name.ctx, ast.Load):
            yield name.lineno, "a value of _"
        elif name.id not in local:
            module = modules.get(name.id)
            yield name.lineno, f"the module {module}" if module else f"the name {name.id}"


def _used(node: ast.AST) -> Iterator[ast.Name]:
    """Names in code, but not in annotations."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns"):
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.Name):
                yield part
            if isinstance(part, ast.AST):
                yield from _used(part)


def _function(node: ast.FunctionDef) -> _Found:
    given = node.args
    special = given.posonlyargs or given.kwonlyargs or given.vararg or given.kwarg
    if special or given.defaults or node.decorator_list:
        yield node.lineno, f"more than plain arguments of {node.name}"
    if any(argument.arg == "_" for argument in given.args):
        yield node.lineno, "an argument _"
    if node.returns is None or any(a.annotation is None for a in given.args):
        yield node.lineno, f"an argument or a result of {node.name} without a type"
    yield from _block(node.body)


def _block(statements: list[ast.stmt]) -> _Found:
    for node in statements:
        if isinstance(node, ast.Return):
            yield from _expression(node.value) if node.value is not None else ()
        elif isinstance(node, ast.Assign):
            if len(node.targets) != 1:
                yield node.lineno, "more names than one for a value"
            yield from _target(node.targets[0])
            yield from _expression(node.value)
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            yield from _target(node.target)
            yield from _expression(node.value)
        elif isinstance(node, ast.AugAssign):
            yield from _target(node.target)
            yield from _expression(ast.BinOp(node.target, node.op, node.value, lineno=node.lineno))
        elif isinstance(node, (ast.If, ast.While, ast.For, ast.FunctionDef)):
            yield from _compound(node)
        elif isinstance(node, ast.Raise):
            yield from _raised(node)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            yield from _expression(node.value)
        elif not isinstance(node, (ast.Break, ast.Continue, ast.Pass)) and not is_text(node):
            yield node.lineno, word_of(node)


def _compound(node: ast.If | ast.While | ast.For | ast.FunctionDef) -> _Found:
    if isinstance(node, ast.FunctionDef):
        yield from _function(node)
        return
    if isinstance(node, ast.For):
        yield from _target(node.target)
        yield from _expression(node.iter)
    else:
        yield from _expression(node.test)
    if isinstance(node, ast.While):
        names = {n.id for n in ast.walk(node.test) if isinstance(n, ast.Name)}
        inside = [n for statement in node.body for n in ast.walk(statement)]
        stored = {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        if not names & stored:
            yield node.lineno, "a while that changes nothing in its condition"
    if node.orelse and not isinstance(node, ast.If):
        yield node.orelse[0].lineno, f"else of a {word_of(node)}"
    yield from _block([*node.body, *node.orelse])


def _target(node: ast.expr) -> _Found:
    if isinstance(node, ast.Tuple):
        names = [n.id for n in ast.walk(node) if isinstance(n, ast.Name) and n.id != "_"]
        if len(names) != len(set(names)):
            yield node.lineno, "a name twice in one assignment"
        for element in node.elts:
            yield from _target(element)
    elif not isinstance(node, ast.Name):
        is_of_matrix = isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple)
        what = f"{word_of(node)} of a matrix" if is_of_matrix else word_of(node)
        yield node.lineno, f"an assignment to {what}"


def _raised(node: ast.Raise) -> _Found:
    call = node.exc
    if not isinstance(call, ast.Call) or len(call.args) != 1 or node.cause is not None:
        yield node.lineno, "a raise without a text"
        return
    text = call.args[0]
    if isinstance(text, ast.JoinedStr):
        for part in text.values:
            if isinstance(part, ast.FormattedValue):
                yield from _expression(part.value)
    elif not (isinstance(text, ast.Constant) and isinstance(text.value, str)):
        yield node.lineno, "a raise without a text"


#: What expressions consist of.
_EXPRESSIONS = (
    ast.Constant, ast.Name, ast.BinOp, ast.UnaryOp, ast.BoolOp, ast.Compare, ast.IfExp, ast.Tuple,
    ast.Attribute, ast.Starred, ast.Subscript, ast.Slice, ast.Call,
)  # fmt: skip


def _expression(node: ast.expr) -> _Found:
    wrong = _wrong(node) if isinstance(node, _EXPRESSIONS) else word_of(node)
    if wrong:
        yield node.lineno, wrong
    for part in _parts(node):
        if isinstance(part, ast.expr) and isinstance(node, _EXPRESSIONS):
            yield from _expression(part)


def _parts(node: ast.expr) -> Iterator[ast.AST]:
    """The expressions that an expression consists of."""
    if not isinstance(node, ast.Call):
        yield from ast.iter_child_nodes(node)
        return
    yield node.func
    called = ast.unparse(node.func).rpartition(".")[2]
    for part in (*node.args, *(keyword.value for keyword in node.keywords)):
        if called in _COLLECTIONS and isinstance(part, ast.GeneratorExp):
            yield from _comprehension(part)
        elif called in _COLLECTIONS:
            yield from _items(part)
        else:
            yield part


def _items(node: ast.expr) -> Iterator[ast.AST]:
    """The elements of a list, in which each may be one, or of a tuple of lists."""
    if not isinstance(node, (ast.List, ast.Tuple)):
        yield node
        return
    for element in node.elts:
        yield from _items(element) if isinstance(element, ast.List) else [element]


def _comprehension(node: ast.GeneratorExp) -> Iterator[ast.AST]:
    yield from (generator.iter for generator in node.generators)
    if isinstance(node.elt, ast.GeneratorExp):
        yield from _comprehension(node.elt)
    else:
        yield node.elt


def _wrong(node: ast.expr) -> str | None:
    """What is wrong with an expression, apart from its parts."""
    wrong = None
    if isinstance(node, ast.Constant) and type(node.value) not in (*_CONSTANTS, str):
        wrong = f"the constant {node.value!r}"
    elif isinstance(node, (ast.BinOp, ast.UnaryOp)) and not isinstance(node.op, _OPERATORS):
        wrong = f"the operator {word_of(node.op)}"
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and _is_broken(node.right):
        wrong = "** with other than a whole constant"
    elif isinstance(node, ast.Compare) and not all(isinstance(o, _COMPARISONS) for o in node.ops):
        wrong = "a comparison other than of size"
    elif isinstance(node, ast.Call) and any(keyword.arg is None for keyword in node.keywords):
        wrong = "a call with **"
    elif isinstance(node, ast.Call) and _reduces(node):
        wrong = f"{ast.unparse(node.func)} of an expression with a for"
    elif _is_of_math(node):
        wrong = f"the name {ast.unparse(node)}"
    return wrong


def _is_of_math(node: ast.expr) -> bool:
    """Whether a name is one of `math` that equations may not use."""
    is_of_it = isinstance(node, ast.Attribute) and ast.unparse(node.value) == "math"
    return is_of_it and ast.unparse(node)[5:] not in MATHEMATICS | CONSTANTS


def _reduces(node: ast.Call) -> bool:
    """Whether a call is such as `sum(x for x in v)`."""
    takes_for = any(isinstance(one, (ast.GeneratorExp, ast.ListComp)) for one in node.args)
    return takes_for and ast.unparse(node.func) in _REDUCTIONS


def _is_broken(exponent: ast.expr) -> bool:
    """Whether an exponent that is written out is no whole number."""
    try:
        value = ast.literal_eval(exponent)
    except ValueError:
        return False
    return not isinstance(value, int) and not (isinstance(value, float) and value.is_integer())


def is_text(node: ast.stmt) -> bool:
    """Whether a statement is a text, as docstrings are."""
    value = node.value if isinstance(node, ast.Expr) else None
    return isinstance(value, ast.Constant) and isinstance(value.value, str)
