"""Ports, parameters and state of all types, and outputs that no input changes."""

from __future__ import annotations

from .component import *  # noqa: F403
from .component import Outputs, Parameters, State, Vector


def restarted(state: State) -> State:
    """The state without a wild x."""
    return state._replace(x=0.0)


def outputs(parameters: Parameters, state: State, t: float) -> Outputs:
    """Outputs."""
    return Outputs(
        n=state.n,
        x=state.x + t,
        on=state.on,
        doing=state.mode,
        line=state.line,
        pairs=(state.counters[0], state.inner.count),
        B=parameters.gain * state.M.T,
        noisy=Vector((state.line[0], state.line[1])),
        flags=(state.inner.flags[0], state.on, state.n > 5),
    )
