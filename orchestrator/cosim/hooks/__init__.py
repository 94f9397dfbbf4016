"""What acts between two steps: events, inputs that follow a table, a clock, checkpoints."""
