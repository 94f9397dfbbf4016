"""What any program needs of the operating system, of files and of texts; it knows no FMU."""
