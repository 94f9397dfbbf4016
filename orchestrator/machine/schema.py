"""Schemas of TOML files: types and meanings of entries, and messages about wrong ones.

A table is a pydantic model, from which `tools/pages.py` writes pages and JSON schemas for editors.
Pydantic is slow to import, so modules with schemas are imported when there is a file to read.
"""

from __future__ import annotations

import builtins
import re
import types
import typing
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from orchestrator.machine.errors import Findings, did_you_mean, shortened

#: A text that is a name; messages and pages call it so.
Name = Annotated[str, "name"]
Names = Name | list[Name]

#: Types in words.
_WORDS = {str: "text", int: "whole number", float: "number", bool: "true or false", Any: "value"}


class OneOf(NamedTuple):
    """Metadata of a text that must be one of some names."""

    names: Sequence[str]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Return the schema by which pydantic validates a value."""
        return core_schema.literal_schema(list(self.names))


class TomlTable(BaseModel):
    """A table that accepts only its own entries, without converting their values."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    #: Schema of tables in it that have any name.
    named: ClassVar[type[TomlTable] | None] = None

    @classmethod
    def check(cls, where: object, content: Mapping[str, Any]) -> None:
        """Check that a table conforms to this schema; messages begin with its place.

        Raises:
            Refused: it does not; with all problems.

        """
        findings = Findings()
        try:
            cls.model_validate(content)
        except ValidationError as error:
            for text in _problems(cls, content, error.errors(include_url=False)):
                findings.problem(f"{where}: {text}")
        for name in _stated_twice(content):
            findings.problem(f"{where}: {name} is stated twice")
        findings.refuse()


def entry(meaning: str, default: str = "", *, key: str | None = None) -> Any:
    """Declare an entry that may be left out.

    Args:
        meaning: its description, in Markdown.
        default: its default, in words.
        key: its key in the file, if that is a keyword of Python.

    """
    return Field(None, alias=key, description=meaning, json_schema_extra={"without": default})


def needed(meaning: str, example: str, *, key: str | None = None) -> Any:
    """Declare a required entry, with an example in TOML for messages."""
    return Field(alias=key, description=meaning, json_schema_extra={"example": example})


class Entry(NamedTuple):
    """Description of an entry.

    Attributes:
        type: its type, in words.
        meaning: its description.
        default: its default, in words.

    """

    type: str
    meaning: str
    default: str


def entries(table: type[TomlTable]) -> dict[str, Entry]:
    """Return the entries of a table by their keys, in the order of declaration."""
    return {
        key: Entry(
            _type_in_words(field.annotation, field.metadata),
            field.description or "",
            _extra(field, "without"),
        )
        for key, field in _fields(table).items()
    }


def _fields(table: type[TomlTable]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in table.model_fields.items()}


def _extra(field: FieldInfo, name: str) -> str:
    extra = field.json_schema_extra
    return str(extra.get(name, "")) if isinstance(extra, dict) else ""


def _type_in_words(annotation: Any, metadata: Sequence[Any] = ()) -> str:
    """Describe a type in words."""
    for item in metadata:
        if isinstance(item, str):
            return item
        if isinstance(item, OneOf):
            *others, last = (f"`{name}`" for name in item.names)
            return f"{', '.join(others)} or {last}"
    arguments = get_args(annotation)
    match get_origin(annotation):
        case typing.Annotated:
            words = _type_in_words(arguments[0], arguments[1:])
        case typing.Union | types.UnionType:
            words = ", or ".join(map(_type_in_words, arguments))
        case typing.Literal:
            words = str(arguments[0]).lower()
        case builtins.list:
            words = f"list of {_type_in_words(arguments[0])}s"
        case builtins.dict:
            noun, *others = _type_in_words(arguments[1]).split(", ")
            words = ", ".join([f"table of {noun}s", *others])
        case _:
            words = _WORDS.get(annotation, "table")
    limits = [getattr(item, end) for end in ("ge", "le") for item in metadata if hasattr(item, end)]
    return f"{words} from {limits[0]} to {limits[1]:,}" if limits else words


def _table_in(annotation: Any) -> type[TomlTable] | None:
    """Return the schema of the tables in an entry, if its type allows tables."""
    if isinstance(annotation, type) and issubclass(annotation, TomlTable):
        return annotation
    return next(filter(None, map(_table_in, get_args(annotation))), None)


