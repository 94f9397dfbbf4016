"""An FMU as a few calls (`instance`): in this process (`loaded`) or in its own (`isolated`)."""
