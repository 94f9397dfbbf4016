"""The paper's section 4: printed numbers and claims beside ours.

==================  ==================================================================
module              what it holds
==================  ==================================================================
:mod:`.published`   printed numbers, claims, and what the runs give
:mod:`.effects`     figures of effects that the paper does not show
:mod:`.batch`       many runs side by side
:mod:`.report`      the page
==================  ==================================================================
"""
