"""The REMUS 100: an underwater vehicle with fins and a propeller."""
