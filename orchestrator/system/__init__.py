"""What is simulated, and how it is written down.

======================  ==============================================================
module                  what it holds
======================  ==============================================================
:mod:`.names`           `component.port`, and a component's own ports
:mod:`.values`          values in the types of FMI's variables, from text and to text
:mod:`.component`       an FMU and what its description says about it
:mod:`.description`     that description, read leniently
:mod:`.transformation`  what happens to a value on its way through a connection
:mod:`.units`           units by their definitions, and from one to another
:mod:`.structure`       components, connections and parameters: a system
:mod:`.graph`           what depends on what: feedthrough, and what reaches a component
:mod:`.atomic`          files that outlast a power cut
:mod:`.sealed`          records that carry a checksum over themselves
:mod:`.ledger`          what was written into a folder: the proof that a file is ours
:mod:`.leftovers`       what only one process may have, and what it leaves when it is killed
:mod:`.cache`           what is made once and kept in the user's cache folder
:mod:`.imports`         modules that would read a file of the current folder
:mod:`.children`        modules run in processes that do not outlive this one
:mod:`.unpacking`       archives unpacked, once a process and version
:mod:`.ssp`             systems as SSP 1.0 archives, read and written
:mod:`.examination`     an FMU examined without loading it
:mod:`.osp`             systems as libcosim's own configuration
:mod:`.container`       a system as one FMU
======================  ==============================================================

Nothing here knows which components there are.
"""
