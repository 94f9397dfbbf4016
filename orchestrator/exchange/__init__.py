"""Other tools: hosts that run the bundle, reference results, verification of their tables."""
