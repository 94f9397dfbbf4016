"""The FMU components, and what turns them into FMUs.

====================== ======================================================================
module                 what it states
====================== ======================================================================
:mod:`.ports`          what a port is, the groups that ports come in, a component's hooks
:mod:`.kinds`          kinds of FMU, versions of FMI
:mod:`.discovery`      which components there are, what FMUs are made from, their archives
:mod:`.documentation`  the page of each component
:mod:`.python`         the Python kind of FMU, on PythonFMU
:mod:`.native`         the C kind of FMU, translated from the same text
:mod:`.build`          the command that brings a folder of FMUs up to date
:mod:`.script`         a user's own component: where it is, and its mistakes in words
:mod:`.check`          the command that lists all mistakes in it
:mod:`.trial`          its run as plain Python
====================== ======================================================================

Every other folder is a component: its module and its page.
"""
