"""Declarations of components, and their descriptions for hosts.

======================== =================================================================
module                   content
======================== =================================================================
:mod:`.port`             a port: its declaration, and the values that it accepts
:mod:`.groups`           conversion between flat values of ports and groups
:mod:`.units`            units in terms of SI units
:mod:`.fields`           ports from the fields of a class
:mod:`.behaviour`        hooks and constants of a component
:mod:`.reducer`          hooks and results of an index
:mod:`.definition`       the whole definition of a component
:mod:`.description`      modelDescription.xml of both versions, buildDescription.xml
:mod:`.terminals`        terminalsAndIcons.xml of FMI 3.0
======================== =================================================================
"""
