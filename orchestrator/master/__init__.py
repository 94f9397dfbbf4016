"""How a system is stepped: `simulate` runs the loop, observers take what it computes.

======================  ==============================================================
module                  what it holds
======================  ==============================================================
:mod:`.experiment`      start, stop and step of a run: t_k = k h
:mod:`.identity`        all that decides the numbers of a run
:mod:`.simulation`      a run from the first exchange to the last step
:mod:`.instance`        what a run asks of a component
:mod:`.binary`          the library of an FMU, loaded once a process
:mod:`.sources`         that library compiled, where an FMU has none for this machine
:mod:`.loaded`          an FMU loaded into this process
:mod:`.isolated`        an FMU in a process of its own, from this side
:mod:`.placing`         in which process each FMU runs
:mod:`.surroundings`    what FMUs may change of this process, and how it is as before
:mod:`.channel`         messages between the two
:mod:`.serving`         what that process does
:mod:`.keeper`          the process that starts such processes, and leaves none behind
:mod:`.log`             what FMUs have to say
:mod:`.row`             the row of all values
:mod:`.texts`           texts, for which numbers stand in the row
:mod:`.transfer`        the FMI calls that move them
:mod:`.mode`            the processor's floating-point mode, which FMUs can change
:mod:`.paces`           which components take longer steps of their own
:mod:`.schedule`        which components are stepped when, and on whose outputs
:mod:`.coupling`        how components are coupled: at the start, and in every step
:mod:`.ring`            rings of direct feedthroughs, solved at one time
:mod:`.settling`        values handed along all connections at one time
:mod:`.linear`          steps in which inputs change linearly
:mod:`.growth`          values that a delayed ring lets grow without bound
:mod:`.signals`         what is done to values on their way from outputs to inputs
:mod:`.attendant`       who acts on a run between two steps
:mod:`.events`          what happens to a run: at a time, or at a condition
:mod:`.playback`        inputs that follow a table
:mod:`.checkpoint`      what a run needs to go on in another process
:mod:`.spool`           rows in a file that grows, to be read again
:mod:`.real_time`       a run that goes no faster than a clock
:mod:`.loop`            the steps in Python, one by one, and which loop makes them
:mod:`.ends`            the last row of a run that a component ends within a step
:mod:`.stepper`         the steps compiled, some hundred in one call of stepper.c
:mod:`.layout`          what stepper.c works on
:mod:`.library`         stepper.c as a library, kept in the user's cache folder
:mod:`.observer`        what observers are told, and the blocks in which they are told it
:mod:`.progress`        a bar
:mod:`.selection`       which rows and columns are kept
:mod:`.table`           rows kept in memory
:mod:`.files`           rows written to CSV or Parquet, and read again
:mod:`.interrupts`      signals to stop, held back while an FMU computes
======================  ==============================================================

The loop, in :func:`.simulation.simulate`::

    exchange initial values until they rest
    tell the observers the first row
    for every step from t to t + h:
        let attendants act whose time has come
        for every stage of the schedule:
            gather the inputs of its components
            step each of them, then read their outputs
        tell the observers the row
        stop if an FMU has failed, or somebody wants it

Nothing here knows which components there are.
"""
