"""Exchange with other tools.

==================  ==================================================================
module              what it holds
==================  ==================================================================
:mod:`.hosts`       other co-simulation tools run our systems, held against our master
:mod:`.reference`   reference results, with which a user checks an import
:mod:`.verify`      a table from any tool, held against our own runs
==================  ==================================================================
"""
