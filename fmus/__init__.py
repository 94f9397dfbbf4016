"""The FMU components, and what turns them into FMUs.

====================== ======================================================================
module                 what it states
====================== ======================================================================
:mod:`.ports`          what a port is, and the groups that ports come in
:mod:`.kinds`          which kinds of FMU a component comes as
:mod:`.discovery`      which components there are
:mod:`.documentation`  the page of each component
:mod:`.platforms`      the platforms that there can be libraries for
:mod:`.compilers`      what makes the libraries
:mod:`.universal`      libraries of macOS for several processors in one file
:mod:`.python`         the Python kind of FMU, on PythonFMU
:mod:`.native`         the C kind of FMU, translated from the same text
:mod:`.build`          the command that brings a folder of FMUs up to date
====================== ======================================================================

Every other folder is a component: its ports, its slave and its page.
"""
