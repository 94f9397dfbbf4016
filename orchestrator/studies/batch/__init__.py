"""Runs of the closed loop by its equations, compiled.

========================  ============================================================
module                    what it holds
========================  ============================================================
:mod:`.parameters`        the setting of the loop that parameters of components make
:mod:`.support`           the system that the equations make
:mod:`.kernel`            one run: the loop, its noise, its rows
:mod:`.columns`           which columns these rows have
:mod:`.accumulator`       the indices of a run, on the way
:mod:`.equations`         equations as numba compiles them
:mod:`.numbers`           all numbers of nested tuples, and sums over them
:mod:`.kernels`           the kernel, compiled once and kept in the user's cache folder
:mod:`.failure`           why a run ends early: what fails taken again, in plain Python
========================  ============================================================
"""
