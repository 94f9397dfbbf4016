"""Exchange with other tools: verification of tables and FMUs, runs in other hosts, the release."""
