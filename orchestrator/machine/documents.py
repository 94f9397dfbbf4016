"""XML files from other tools, read leniently and safely."""

from __future__ import annotations

from collections.abc import Callable, Collection
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

#: Elements in which any namespace may be used.
_OPEN = ("Annotations", "MetaData", "Signature")


def read_document(
    text: bytes,
    note: Callable[[str], None] = lambda _: None,
    namespaces: Collection[str] = (),
    standard: str = "",
) -> Element:
    """Return the root element of an XML file; tags and attributes are local names, without text.

    Args:
        text: the file.
        note: takes flaws that can still be understood.
        namespaces: in which elements are expected; none: in any.
        standard: that has these namespaces, for messages.

    Raises:
        ValueError: it is not well-formed, or has a document type.

    """
    reader = _Reader(note, namespaces, standard)
    parser = expat.ParserCreate()
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.StartDoctypeDeclHandler = reader.doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"not well-formed XML: {error}") from error
    return reader.builder.close()


class _Reader:
    """Handlers of a parser without namespaces, which are resolved here.

    Attributes:
        builder: of the elements.

    """

    def __init__(
        self, note: Callable[[str], None], namespaces: Collection[str], standard: str
    ) -> None:
        self.builder = TreeBuilder()
        self._note, self._namespaces, self._standard = note, namespaces, standard
        self._scopes: list[dict[str, str]] = [{}]
        self._open = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        scope, plain = dict(self._scopes[-1]), {}
        for key, value in attributes.items():
            if key.partition(":")[0] == "xmlns":
                scope[key.partition(":")[2]] = value
            else:
                plain[key.rpartition(":")[2]] = value
        self._scopes.append(scope)
        prefix, _, name = tag.rpartition(":")
        if self._open or name in _OPEN:
            self._open += 1
        namespace = scope.get(prefix)
        if namespace is None and prefix:
            self._note(f"the prefix {prefix!r} is not declared")
        elif self._namespaces and not self._open and namespace not in self._namespaces:
            where = f"in the namespace {namespace!r}" if namespace else "without a namespace"
            self._note(f"elements are {where}, which is not {self._standard}'s")
        self.builder.start(name, plain)

    def end(self, tag: str) -> None:
        """End an element."""
        self._scopes.pop()
        self._open = max(self._open - 1, 0)
        self.builder.end(tag.rpartition(":")[2])

    def doctype(self, *_: object) -> None:
        """Refuse a document type: it may name other files, or expand beyond memory."""
        raise ValueError("it has a DOCTYPE, which is not allowed")
