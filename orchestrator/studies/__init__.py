"""Studies: many runs of which each differs from the others in what the study varies.

====================  ==================================================================
module                what it holds
====================  ==================================================================
:mod:`.engine`        a run of a study, what comes out of it, and what makes it
:mod:`.study`         a study file, read and checked
:mod:`.study_page`    the page on studies
:mod:`.space`         the runs of a study: which values each of them has
:mod:`.fmu_engine`    runs of FMUs
:mod:`.batch_engine`  runs of the closed loop by its equations, compiled
:mod:`.batch`         what it is made of
:mod:`.indices`       what comes out of a run, from its rows
:mod:`.store`         what has come out of a study, as it comes and at the end
:mod:`.cluster`       who makes which runs, and where: Dask
:mod:`.sockets`       Dask's processes on this machine, which no other user reaches
:mod:`.figures`       what is drawn of it
:mod:`.sweep`         a study as a whole
:mod:`.ready_page`    the page of the studies that come with the program
====================  ==================================================================

A study needs the packages of the extra `studies`, which are imported when they are needed.
"""
