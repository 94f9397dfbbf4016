"""Names of files that every system takes."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from hashlib import sha256

#: What may be in the name of a file on every system, words that Windows keeps for itself, and how
#: long a name may be [bytes] to leave room for what follows it.
_ODD, _KEPT = (
    re.compile(r"[^\w .()+=,@~-]"),
    re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.I),
)
_LONGEST = 120


def file_name(name: str, taken: Collection[str] = ()) -> str:
    """A name for a file or folder, which every system takes and no other name becomes.

    Args:
        name: of anything.
        taken: names of files that there are beside it.

    """
    plain = _ODD.sub("_", name).strip(" ").rstrip(".")
    plain = plain.encode()[:_LONGEST].decode(errors="ignore")
    if not plain or plain.startswith(".") or _KEPT.match(plain):
        plain = f"_{plain}"
    if plain != name:
        plain += f"-{sha256(name.encode(errors='surrogatepass')).hexdigest()[:8]}"
    others = {other.casefold() for other in taken}
    while plain.casefold() in others:
        plain += "_"
    return plain


def plain_file_names(names: Iterable[str], *taken: str) -> list[str]:
    """Names of files that need no encoding in a URI, of which some hosts know nothing.

    No two are the same, nor differ in case only: some file systems do not tell them apart.

    Args:
        names: as they are.
        taken: names that are not free.

    """
    found: list[str] = []
    used = {name.lower() for name in taken}
    for name in names:
        base = re.sub(r"[^\w.-]", "_", name, flags=re.ASCII)
        free, number = base, len(found)
        while free.lower() in used:
            free, number = f"{number}_{base}", number + 1
        found.append(free)
        used.add(free.lower())
    return found
