"""From component folders to FMU files.

======================= ============================================================
module                  what it states
======================= ============================================================
:mod:`.discovery`       which components there are
:mod:`.kinds`           which kinds of FMU a component comes as
:mod:`.build`           the command that brings a folder of FMUs up to date
:mod:`.python`          the kind that PythonFMU runs
:mod:`.native`          the kind that is a library, translated to C
:mod:`.platforms`       the platforms that there can be libraries for
:mod:`.compilers`       what makes the libraries
:mod:`.universal`       libraries of macOS for several processors in one file
:mod:`.own`             the FMU of a script of the user's own
:mod:`.sealing`         reproducible archives that are alone in their process
:mod:`.documentation`   the page of each component
:mod:`.loader`          the library that lets an FMU run where there is no Python
======================= ============================================================
"""
