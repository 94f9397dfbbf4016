"""The table of controllers: laws, tasks and vehicles, the search for gains, and the table.

Begin with `contest`. `components/` has the tasks, sensors and limits, `vehicles/` the loops,
`draws/` what is random, and `laws.toml` the laws.
"""
