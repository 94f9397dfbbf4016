"""An extension of griffe that shows the arguments which a decorator gives to a function."""

from __future__ import annotations

import ast
import re
from importlib import import_module
from inspect import Parameter, cleandoc, formatannotation, signature
from typing import Any

import griffe

#: The decorator, :func:`orchestrator.runs.request.takes_keywords`.
_DECORATOR = "takes_keywords"

_PREFIX = re.compile(r"\b(?:[a-z_]+\.)+(?=[A-Z])")


class Signatures(griffe.Extension):
    """Take signature and docstring of decorated functions from the imported module."""

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Replace signature and docstring from the source."""
        if func.docstring is None or not any(_DECORATOR in str(d.value) for d in func.decorators):
            return
        function = getattr(import_module(func.module.path), func.name)
        func.docstring.value = cleandoc(function.__doc__)
        func.parameters = griffe.Parameters(
            *(_parameter(parameter, func) for parameter in signature(function).parameters.values())
        )


def _parameter(parameter: Parameter, func: griffe.Function) -> griffe.Parameter:
    text = _PREFIX.sub("", formatannotation(parameter.annotation)).replace("NoneType", "None")
    annotation = griffe.safe_get_annotation(ast.parse(text, mode="eval").body, parent=func.module)
    return griffe.Parameter(
        parameter.name,
        annotation=annotation,
        kind=griffe.ParameterKind(parameter.kind.description),
        default=None if parameter.default is parameter.empty else repr(parameter.default),
    )
