"""One run: scenarios, the wiring of the closed loop, the bundle, result folders.

A scenario becomes a system in `wiring`, is checked in `preparation`, and run by `run` (files) or
`result` (Python).
"""
