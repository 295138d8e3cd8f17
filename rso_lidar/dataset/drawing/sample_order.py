"""The random order of the samples of a dataset, and their random splits. Both are computed for each sample by itself."""

from __future__ import annotations

import numpy as np

from rso_lidar.dataset.drawing.uniform_numbers import fill_shares, find_key, hash_name
from rso_lidar.kernels import kernel, packed
from rso_lidar.philox import draw_block

_HALF_ROUNDS = 12  # of the Feistel network: the number of a sample then tells nothing of its class (tested)
BLOCK = 10  # samples of a class, of which each split gets its share, where no other block divides better
_MOST_BLOCK = 16  # one random number of 53 bits orders a block: 16! is below 2^53
_WHOLE = 0.02  # from a whole number of samples: 0.33 is a third; assumed
_HALVES_UP = 0.5  # added before a count is rounded down


def shuffle_samples(seed: int, index: np.ndarray, count: int) -> np.ndarray:
    """Return the place (sample) of samples in a random order of all samples of a dataset.

    The order is a permutation of 0 to `count` - 1. Its random words come from Philox.

    Parameters
    ----------
    index : (sample) numbers of samples in the dataset
    count : number of all samples of the dataset
    """
    places = np.empty(len(index), np.int64)
    _fill_places(find_key(seed), packed(np.asarray(index, np.int64)), count, hash_name("order"), places)
    return places


def assign_splits(seed: int, group: str, number: np.ndarray, val: float, test: float) -> np.ndarray:
    """Assign samples of a class at random to splits, of which each gets its share of the class.

    Each block of samples of a class (see `choose_block`) holds each share to within one sample, and the first samples hold
    one for each split. The split of a sample depends on its number in the class, not on the size of the class.

    Parameters
    ----------
    number : (sample) numbers in the class
    val, test : shares for validation and for the test; the rest trains

    Returns
    -------
    Index in `SPLITS` (sample): 0 for training, 1 for validation, 2 for the test.
    """
    numbers, block = packed(np.asarray(number, np.int64)), choose_block(val, test)
    shares = np.empty((len(numbers), 1))  # one random number for each block of a class: the order of its samples
    fill_shares(find_key(seed), numbers // block, hash_name(group), hash_name("split"), shares)
    splits = np.empty(len(numbers), np.int8)
    _fill_splits(numbers, block, shares[:, 0], float(val), float(test), splits)
    return splits


def choose_block(val: float, test: float) -> int:
    """Choose the number of consecutive samples of a class that are divided together: ten, or the least that divide exactly.

    So four samples are divided 2/1/1 by shares of a quarter, and twelve 6/3/3.

    Parameters
    ----------
    val, test : shares for validation and for the test; the rest trains

    >>> choose_block(0.0, 0.4), choose_block(0.25, 0.25), choose_block(0.33, 0.33), choose_block(0.15, 0.15)
    (10, 4, 3, 10)
    """
    shares = [share for share in (1.0 - val - test, val, test) if share > 0.0]
    block: int
    for block in (BLOCK, *range(2, _MOST_BLOCK + 1)):
        if all(round(share * block) >= 1 and abs(share * block - round(share * block)) <= _WHOLE for share in shares):
            return block
    return BLOCK


@kernel
def _fill_places(key: np.ndarray, index: np.ndarray, count: int, variable: int, places: np.ndarray) -> None:
    """Write the place of each sample by a Feistel network on the cells of a square that holds all places.

    A place beyond the last is permuted again until it is one of the dataset (Black and Rogaway, "Ciphers with arbitrary
    finite domains", CT-RSA 2002).

    Parameters
    ----------
    key : (2) uint32
    index, count : (sample) numbers of the samples, and the number of all samples
    variable : word of 32 bits
    places : (sample), written
    """
    rows = int(np.ceil(np.sqrt(count)))
    cols = (count + rows - 1) // rows
    for k in range(len(index)):
        place = index[k]
        while True:
            row, col = place // cols, place % cols
            for half_round in range(0, _HALF_ROUNDS, 2):
                row = (row + np.int64(draw_block(key, half_round, col, count, variable)[0])) % rows
                col = (col + np.int64(draw_block(key, half_round + 1, row, count, variable)[0])) % cols
            place = row * cols + col
            if place < count:
                break
        places[k] = place


@kernel
def _fill_splits(
    number: np.ndarray, block: int, share: np.ndarray, val: float, test: float, splits: np.ndarray
) -> None:
    """Write the split of each sample: the labels of its block, in random order.

    Parameters
    ----------
    number : (sample) numbers in the class
    share : (sample) random number of the sample's block, from 0 to below 1
    val, test : shares, from 0 to 1
    splits : (sample), written
    """
    held = val + test
    of_held = test / held if held > 0.0 else 0.0
    counts, labels = np.empty(3, np.int64), np.zeros(block, np.int8)
    for k in range(len(number)):
        begin = number[k] // block * block
        held_before = int(begin * held + _HALVES_UP)
        held_after = int((begin + block) * held + _HALVES_UP)
        counts[2] = int(held_after * of_held + _HALVES_UP) - int(held_before * of_held + _HALVES_UP)
        counts[1] = held_after - held_before - counts[2]
        counts[0] = block - counts[1] - counts[2]
        first = 0  # samples of the class that are of different splits
        if begin == 0:
            for split in range(3):
                if split == 0 or (split == 1 and val > 0.0) or (split == 2 and test > 0.0):
                    if counts[split] == 0:
                        counts[counts.argmax()] -= 1
                        counts[split] = 1
                    labels[first] = split
                    first += 1
        filled = first
        for split in range(3):
            for _ in range(counts[split] - np.sum(labels[:first] == split)):
                labels[filled] = split
                filled += 1
        left = share[k]
        for high in range(block - 1, 0, -1):  # Fisher-Yates, the first samples among themselves
            low = first if high >= first else 0
            left *= high - low + 1
            chosen = low + int(left)
            left -= int(left)
            labels[high], labels[chosen] = labels[chosen], labels[high]
        splits[k] = labels[number[k] - begin]
