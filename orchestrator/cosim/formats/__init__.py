"""File formats of systems: SSP and OSP."""
