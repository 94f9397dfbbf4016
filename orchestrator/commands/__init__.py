"""The command line `auv-fmu`, a file a group of commands.

==================  ==================================================================
module              commands
==================  ==================================================================
:mod:`.main`        the entry point
:mod:`.parser`      all commands, and the exit status
:mod:`.streams`     what is said and shown, whatever the standard streams are
:mod:`.options`     options that several commands have
:mod:`.build`       build, list, gains
:mod:`.run`         run
:mod:`.check`       check
:mod:`.sweep`       sweep
:mod:`.look`        plot, view, animate
:mod:`.new`         new: a controller of one's own
:mod:`.exchange`    export, hosts, verify
:mod:`.upkeep`      reference, docs: files of this repository
:mod:`.paper`       report
==================  ==================================================================
"""
