"""The paper's section 4: printed numbers, claims, effects, report, and what is wrong in it.

======================  ==============================================================
module                  what it holds
======================  ==============================================================
:mod:`.published`       what the paper prints
:mod:`.errata`          what is wrong in it, each point with its proof and its test
:mod:`.readings`        the points where it is silent or contradicts itself, in short
:mod:`.formatting`      numbers, tables and pictures in Markdown
:mod:`.workers`         processes on the cores that end when the user says so
:mod:`.runs`            a scenario with changes
:mod:`.outcomes`        what is kept of runs, each made once
:mod:`.measures`        numbers of a run that claims speak of
:mod:`.claims`          each claim of the paper, judged by the runs named beside it
:mod:`.effects`         what runs show when they are compared
:mod:`.choices`         what the paper leaves open of the runs behind its table
:mod:`.sensitivity`     how the printed numbers move with it
:mod:`.variants`        the runs of all combinations, and what is read off them
:mod:`.printed_table`   the printed table beside them
:mod:`.table`           the files of `auv-fmu table`
:mod:`.sections`        a section for each scenario
:mod:`.studies`         the ready studies, their figures and what these show
:mod:`.page`            Markdown as one HTML page
:mod:`.report`          all of it put together
======================  ==============================================================
"""
