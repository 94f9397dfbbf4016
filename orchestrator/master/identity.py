"""What makes a run the one that it is: all that decides its numbers, and nothing else.

How the steps are made, in which loop and process, is not in it: the rows are the same. Nor is where
an FMU lies, or what a scenario is called.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from platform import python_version

from orchestrator.master.experiment import Experiment
from orchestrator.master.hooks.events import Event
from orchestrator.master.hooks.playback import InputTable
from orchestrator.system.structure import System

#: Packages whose versions the rows depend on.
PACKAGES = ("auv-fmu", "pythonfmu", "fmpy", "numpy")

#: All that decides the numbers of a run: by names in words, each as text.
Identity = Mapping[str, str]

#: Rooms whose code makes the rows.
ROOMS = ("machine", "system", "formats", "master")


def identity(
    system: System,
    experiment: Experiment,
    events: Sequence[Event] = (),
    input_table: InputTable | None = None,
) -> Identity:
    """All that the rows of a run depend on.

    Args:
        system: that is run.
        experiment: until when, in which steps and which order.
        events: that happen to it.
        input_table: values of inputs over time; None: they keep their values.

    """
    return {
        "the code": code_of(*(f"orchestrator.{room}" for room in ROOMS)),
        "the version of Python": python_version(),
        **{f"the version of {package}": version(package) for package in PACKAGES},
        # Their order is the order of the columns, and says where a ring is opened.
        "the components": ", ".join(system.components),
        **{f"the FMU of {name}": part.digest for name, part in system.components.items()},
        # What follows from the units of the two ends is in the transformation.
        **{f"what feeds {wire.target}": repr(wire) for wire in system.connections},
        **{f"the step of {name}": repr(float(step)) for name, step in system.steps.items()},
        **_parameters(system),
        **{name: repr(value) for name, value in vars(experiment).items()},
        "the events": repr(tuple(events)),
        "the inputs": "" if input_table is None else input_table.digest,
    }


def _parameters(system: System) -> dict[str, str]:
    """Those that are set to another value than the FMU's own."""
    return {
        str(name): repr(value)
        for name, value in system.parameters.items()
        if repr(value) != repr(system.components[name.component].starts.get(name.port))
    }


def digest_of(*identities: Identity) -> str:
    """An identity, or several in their order, as a short text."""
    return sha256(json.dumps(identities, sort_keys=True).encode()).hexdigest()


@cache
def code_of(*packages: str) -> str:
    """Digest of the code of some packages, in Python and C."""
    digest = sha256()
    for package in packages:
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        found = (path for path in Path(root).rglob("*") if path.suffix in (".c", ".py"))
        for path in sorted(found):
            digest.update(f"{package}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
