"""The operating system, files, processes, compilers and texts: nothing here depends on FMI."""
