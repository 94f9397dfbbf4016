"""Exchange with other tools.

==================  ==================================================================
module              what it holds
==================  ==================================================================
:mod:`.hosts`       other co-simulation tools run our systems, held against our master
:mod:`.reference`   reference results, with which a user checks an import
:mod:`.foreign`     a table from another tool, read in full
:mod:`.verify`      a table from any tool, held against our own runs
==================  ==================================================================
"""
