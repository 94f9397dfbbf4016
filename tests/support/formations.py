"""Formations, and a follower that gets messages."""

from __future__ import annotations

from hypothesis import strategies as st

from auv_fmu.guidance import formation
from auv_fmu.guidance.formation import Estimator, Known, Parameters, Shape, Stages

ORIGIN = (0.0, 0.0, 0.0)
FOUR = (0.0,) * 4


def known(y_0=ORIGIN, dy_0=ORIGIN, ddy_0=ORIGIN, psi_0=0.0, age=0.0) -> Known:
    return Known(y_0, dy_0, ddy_0, psi_0, age)


coordinates = st.floats(-20.0, 20.0)


@st.composite
def tables(draw) -> Parameters:
    """Stages that no vehicle may be able to keep, with changes one after the other."""
    x, y, z = (draw(st.tuples(*(coordinates,) * 4)) for _ in "xyz")
    durations = draw(st.tuples(*(st.floats(1.0, 50.0),) * 3))
    rests = draw(st.tuples(*(st.floats(0.0, 20.0),) * 3))
    t = (rests[0], rests[0] + durations[0] + rests[1])
    t = (*t, t[1] + durations[1] + rests[2])
    stages = Stages(draw(st.integers(1, 4)), (Shape.TABLE,) * 4, FOUR, x, y, z, t, durations)
    return Parameters(stages=stages, omega_chi=draw(st.floats(0.05, 2.0)))


def follow(estimator: Estimator, position, received, h: float, n: int):
    """The state of a follower over time.

    Args:
        estimator: of the follower.
        position: of the leader over time.
        received: times at which messages are received, and when they were sent, in their order.
        h: step [s].
        n: how many.

    """
    parameters = Parameters(1, 1, estimated=True, estimator=estimator)
    state = formation.first_state(known(position(0.0)))
    sent, waiting = 0.0, [*received]
    for k in range(n):
        t = k * h
        while waiting and waiting[0][0] <= t + 1e-9:
            sent = waiting.pop(0)[1]
        leader = known(position(sent), age=t - sent)
        yield t, state, formation.leader(parameters, state, leader)
        state = formation.step(parameters, state, leader, h)


def every(period: float, delay: float, end: float) -> list[tuple[float, float]]:
    return [(k * period + delay, k * period) for k in range(int(end / period) + 1)]
