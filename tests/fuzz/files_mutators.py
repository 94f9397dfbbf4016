"""Valid files made invalid, in small and in large ways, the same way for the same seed."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from copy import deepcopy
from random import Random
from warnings import catch_warnings
from xml.etree import ElementTree

Mutator = Callable[[bytes, Random], bytes]

#: Values that programs trip over, wherever a value stands.
NASTY = (
    "", " ", "0", "-0", "-1", "1", "999", "1e308", "1e999", "-1e999", "5e-324", "1e-320", "nan",
    "NaN", "inf", "-INF", "1_000", "\u0661\u0662", "0x10", "1,5", "1.5.5", "+1", "1e", "true",
    "False", "2147483648", "-2147483649", "9" * 400, "9" * 5000, "\u00e9", "\u2028", "a\tb",
    "../../../etc/passwd", "/etc/passwd", "http://localhost/x", "%s%n", "{0}", "$(id)", "'", '"',
    "\\", ";", "a" * 100_000, "plant", "plant.eta.x", "none", "null",
)  # fmt: skip


def some_bytes(content: bytes, random: Random) -> bytes:
    """Change, drop or double some bytes, or cut off the rest."""
    content = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 8))):
        at = random.randrange(len(content) + 1)
        length = random.choice((1, 1, 4, 64))
        action = random.randrange(5)
        if action == 0:
            content[at : at + length] = random.randbytes(length)
        elif action == 1:
            del content[at : at + length]
        elif action == 2:
            content[at:at] = content[at : at + length] * random.choice((1, 2, 100))
        elif action == 3 and random.random() < 0.3:
            del content[at:]
        else:
            content[at:at] = random.choice(NASTY).encode("utf-8", "surrogatepass")
    return bytes(content)


def table(content: bytes, random: Random) -> bytes:
    """Change cells, rows, columns or separators of a table."""
    rows = [line.split(",") for line in content.decode().splitlines()]
    separator, end, mark = ",", "\n", ""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        if len(rows) < 3:
            break
        _spoil(rows, random)
    if random.random() < 0.2:
        separator, end, mark = random.choice(
            ((";", "\n", ""), ("\t", "\r\n", ""), (", ", "\r", ""), (",", "\n", "\ufeff"),
             (" ", "\n", ""), ("|", "\n", ""), (",", "\n\n", ""), (",", "\n", "sep=,\n"))
        )  # fmt: skip
    changed = (mark + end.join(map(separator.join, rows)) + end).encode("utf-8", "surrogatepass")
    return some_bytes(changed, random) if random.random() < 0.2 else changed


def _spoil(rows: list[list[str]], random: Random) -> None:
    row = random.randrange(1, len(rows))
    column = random.randrange(len(rows[0]))
    actions: list[Callable[[], object]] = [
        lambda: _put(rows, row, column, random.choice(NASTY)),
        lambda: _put(rows, row, 0, random.choice((*NASTY, "0.5", "1.01", "3.999", "4"))),
        lambda: _put(rows, row, column, _written_otherwise(_at(rows, row, column), random)),
        lambda: _put(rows, 0, column, _renamed(_at(rows, 0, column), rows, random)),
        lambda: _wrong_column(rows, column, random),
        lambda: rows[row].pop(random.randrange(len(rows[row]))) if rows[row] else None,
        lambda: rows[row].insert(column, random.choice(NASTY)),
        lambda: rows.pop(row),
        lambda: rows.insert(row, list(rows[random.randrange(len(rows))])),
        lambda: rows.insert(row, random.choice(([], [""], [" "], ["# remark"]))),
        lambda: rows.__setitem__(slice(row, None), []),
        lambda: [line.append(line[column]) for line in rows if len(line) > column],
        lambda: [line.pop(column) for line in rows if len(line) > column],
        lambda: [line.append(random.choice(NASTY)) for line in rows],
        lambda: rows[row].append(""),
    ]
    random.choice(actions)()


def _at(rows: list[list[str]], row: int, column: int) -> str:
    return rows[row][column] if column < len(rows[row]) else ""


def _put(rows: list[list[str]], row: int, column: int, text: str) -> None:
    if column < len(rows[row]):
        rows[row][column] = text


def _written_otherwise(text: str, random: Random) -> str:
    """Write the same number, or nearly, as another program may write it."""
    try:
        number = float(text)
    except ValueError:
        return f'"{text}"'
    return random.choice(
        (f'"{text}"', f" {text} ", f"{number:.17e}", f"{number:.6g}", f"+{number!r}",
         f"{number:.3f}", f'"{text}', f'{text}"', f"{text}f", f"{number + 1e-3!r}",
         f"{number * (1 + 1e-5)!r}")
    )  # fmt: skip


def _renamed(name: str, rows: list[list[str]], random: Random) -> str:
    return random.choice(
        (name.replace(".", "::", 1) + "[REAL]", f"auv.{name}", f"fig4.{name}", f" {name} ",
         f'"{name}"', name.upper(), name[:-1], f"{name}\u200b", "time", "t", random.choice(rows[0]))
    )  # fmt: skip


def _wrong_column(rows: list[list[str]], column: int, random: Random) -> None:
    """Change every value of a column, one of them to invalid text."""
    for row in rows[1:]:
        _put([row], 0, column, "999")
    _put(rows, random.randrange(1, len(rows)), column, random.choice(NASTY))


def xml(content: bytes, random: Random) -> bytes:
    """Change elements or attributes of a tree."""
    if random.random() < 0.25:
        return _xml_text(content, random)
    root = ElementTree.fromstring(content)
    for _ in range(random.choice((1, 1, 2, 5))):
        elements = [(parent, child) for parent in root.iter() for child in parent]
        if not elements:
            break
        parent, child = random.choice(elements)
        action = random.randrange(8)
        if action <= 2 and child.attrib:
            child.set(random.choice([*child.attrib]), _legal(random.choice(NASTY)))
        elif action == 3 and child.attrib:
            del child.attrib[random.choice([*child.attrib])]
        elif action == 4:
            parent.remove(child)
        elif action == 5:
            parent.insert(random.randrange(len(parent) + 1), deepcopy(child))
        elif action == 6:
            random.choice(elements)[0].append(deepcopy(child))
        else:
            other = random.choice(elements)[1]
            other.attrib.update(child.attrib)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True)


def _legal(text: str) -> str:
    """Drop the characters that XML does not allow."""
    return "".join(letter for letter in text if letter >= " " or letter in "\t\n\r")


def _xml_text(content: bytes, random: Random) -> bytes:
    head, _, body = content.partition(b"?>")
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
    return random.choice(
        (
            lambda: some_bytes(content, random),
            lambda: content[: random.randrange(len(content))],
            lambda: b"",
            lambda: head + b'?><!DOCTYPE x [<!ENTITY l0 "ha">' + laughs.encode() + b"]>"
            + body.replace(b'name="', b'name="&l11;', 1),
            lambda: head + b'?><!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
            + body.replace(b'name="', b'name="&e;', 1),
            lambda: head + b"?>" + b"<a>" * 50_000 + b"</a>" * 50_000,
            lambda: content.decode().encode("utf-16"),
            lambda: content.replace(b"UTF-8", b"EBCDIC-CP-US").replace(b"utf-8", b"UTF-7"),
            lambda: content.replace(b"><", b"><!-- -- --><", 1),
            lambda: content.replace(b'="', b'="\x00', 1),
        )
    )()  # fmt: skip


def toml(content: bytes, random: Random) -> bytes:
    """Change lines or values of a scenario."""
    lines = content.decode().splitlines()
    values = (
        *("[" * n + "]" * n for n in (1, 3, 5000)), "{}", '{ a = 1 }', "9" * 400, "9" * 5000,
        "1e308", "-1", "0", "nan", "inf", "1e-320", "true", "false", '""', '"\\u001b[31m\\n"',
        '"a\\u0000b"', "2020-01-01", "07:32:00", "[[1], ['a']]", "'../../x.fmu'", "'/etc/passwd'",
        "'none'", "['plant']", "[1]", '"""', "0x10", "1_000", f"'{'a' * 100_000}'",
        "'self.toml'", "'AuvPlant'", "'\u00e9'",
    )  # fmt: skip
    keys = (
        "stop_time", "step", "title", "label", "figure", "compare", "only", "remark", "components",
        "wires", "parameters", "ours", "components.plant", "components.controller",
        'wires."controller.dy"', 'wires."plant.tau"', "parameters.plant.m11", "parameters.plant",
        "parameters.controller.saturation", 'parameters."controller.K1[1]"', "ours.x",
        ".".join(["a"] * 2000), "parameters." + ".".join(["a"] * 2000), '""', '"\\u001b"', "a.b",
    )  # fmt: skip
    for _ in range(random.choice((1, 1, 2, 4))):
        at = random.randrange(len(lines) + 1)
        action = random.randrange(4)
        if action == 0 and at < len(lines):
            name = lines[at].partition("=")[0]
            lines[at] = f"{name}= {random.choice(values)}"
        elif action == 1:
            # Above the first table, so that the key is what it says.
            lines.insert(0, f"{random.choice(keys)} = {random.choice(values)}")
        elif action == 2 and at < len(lines):
            del lines[at]
        else:
            lines.insert(at, f"{random.choice(keys)} = {random.choice(values)}")
    changed = "\n".join(lines).encode("utf-8", "surrogatepass")
    return some_bytes(changed, random) if random.random() < 0.2 else changed


