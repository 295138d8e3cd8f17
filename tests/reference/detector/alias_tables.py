"""Draws from alias tables in NumPy: the oracle of `rso_lidar.detector.stages.alias_tables.draw_from_table`."""

import numpy as np


def words(rng, n):
    """Return n random words of 32 bits."""
    return rng.integers(0, 1 << 32, n, dtype=np.uint32)


def draw(table, rng, n, row=None):
    """Return n draws (float32), each from its row of the table."""
    return look_up(table, words(rng, n), row)


def look_up(table, word, row=None):
    """Return what words (...) pick from a table (float32), each from its row."""
    column = (word >> np.uint32(32 - table.columns_log2)).astype(np.intp)
    row = np.zeros(word.shape, np.intp) if row is None else row
    bound, other = np.moveaxis(table.cells.reshape(-1, 2)[(row << table.columns_log2) + column], -1, 0)
    return np.where(word >= bound, other, table.first[row] + column).astype(np.float32)
