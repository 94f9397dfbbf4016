"""From component folders to FMU files.

======================= ============================================================
module                  what it states
======================= ============================================================
:mod:`.discovery`       which components there are
:mod:`.build`           the command that brings a folder of FMUs up to date
:mod:`.own`             the FMU of a script of the user's own
:mod:`.sealing`         reproducible archives that are alone in their process
:mod:`.documentation`   the page of each component
:mod:`.loader`          the library that lets an FMU run where there is no Python
======================= ============================================================
"""
