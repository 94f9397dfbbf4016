"""Systems as SSP archives: what the master runs and what other hosts open.

`reader` and `writer` are the two doors. Reading goes from the elements of a file (`archive`) over
the tree of systems (`hierarchy`) to what each connection and parameter set says (`origins`), and
from there to the output that feeds each input and the value of each parameter (`reader`).
"""

#: The file of an archive that describes its contents.
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

#: The one that names the components in their order, where nesting changes it.
ORDER = "Order"

#: Namespaces of the standard's own elements.
NAMESPACES = (SSD, SSC, SSV, SSM, SSB)
