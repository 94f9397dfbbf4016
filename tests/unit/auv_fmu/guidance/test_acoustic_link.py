"""Messages between vehicles: times of arrival, losses, and the receiver's knowledge."""

from __future__ import annotations

from itertools import pairwise
from math import dist, floor, sqrt

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from auv_fmu import Refusal
from auv_fmu.guidance import acoustic_link
from auv_fmu.guidance.acoustic_link import PLACES, LinkState, Parameters
from auv_fmu.language.random_numbers import start, uniform

HERE, LEVEL = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def run(parameters: Parameters, h: float, n: int, y=lambda t: HERE, receiver=lambda t: HERE):
    """The state after each of n steps."""
    state = acoustic_link.first_state(parameters, y(0.0), LEVEL, 0.0)
    for k in range(n):
        t = k * h
        state = acoustic_link.advance(parameters, state, y(t), (0.0, 0.0, t), receiver(t), t, h)
        yield t + h, state


def events(parameters: Parameters, end: float, ages, y, receiver):
    """All messages sent before an end: when they are sent, their delay, and whether they arrive.

    Args:
        parameters: of the link.
        end: of the run [s].
        ages: how old the position of a message is, by the time it is sent at [s].
        y, receiver: positions over time.

    """
    random, found, k = start(parameters.seed, 1), [], 0
    while k * parameters.period < end:
        sent = k * parameters.period
        random, u = uniform(random)
        seen = sent - ages(sent)
        delay = parameters.latency + dist(y(seen), receiver(seen)) / parameters.sound_speed
        out = (
            parameters.outage_start <= sent < (parameters.outage_start + parameters.outage_duration)
        )
        under_way = sum(ok and sent < at + late for at, late, ok in found)
        ok = u >= parameters.loss and not out and under_way < PLACES
        found.append((sent, delay, ok))
        k += 1
    return found


links = st.builds(
    Parameters, period=st.floats(0.05, 3.0), sound_speed=st.floats(5.0, 1500.0),
    latency=st.floats(0.0, 2.0), loss=st.sampled_from([0.0, 0.3, 1.0]),
    seed=st.integers(-(2**31), 2**31 - 1), outage_start=st.floats(0.0, 10.0),
    outage_duration=st.sampled_from([0.0, 5.0]),
)  # fmt: skip


