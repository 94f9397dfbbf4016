"""What takes the rows of a run: a table in memory, files, a selection, a progress bar."""
