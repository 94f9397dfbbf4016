"""Other tools: exports, hosts, reference results."""
