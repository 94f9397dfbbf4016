"""The paper's section 4: printed numbers, claims, effects, report."""
