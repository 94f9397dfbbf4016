"""How it is written down: SSP, libcosim's configuration, a container FMU; schemas of TOML files."""
