"""The C kind of component: the same equations, translated, the same ports, as tables.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.language`     the subset of Python that equations keep to
:mod:`.translator`   the equations of a component in C
:mod:`.program`      what a set of functions needs
:mod:`.functions`    the functions of the equations, one by one
:mod:`.expressions`  their expressions
:mod:`.shapes`       the types of the equations in C
:mod:`.layout`       lines of C
:mod:`.tables`       the ports of a component in C
==================== ===============================================================

`runtime` holds what is the same for all components: the functions of FMI and what is behind them.
"""

from __future__ import annotations

from pathlib import Path

from fmus.kinds import FMI_VERSIONS
from fmus.native.tables import tables
from fmus.native.translator import translated
from fmus.ports import description_fmi2, description_fmi3

#: What is the same for all components.
RUNTIME = Path(__file__).parent / "runtime"

#: The file to compile, by the version of FMI: it includes all others.
MAIN = dict(zip(FMI_VERSIONS, (description_fmi2.SOURCE, description_fmi3.SOURCE)))


def sources(package: str, fmi: str = FMI_VERSIONS[0]) -> dict[str, str]:
    """The C sources of a component by their names, all but identity.h.

    Args:
        package: of the component, for example `fmus.auv_plant`.
        fmi: version of FMI.

    """
    others = {name for version, name in MAIN.items() if version != fmi}
    return {
        **{
            path.name: path.read_text(encoding="utf-8")
            for path in sorted(RUNTIME.glob("*.[ch]"))
            if path.name not in others
        },
        "equations.c": translated(package),
        "ports.h": tables(package),
    }
