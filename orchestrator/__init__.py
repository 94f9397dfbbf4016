"""The master, the system it runs, scenarios, figures and the command line.

Components are known here only as FMUs behind their ports.
"""
