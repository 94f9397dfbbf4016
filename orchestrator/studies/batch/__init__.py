"""Runs of the closed loop by its equations, compiled.

========================  ==================================================================
module                    what it holds
========================  ==================================================================
:mod:`.support`           the systems that the equations make, and the setting of the loop
:mod:`.kernel`            one run: the loop, its noise, its rows and, on the way, its indices
:mod:`.compilation`       the kernel and the equations, compiled and kept in the user's cache folder
========================  ==================================================================
"""
