"""What a component declares, and how that is written down for hosts.

======================== =================================================================
module                   what it states
======================== =================================================================
:mod:`.port`             one port: its declaration and what values it takes
:mod:`.groups`           flat values of ports from groups, and groups from flat values
:mod:`.units`            units and what they are in SI units
:mod:`.fields`           a field of a class as a port, or as a group of them
:mod:`.behaviour`        what a component may say: its hooks and constants
:mod:`.definition`       all that the module of a component says of it
:mod:`.description`      modelDescription.xml of FMI 2.0, and what all versions share
:mod:`.description_fmi3` what a host reads of FMI 3.0: description, build, terminals
======================== =================================================================
"""
