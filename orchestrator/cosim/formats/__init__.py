"""How systems, runs and settings are written down: SSP, OSP; tables; TOML schemas."""
