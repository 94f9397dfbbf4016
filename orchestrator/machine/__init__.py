"""The operating system: errors, files, locks, archives, child processes, interrupts, compilers."""
