"""What rows take from the row before them, one by one: the oracle of `rso_lidar.detector.stages.overlap`."""


def copy_shared(drawn, row, lag, shared):
    """Write over what was drawn (row, step) where the row before has drawn it already."""
    for one, by, n in zip(row, lag, shared, strict=True):
        drawn[one, :n] = drawn[one - 1, by : by + n]
