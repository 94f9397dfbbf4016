"""Other tools: hosts that run the bundle, verification of their tables."""
