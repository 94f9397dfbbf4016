"""Runs of the closed loop by its equations, compiled.

========================  ==================================================================
module                    what it holds
========================  ==================================================================
:mod:`.support`           the systems that the equations make, and the setting of the loop
:mod:`.kernel`            one run: the loop, its noise, its rows and their columns
:mod:`.accumulator`       the indices of a run, on the way
:mod:`.equations`         equations as numba compiles them
:mod:`.numbers`           all numbers of nested tuples, and sums over them
:mod:`.kernels`           the kernel, compiled once and kept in the user's cache folder
========================  ==================================================================
"""