def json(content: bytes, random: Random) -> bytes:
    """Change values of a record."""
    if random.random() < 0.3:
        return some_bytes(content, random)
    text = content.decode()
    values = ("[]", "{}", "null", "1", "-1", "1e999", "NaN", "true", '"\\ud800"', '"\\u0000"',
              '"../../x"', '"a"', "9" * 5000, "[" * 100_000, '{"a": 1}', '""')  # fmt: skip
    if random.random() < 0.2:
        return random.choice(values).encode()
    lines = text.splitlines()
    at = random.randrange(len(lines))
    name, colon, _ = lines[at].partition(":")
    comma = "," * lines[at].endswith(",")
    lines[at] = f"{name}{colon} {random.choice(values)}{comma}" if colon else ""
    return "\n".join(lines).encode()


def archive(content: bytes, random: Random) -> bytes:
    """Break the structure of a zip archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as whole:
            entries = {name: whole.read(name) for name in whole.namelist()}
    except Exception:
        # Mutated before.
        return some_bytes(content, random)
    name = random.choice([*entries, "x"])
    kind = random.randrange(16)
    method = random.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    odd = ("", "/", ".", "a/", "\\", "a\\..\\..\\b", "n" * 300, "d/" * 2000)
    added = {
        0: [(name, b"another")],
        1: [("../outside.txt", b"x")],
        2: [(f"{'../' * 20}tmp/outside.txt", b"x")],
        3: [("/tmp/outside.txt", b"x")],
        4: [(f"{name}/below", b"x")],
        5: [("zeros", bytes(1_000_000))],
        6: [(f"{i:x}", b"") for i in range(random.choice((10, 2000)))],
        7: [(random.choice(odd), b"x")],
        8: [("link", b"/etc/passwd")],
    }.get(kind, [])  # fmt: skip
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as changed, catch_warnings(action="ignore"):
        for entry, data in (*entries.items(), *added):
            information = zipfile.ZipInfo(entry)
            information.compress_type = method
            if entry == "link":
                information.external_attr = 0o120777 << 16
            changed.writestr(information, data)
    result = bytearray(out.getvalue())
    directory = result.find(b"PK\x01\x02")
    if kind == 9:
        # Sizes in the central directory that are none.
        struct.pack_into("<II", result, directory + 20, random.getrandbits(32), 2**30 - 1)
    elif kind == 10:
        struct.pack_into("<I", result, directory + 16, random.getrandbits(32))
    elif kind == 11:
        # Encrypted.
        struct.pack_into("<H", result, directory + 8, 1)
        struct.pack_into("<H", result, 6, 1)
    elif kind == 12:
        # Spanned over several disks.
        struct.pack_into("<HH", result, len(result) - 18, 7, 7)
    elif kind == 13:
        struct.pack_into("<H", result, directory + 10, random.choice((1, 6, 9, 99)))
    elif kind == 14:
        return bytes(result[: random.choice((0, 1, len(result) // 2, len(result) - 1))])
    elif kind == 15:
        at = random.randrange(directory, len(result))
        result[at] = random.randrange(256)
    return some_bytes(bytes(result), random) if random.random() < 0.3 else bytes(result)
