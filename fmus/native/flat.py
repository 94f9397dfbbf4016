"""Inputs, outputs and states as the runtime has them: arrays of doubles, whatever they are.

Where all numbers are doubles, a structure of the equations is such an array already, and the glue
copies it as a whole. Where some are not, functions that are written here go over it number by
number: integers of 32 bits are exact in doubles.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

from fmus.native.program import Program
from fmus.native.shapes import DOUBLE, Shape, Structure


def count(shape: Shape) -> int:
    """How many numbers a shape holds."""
    return sum(1 for _ in _scalars(shape))


def has_only_doubles(shape: Shape) -> bool:
    """Whether a shape is laid out as an array of doubles."""
    return all(scalar == DOUBLE for scalar in _scalars(shape))


def _scalars(shape: Shape) -> Iterator[Shape]:
    if isinstance(shape, Structure):
        for _, part in shape.parts:
            yield from _scalars(part)
    else:
        yield shape


def _reals_first(shape: Shape) -> list[int]:
    """The place of each number among all, of which doubles come first."""
    scalars = [*_scalars(shape)]
    order = sorted(range(len(scalars)), key=lambda i: scalars[i] != DOUBLE)
    places = {number: place for place, number in enumerate(order)}
    return [places[number] for number in range(len(scalars))]


@dataclass
class Passage:
    """How one of them passes between the runtime and the equations.

    Attributes:
        type: of the equations, in C.
        declaration: of the type in the runtime.
        gather, scatter: names of the functions between the two forms; empty: both are the same.
        functions: their texts.

    """

    type: str
    declaration: str
    gather: str = ""
    scatter: str = ""
    functions: Sequence[str] = ()

    def got(self, pointer: str) -> str:
        """The structure of the equations, from where the runtime has it."""
        return f"{self.gather}({pointer}->v)" if self.gather else f"*{pointer}"

    def put(self, pointer: str, value: str) -> str:
        """The statement that hands a structure over to the runtime."""
        if self.scatter:
            return f"{self.scatter}({value}, {pointer}->v);"
        return f"*{pointer} = {value};"


def passage(program: Program, what: str, shape: Shape, is_state: bool = False) -> Passage:
    """How inputs, outputs or a state pass.

    Args:
        program: that has the shape.
        what: it is called.
        shape: of the equations.
        is_state: whether its numbers have the order of its fields; those of ports begin with Reals.

    """
    if has_only_doubles(shape):
        return Passage(shape.name, shape.name)
    n = count(shape)
    places = [*range(n)] if is_state else _reals_first(shape)
    owner: Hashable = ("passage", what)
    gather = program.name(owner, f"model_{what}_of")
    scatter = program.name(owner, f"model_put_{what}")
    gathered = "\n".join(_lines(shape, "it", places, "{member} = {cast}from[{place}];"))
    scattered = "\n".join(_lines(shape, "it", places, "to[{place}] = {member};"))
    functions = (
        f"static {shape.name} {gather}(const double from[]) {{\n"
        f"    {shape.name} it;\n{gathered}\n    return it;\n}}",
        f"static void {scatter}({shape.name} it, double to[]) {{\n{scattered}\n}}",
    )
    return Passage(shape.name, f"struct {{\n    double v[{n}];\n}}", gather, scatter, functions)


def _lines(
    shape: Shape, member: str, places: Sequence[int], text: str, depth: int = 0, place: str = ""
) -> Iterator[str]:
    """A statement for each number, in loops over arrays of numbers that are alike."""
    indent = "    " * (depth + 1)
    if not isinstance(shape, Structure):
        cast = "" if shape == DOUBLE else f"({shape.name})"
        yield indent + text.format(member=member, place=place or places[0], cast=cast)
        return
    if _is_even(shape):
        part, letter = shape.parts[0][1], f"i{depth}"
        step = count(part)
        before = place or (str(places[0]) if places[0] else "")
        further = f"{step} * {letter}" if step > 1 else letter
        yield f"{indent}for (int {letter} = 0; {letter} < {len(shape.parts)}; {letter}++) {{"
        at = f"{before} + {further}" if before else further
        yield from _lines(part, f"{member}.v[{letter}]", places, text, depth + 1, at)
        yield f"{indent}}}"
        return
    for suffix, part in shape.parts:
        n = count(part)
        if n:
            yield from _lines(part, f"{member}{suffix}", places[:n], text, depth)
        places = places[n:]


def _is_even(shape: Shape) -> bool:
    """Whether a shape is a number, or an array of what is even."""
    return not isinstance(shape, Structure) or (shape.is_array and _is_even(shape.parts[0][1]))
