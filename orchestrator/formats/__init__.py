"""How systems, runs and settings are written down: SSP, OSP, a container; tables; TOML schemas."""
