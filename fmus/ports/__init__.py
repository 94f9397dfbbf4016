"""What a port is, the ports that components share, and how ports are written down for hosts.

==================== ===============================================================
module               what it states
==================== ===============================================================
:mod:`.port`         one port: its declaration and what values it takes
:mod:`.units`        SI units, as modelDescription.xml declares them
:mod:`.vehicle`      parameters of (2)
:mod:`.controllers`  what the controllers have in common
:mod:`.description`  modelDescription.xml, completed from the ports
==================== ===============================================================
"""
