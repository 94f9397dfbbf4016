"""Systems as SSP archives: what the master runs and what other hosts open.

========================  ============================================================
module                    what it does
========================  ============================================================
:mod:`.document`          a file of an archive as elements, leniently
:mod:`.validation`        files held against the schemas of the standard
:mod:`.archive`           an archive: its files, and what is wrong with it
:mod:`.definitions`       units and enumerations of a file
:mod:`.hierarchy`         systems in systems, their components and connectors
:mod:`.building`          these, from the elements of a file
:mod:`.transformations`   what connections and mappings do to a value
:mod:`.wires`             connections, followed through the connectors of systems
:mod:`.bindings`          parameter sets, their mappings, and whom they reach
:mod:`.experiment`        when a run begins and ends, and its steps
:mod:`.reading`           an archive as a system
:mod:`.writing`           a system as an archive
========================  ============================================================
"""

#: The file of an archive that says what is in it.
STRUCTURE = "SystemStructure.ssd"

_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSD = f"{_SSP}Description"
SSC = f"{_SSP}Common"
SSV = f"{_SSP}ParameterValues"
SSM = f"{_SSP}ParameterMapping"
SSB = f"{_SSP}SignalDictionary"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"

#: The annotation of ours that names the inputs that are open on purpose.
LEFT_OPEN = "LeftOpen"

#: Those of the standard's own elements.
NAMESPACES = (SSD, SSC, SSV, SSM, SSB)
