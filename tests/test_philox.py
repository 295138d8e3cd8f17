"""Random words with an address: known answers, the oracle, and that no two addresses share a stream."""

import numpy as np
import pytest

from rso_lidar import philox
from rso_lidar.kernels import packed
from tests.reference import philox as reference

# Random123 1.14, tests/kat_vectors, "philox4x32 10": counter, key, words.
KNOWN = [
    ([0] * 4, [0] * 2, [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]


def key_of(*words):
    return packed(np.array(words, np.uint32))


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN)
def test_known_answers_of_random123(counter, key, words):
    assert list(philox.draw_block(key_of(*key), *counter)) == words
    assert reference.blocks(key, *counter).tolist() == words


@pytest.mark.parametrize("n", [4, 64, 100, 256])
def test_a_row_is_what_the_oracle_says_and_its_blocks_can_be_drawn_alone(n):
    key, row, pixel = key_of(7, 11), [0, 31_000, 2**31], [0, 16_383, 5]
    expected = reference.rows(key, row, pixel, 2, n)
    for k in range(3):
        words = np.empty(n, np.uint32)
        philox.fill_row(key, row[k], pixel[k], 2, words)
        np.testing.assert_array_equal(words, expected[k])
        step = n - 1
        alone = philox.draw_block(key, step % (n // 4), row[k], pixel[k], 2)
        assert alone[step // (n // 4)] == words[step]


def test_every_part_of_an_address_changes_the_words():
    key = key_of(1, 2)
    addresses = [(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)]
    drawn = {philox.draw_block(key, *address) for address in addresses}
    drawn |= {philox.draw_block(key_of(*other), 0, 0, 0, 0) for other in [(2, 1), (0, 2), (1, 0)]}
    assert len(drawn) == 8


def test_words_of_neighbouring_addresses_do_not_correlate():
    """Rows of neighbouring pixels and of neighbouring stages: each correlation is normal with 1 / sqrt(n)."""
    key, n = key_of(3, 4), 4096
    rows = np.empty((8, n), np.uint32)
    for k in range(8):
        philox.fill_row(key, 0, k % 4, k // 4, rows[k])
    uniform = (rows + 0.5) / 2.0**32
    assert np.all(np.abs(uniform.mean(axis=1) - 0.5) < 5.0 / np.sqrt(12 * n))
    correlation = np.corrcoef(uniform) - np.eye(8)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(n)  # 28 pairs: 2e-5 that one passes by chance


def test_keys_are_drawn_from_the_frames_generator():
    first, again, other = (np.random.Generator(np.random.Philox(seed)) for seed in (1, 1, 2))
    key = philox.draw_key(first)
    assert key.dtype == np.uint32 and key.shape == (2,) and not key.flags.writeable
    np.testing.assert_array_equal(key, philox.draw_key(again))
    assert (key != philox.draw_key(other)).any()
    assert (key != philox.draw_key(first)).any()  # another flash
