"""Studies: many runs of which each differs from the others in what the study varies.

==================  ==================================================================
module              what it holds
==================  ==================================================================
:mod:`.engine`      a run of a study, what comes out of it, and what makes it
:mod:`.cluster`     who makes which runs, and where: Dask
==================  ==================================================================

A study needs the packages of the extra `studies`.
"""
