"""The reference trajectory."""