class _Place(NamedTuple):
    """The innermost table with an error, its path, and the entry; None for the whole table."""

    table: type[TomlTable]
    path: tuple[str | int, ...]
    key: str | None


def _place(table: type[TomlTable], error: ErrorDetails) -> _Place:
    """Locate an error: pydantic's location also has members of unions, and parts of values."""
    path: tuple[str | int, ...] = ()
    parts = list(error["loc"])
    is_rule = error["type"] == "value_error"
    while parts:
        key = str(parts.pop(0))
        annotation = _fields(table)[key].annotation if key in _fields(table) else table.named
        inner = _table_in(annotation)
        step: tuple[str | int, ...] = (key,)
        if inner is not None and annotation is not inner and parts:
            member = parts.pop(0)
            if str(member).startswith("list[") and parts:
                member = parts.pop(0)
            if isinstance(member, int):
                step = (key, member)
            elif member != inner.__name__:
                inner = None
        # A rule applies to a whole table, every other check to an entry of the table around it.
        if inner is None or not (parts or is_rule):
            return _Place(table, path, key)
        table, path = inner, (*path, *step)
    return _Place(table, path, None)


def _problems(
    table: type[TomlTable], content: Mapping[str, Any], errors: Sequence[ErrorDetails]
) -> Iterator[str]:
    """Yield the problems, one for each entry."""
    places = {_place(table, error): error for error in errors}
    missing: dict[_Place, list[str]] = {}
    for place, error in places.items():
        inner, path, key = place
        if key is None:
            yield _where(path) + str(error["ctx"]["error"])
        elif error["type"] == "invalid_key":
            yield f"{_where(path)}{key}: write names of entries as texts"
        elif error["type"] == "missing":
            missing.setdefault(place._replace(key=None), []).append(key)
        # If a value may be a table and is one, an error inside it is more specific.
        elif not any(other.path[: len(path) + 1] == (*path, key) for other in places):
            yield _where(path) + _problem(inner, key, _at(content, (*path, key)))
    for (inner, path, _), keys in missing.items():
        written = (f"{key} = {_extra(_fields(inner)[key], 'example')}" for key in keys)
        yield f"{_where(path)}lacks {' and '.join(keys)}; write {', '.join(written)}"


def _stated_twice(content: Mapping[str, Any]) -> Iterator[str]:
    """Yield names that a table contains both quoted and dotted, with the path of that table."""
    for key, value in content.items():
        for number, table in enumerate(value if isinstance(value, list) else [value]):
            if isinstance(table, Mapping):
                path = (key, number) if isinstance(value, list) else (key,)
                names = [*_names(table)]
                times = Counter(name for name, _ in names)
                # A table may be continued, but not a value.
                twice = {name: None for name, is_value in names if is_value and times[name] > 1}
                yield from (_where(path) + name for name in twice)


def _names(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, bool]]:
    """Yield all dotted names in a table, with True for names of values."""
    for key, value in table.items():
        yield f"{before}{key}", not isinstance(value, Mapping)
        if isinstance(value, Mapping):
            yield from _names(value, f"{before}{key}.")


def _problem(table: type[TomlTable], key: str, value: Any) -> str:
    declared = entries(table)
    if key not in declared and table.named is None:
        hint = did_you_mean(key, declared) or f"; use {', '.join(declared)}"
        return f"unknown entry {key!r}{hint}"
    words = declared[key].type if key in declared else "table"
    if words == _WORDS[float] and isinstance(value, int | float) and not isinstance(value, bool):
        words = "finite number"
    names = re.findall("`(.+?)`", words)
    article = "" if names or words.startswith("true") else "a "
    hint = did_you_mean(value, names) if isinstance(value, str) else ""
    shown = str(value).lower() if isinstance(value, bool) else shortened(repr(value))
    return f"{key} = {shown}: write {article}{words.replace('`', '')}{hint}"


def _where(path: Sequence[str | int]) -> str:
    """Return the path of a table in words; the tables of a list are counted from one."""
    words: list[str] = []
    for part in path:
        if isinstance(part, int):
            words[-1] = f"{words[-1].removesuffix('s')} {part + 1}"
        else:
            words.append(part)
    return "".join(f"{word}: " for word in words)


def _at(content: Any, path: Sequence[str | int]) -> Any:
    for part in path:
        content = content[part]
    return content
