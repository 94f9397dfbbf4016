"""Systems as SSP archives: what the master runs and what other hosts open.

==================  =====================================================
module              what it does
==================  =====================================================
:mod:`.reading`     an archive as a system
:mod:`.writing`     a system as an archive
==================  =====================================================
"""

#: The file of an archive that says what is in it.
STRUCTURE = "SystemStructure.ssd"

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
