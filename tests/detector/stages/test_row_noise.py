"""Words of rows are those at their addresses, however many rows and stages are drawn at once."""

import numpy as np
import pytest

from rso_lidar.detector.stages.row_noise import AVALANCHE, RowNoise
from tests.reference import philox

KEY = np.array([3, 2**32 - 1], np.uint32)
NOISE = RowNoise(KEY, np.array([0, 5, 5, 16_383]), np.array([-3, 0, 71, 2**31]))


@pytest.mark.parametrize("n_steps", [1, 4, 63, 64, 105])
def test_words_are_those_of_the_reference(n_steps):
    words = NOISE.draw(AVALANCHE, 3, n_steps)
    assert words.shape == (3, 4, -(-n_steps // 4) * 4)
    for stage in range(3):
        expected = philox.rows(KEY, NOISE.start, NOISE.pixel, AVALANCHE + stage, words.shape[2])
        assert np.array_equal(words[stage], expected)


def test_a_row_drawn_alone_has_the_same_words():
    assert np.array_equal(NOISE.select(slice(1, 3)).draw(AVALANCHE, 1, 64), NOISE.draw(AVALANCHE, 1, 64)[:, 1:3])