@given(links, st.floats(0.01, 4.0), st.integers(1, 60))
def test_link_is_the_simulation_of_its_events(parameters, h, n):
    def y(t):
        return (t, 2.0 * t, -t)

    def receiver(t):
        return (30.0 - t, 0.0, t)

    def near(a, b):
        """Times that rounding may swap."""
        return abs(a - b) <= 2e-6 * h

    states = [*run(parameters, h, n, y, receiver)]
    found = events(parameters, n * h, lambda sent: sent - h * int(sent / h + 1e-6), y, receiver)
    # At the end of a step, rounding decides.
    moments = [sent for sent, _, _ in found] + [sent + late for sent, late, _ in found]
    apart = [s + late - r for s, late, _ in found for r, _, _ in found]
    clear = all(not near(m, h * round(m / h)) for m in moments if m > 0.0)
    assume(clear and not any(0.0 < abs(x) < 1e-9 for x in apart))
    for t, state in states:
        sent = [message for message in found if message[0] < t]
        arrived = [message for message in sent if message[2] and message[0] + message[1] <= t]
        assert state.sent == len(sent)
        assert state.received == len(arrived)
        assert state.lost == sum(not ok for _, _, ok in sent)
        newest = max((message[0] for message in arrived), default=0.0)
        assert state.newest.sent == newest
        seen = h * int(newest / h + 1e-6)
        assert state.newest.y == pytest.approx(y(seen), rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("h", [0.02, 0.1, 1 / 3, 0.7])
def test_messages_are_sent_at_their_times_whatever_the_step(h):
    """At 1.5 km, with modems of 0.5 s, what is sent each second arrives 1.5 s later."""
    parameters = Parameters(latency=0.5)
    for t, state in run(parameters, h, round(20 / h), receiver=lambda t: (1500.0, 0.0, 0.0)):
        assert state.sent == int(t - 1e-6) + 1
        assert state.received == max(0, floor(t - 1.5 + 1e-6) + 1)
        assert state.newest.sent == pytest.approx(max(0, int(t - 1.5 + 1e-6)), abs=1e-9)


def test_position_belongs_to_the_time_of_the_message():
    for t, state in run(Parameters(), 0.02, 500, y=lambda t: (t, 0.0, 0.0)):
        assert state.newest.y[0] == pytest.approx(state.newest.sent, abs=1e-9)
        assert t - state.newest.sent <= 1.2 + 1e-9


def test_first_position_is_known_until_a_message_arrives():
    parameters = Parameters(latency=5.0)
    for t, state in run(parameters, 0.5, 9, y=lambda t: (7.0 + t, 0.0, 0.0)):
        assert (state.newest.y, state.newest.sent) == ((7.0, 0.0, 0.0), 0.0)
        assert state.received == 0
        assert t < 5.0


@pytest.mark.parametrize("loss", [0.05, 0.5, 0.9])
@pytest.mark.parametrize("seed", [0, 1, -5])
def test_as_many_messages_are_lost_as_the_probability_says(loss, seed):
    """Within four standard deviations of Bernoulli's 5,000 trials: 1 in 16,000 falls outside."""
    n = 5000
    parameters = Parameters(period=0.1, latency=0.0, loss=loss, seed=seed)
    *_, (_, state) = run(parameters, 10.0, n // 100)
    assert state.sent == n
    assert abs(state.lost / n - loss) <= 4 * sqrt(loss * (1 - loss) / n)
    assert state.lost + state.received == n


def test_outage_leaves_the_fate_of_other_messages_as_it_was():
    def fates(parameters):
        states = [state for _, state in run(parameters, 1.0, 200)]
        return [after.lost - before.lost for before, after in pairwise(states)]

    without = fates(Parameters(loss=0.4, latency=0.0))
    within = fates(Parameters(loss=0.4, latency=0.0, outage_start=50.0, outage_duration=20.0))
    # The fate of message k shows in the step that begins at k s.
    assert within[49:69] == [1] * 20
    assert within[:49] + within[69:] == without[:49] + without[69:]


def test_sixteen_messages_are_under_way_at_most():
    """At 15 m/s, 300 m take 20 s: of 20 messages 16 are kept, and the four after them are lost."""
    parameters = Parameters(sound_speed=15.0, latency=0.0)
    states = [state for _, state in run(parameters, 1.0, 40, receiver=lambda t: (300.0, 0.0, 0.0))]
    assert (states[15].lost, states[19].lost) == (0, 4)
    # Each that arrives makes room for one.
    assert (states[35].received, states[35].lost) == (16, 4)


def test_overtaken_message_is_received_and_not_shown():
    """The sender leaps towards the receiver, and its next message is there first."""
    y = {0: (1500.0 * 4, 0.0, 0.0)}
    parameters = Parameters(latency=0.0)
    states = run(parameters, 0.5, 12, y=lambda t: y.get(int(t), HERE))
    shown = {t: (state.newest.sent, state.received) for t, state in states}
    assert shown[1.5] == (1.0, 1)
    assert shown[3.5] == (3.0, 3)
    assert shown[4.0] == (3.0, 4)


def test_zero_step_changes_nothing():
    *_, (t, state) = run(Parameters(), 0.25, 4)
    assert acoustic_link.advance(Parameters(), state, HERE, LEVEL, HERE, t, 0.0) is state


def test_what_no_link_can_do_is_refused():
    with pytest.raises(Refusal, match="16 would be under way; raise period or reduce latency"):
        acoustic_link.check(Parameters(period=0.1, latency=1.7))
    acoustic_link.check(Parameters(period=0.1, latency=1.6))
    parameters = Parameters(period=0.01)
    state: LinkState = acoustic_link.first_state(parameters, HERE, LEVEL, 0.0)
    with pytest.raises(Refusal, match="a step of 200 s has more than 10000 messages"):
        acoustic_link.advance(parameters, state, HERE, LEVEL, HERE, 0.0, 200.0)
