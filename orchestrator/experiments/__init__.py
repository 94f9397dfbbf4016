"""Scenarios, the wiring of the closed loop, the bundle, and one run with its files.

========================  ============================================================
module                    what it holds
========================  ============================================================
:mod:`.entries`           what a file of the user's may hold
:mod:`.named`             files by name, those that come with the program
:mod:`.scenario`          scenario files
:mod:`.events`            what they say of events, read for a system
:mod:`.inputs`            and of inputs that follow a table
:mod:`.waypoints`         a path from a table of waypoints
:mod:`.scenario_page`     their reference page
:mod:`.wiring`            which FMUs there are, and which ports feed which
:mod:`.bundle`            the FMUs and auv.ssp, built when missing or stale
:mod:`.bill_of_materials` checksums and packages of the bundle
:mod:`.own_controller`    a controller of the user's own, to begin with
:mod:`.preparation`       from a name to what is run
:mod:`.checkpoints`       where checkpoints lie, and what they are of
:mod:`.run`               a run with its files, as the command line makes it
:mod:`.folder`            a folder of results that changes all at once
:mod:`.record`            run.json
:mod:`.stored`            results read from their folders
:mod:`.result`            a run from Python: `simulate` and `Result`
========================  ============================================================
"""
