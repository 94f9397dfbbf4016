"""FMUs as a few calls (`instance`): in this process (`loaded`) or in separate ones (`isolated`)."""
