"""The table of modules in a package's docstring is complete and true."""

from __future__ import annotations

import re
from importlib import import_module
from pkgutil import iter_modules

import pytest

from fmus.discovery import components

#: Packages with a table in which each module or subpackage has a line :mod:`.name`.
PACKAGES = (
    "auv_fmu",
    "auv_fmu.proof",
    "fmus",
    "fmus.ports",
    "fmus.python",
    "orchestrator",
    "orchestrator.system",
    "orchestrator.system.ssp",
    "orchestrator.master",
    "orchestrator.analysis",
    "orchestrator.experiments",
    "orchestrator.exchange",
    "orchestrator.studies",
    "orchestrator.studies.batch",
    "orchestrator.paper",
    "orchestrator.commands",
)


@pytest.mark.parametrize("name", PACKAGES)
def test_table_lists_every_module_of_its_package(name):
    package = import_module(name)
    listed = re.findall(r"^:mod:`\.(\w+)` +\S", package.__doc__ or "", re.MULTILINE)
    assert len(listed) == len(set(listed))
    modules = {module.name for module in iter_modules(package.__path__)}
    # A component is found, not listed.
    found = {component.split(".")[1] for component in components().values()}
    assert set(listed) == modules - {"__main__"} - (found if name == "fmus" else set())
