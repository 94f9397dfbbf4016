"""The loop's signals by the paper's names, and what is computed and drawn from them.

======================  ==============================================================
module                  what it holds
======================  ==============================================================
:mod:`.signals`         which port holds which signal of the paper
:mod:`.metrics`         (59), e_f and the other indices of a run
:mod:`.certificates`    Lyapunov function, composite errors and margins along a run
:mod:`.sensors`         which velocities reach a controller
:mod:`.gains`           the conditions of Theorems 1 and 2 for a set of parameters
:mod:`.cautions`        gains that the step cannot follow
:mod:`.visible`         of a long run, the rows that can be seen
:mod:`.figures`         the paper's figures
:mod:`.plot`            any signals of any results
:mod:`.body`            a hull with fins, so that the attitude can be seen
:mod:`.view`            a page to turn a run around and play it
:mod:`.animation`       a film of a run
======================  ==============================================================
"""
