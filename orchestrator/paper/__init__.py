"""The paper's numbers and claims compared with ours, in a report."""
