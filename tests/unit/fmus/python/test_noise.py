"""Numbers of Python's generator, which can be taken back."""

from __future__ import annotations

from math import inf, nan
from random import Random

import pytest

from auv_fmu.language.variable import Refusal
from fmus.python.noise import Noise, check_draws


def test_what_is_taken_back_is_drawn_again_at_any_place_of_a_long_run():
    noise, gauss = Noise(Random(7), 3), Random(7).gauss
    for k in range(800):
        if k % 3 == 0:
            noise.draw()
            noise.take_back()
        assert noise.draw() == (gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0))


def test_a_restored_generator_continues():
    noise = Noise(Random(7), 3)
    noise.draw()
    other = Noise.restored(noise.state, 3)
    assert other.draw() == noise.draw()


@pytest.mark.parametrize("following", [9.5, -inf, nan])
def test_a_generator_that_none_can_be_is_refused(following):
    with pytest.raises(Refusal, match=r"^its noise is none that can be drawn$"):
        Noise.restored((*Random(7).getstate()[:2], following), 1)


def test_the_largest_number_that_can_be_drawn_is_near_the_bound():
    """The logarithm of the smallest number above zero of 53 bits."""
    check_draws(8.57, -8.57)
    with pytest.raises(Refusal):
        check_draws(0.0, 9.1)
