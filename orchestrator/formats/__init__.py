"""How a system is written down: SSP, libcosim's configuration, a container FMU."""
