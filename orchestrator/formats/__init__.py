"""How a system is written down: SSP, libcosim's files, a container FMU; schemas of TOML files."""
