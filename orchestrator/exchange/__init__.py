"""Exchange with other tools.

==================  ==================================================================
module              what it holds
==================  ==================================================================
:mod:`.hosts`       other co-simulation tools run our systems, held against our master
:mod:`.c_host`      a host that is a C program, for any machine that has a compiler
:mod:`.reference`   reference results, with which a user checks an import
:mod:`.foreign`     a table from another tool, read in full
:mod:`.verify`      a table from any tool, held against our own runs
==================  ==================================================================
"""
