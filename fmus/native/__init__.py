"""The C kind of component: the same equations, translated, the same ports, as tables.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.language`     the subset of Python that equations keep to
:mod:`.translator`   the equations of a component in C
:mod:`.functions`    the functions of the equations, one by one
:mod:`.shapes`       the types of the equations in C
:mod:`.layout`       lines of C
:mod:`.tables`       the ports of a component in C
==================== ===============================================================

`runtime` holds what is the same for all components: the functions of FMI and what is behind them.
"""

from __future__ import annotations

from pathlib import Path

from fmus.native.tables import tables
from fmus.native.translator import translated

#: What is the same for all components.
RUNTIME = Path(__file__).parent / "runtime"


def sources(package: str) -> dict[str, str]:
    """The C sources of a component by their names, all but identity.h.

    Of fmi2.c and fmi3.c one is compiled, and includes all others.

    Args:
        package: of the component, for example `fmus.auv_plant`.

    """
    runtime = sorted(RUNTIME.glob("*.[ch]"))
    return {
        **{path.name: path.read_text(encoding="utf-8") for path in runtime},
        "equations.c": translated(package),
        "ports.h": tables(package),
    }
