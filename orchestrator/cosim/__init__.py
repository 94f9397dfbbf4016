"""How a system is stepped: `simulation` runs the loop, observers take its rows.

The loop, in :func:`.simulation.simulate_plan`::

    exchange initial values until they rest
    tell the observers the first row
    for every step from t to t + h:
        let hooks act whose time has come
        for every stage of the schedule:
            gather the inputs of its components
            step each of them, then read their outputs
        tell the observers the row
        stop if an FMU has failed, or a signal says so

Nothing here knows which components there are.
"""
