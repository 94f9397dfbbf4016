"""FMUs that end the run by themselves: it has the rows of all steps made before."""

from __future__ import annotations

import pytest

from orchestrator.cosim import Connection, PortName, System, read_component
from support.others import WAYS, build, run
from support.texts import mentions

EVERY_WAY = pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)

_FEEDTHROUGH = ('<Unknown index="2" dependencies=""/>', '<Unknown index="2" dependencies="1"/>')

#: A time after the stop time.
_NEVER = 100.0


def ring(folder, ends, steps=()):
    """Three FMUs in a ring, in which the outputs of the first two feed through.

    Each adds (1 + u) h to what it gives, which is that and u, but for the last.
    """
    components = {}
    for name, end in zip("abc", ends, strict=True):
        own = folder / f"{name}{end:g}"
        own.mkdir()
        fmu = build(own, f"ENDS_AT={end}", change=_FEEDTHROUGH if name != "c" else ("", ""))
        components[name] = read_component(name, fmu)
    wires = tuple(
        Connection(PortName(source, "y"), PortName(target, "u"))
        for source, target in ("ab", "bc", "ca")
    )
    gain = {PortName(name, "gain"): 0.5 * (name != "c") for name in "abc"}
    return System("ends", components, wires, gain, steps=dict(steps))


@EVERY_WAY
@pytest.mark.parametrize(
    ("order", "who", "at", "rows"),
    [
        ("feedthrough", "b", 0.45, 5),
        ("gauss-seidel", "a", 0.5, 5),
        ("jacobi", "c", 0.5, 5),
        ("jacobi", "b", 0.02, 1),
    ],
)
def test_the_rows_before_an_fmu_ends_are_kept(tmp_path, way, order, who, at, rows):
    table = run(
        ring(tmp_path, [at if name == who else _NEVER for name in "abc"]), order=order, **way
    )
    whole = run(ring(tmp_path, [_NEVER + 1.0] * 3), order=order)
    assert table.failure is None
    assert mentions(table.ending.remark, f"t = {0.1 * (rows - 1):g} s: {who} {at:g} s")
    assert len(whole) == 11
    assert table.rows.tobytes() == whole.rows[:rows].tobytes()


@EVERY_WAY
def test_a_step_of_a_slow_fmu_that_ends_in_it_counts_from_its_beginning(tmp_path, way):
    table = run(ring(tmp_path, [0.75, _NEVER, _NEVER], {"a": 0.4}), **way)
    assert table.failure is None
    assert mentions(table.ending.remark, "a 0.75 s")
    assert table.time == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
