"""The components, and the tools that turn them into FMUs.

====================== ======================================================================
module                 content
====================== ======================================================================
:mod:`.ports`          ports, groups of ports, hooks of components, descriptions
:mod:`.language`       the language of equations, as typed trees
:mod:`.kinds`          kinds of FMU, versions of FMI
:mod:`.discovery`      the bundled components, sources of FMUs, archives
:mod:`.documentation`  the page of each component
:mod:`.python`         the Python kind of FMU, on PythonFMU
:mod:`.native`         the C kind of FMU, translated from the same text
:mod:`.build`          command: bring a folder of FMUs up to date
:mod:`.script`         a user's component: its files, and messages about its mistakes
:mod:`.check`          command: list all mistakes in a component
:mod:`.trial`          a run of a component as plain Python
====================== ======================================================================

Every other folder is a component: its module, page and reference results.
"""
