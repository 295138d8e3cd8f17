import dataclasses
import weakref

import numpy as np
import pytest

from rso_lidar.errors import RecordingError
from rso_lidar.picture import Thumbnail, even_indices, find_target_returns
from rso_lidar.picture.selection.sequence import find_target_pixels, pick, pixel_rad


@pytest.mark.parametrize(("n", "count"), [(1, 1), (10, 4), (540, 120), (121, 120), (7, 7), (3, 9), (1000, 2)])
def test_evenly_spreads_indices_and_keeps_both_ends(n, count):
    chosen = even_indices(n, count)
    assert len(chosen) == min(n, count)
    assert chosen[0] == 0
    assert chosen[-1] == n - 1
    gaps = np.diff(chosen)
    assert (gaps >= 1).all()
    assert gaps.size == 0 or gaps.max() - gaps.min() <= 1  # as even as whole numbers allow


def test_evenly_of_none_and_of_one():
    assert even_indices(0, 5) == []
    assert even_indices(9, 1) == [0]
    with pytest.raises(RecordingError, match="give 1 or more"):
        even_indices(9, 0)


def test_a_sequence_is_read_only_where_it_is_looked_at():
    class Shelf:
        def __init__(self):
            self.read = []

        def __len__(self):
            return 100

        def __getitem__(self, k):
            self.read.append(k)
            return k

    shelf = Shelf()
    seen, total = pick(shelf, 5, lambda k: k)
    assert seen == shelf.read == even_indices(100, 5)
    assert total == 100


@pytest.mark.parametrize("n", [1, 3, 16, 17, 40, 999])
def test_an_iterator_is_thinned_without_holding_it(n):
    class Thing:
        def __init__(self, k):
            self.k = k

    alive = weakref.WeakSet()
    most = 0

    def things():
        nonlocal most
        for k in range(n):
            thing = Thing(k)
            alive.add(thing)
            most = max(most, len(alive))
            yield thing

    seen, total = pick(things(), 4, lambda thing: thing)
    numbers = [thing.k for thing in seen]
    assert total == n
    assert numbers[0] == 0
    assert numbers[-1] == n - 1
    assert len(numbers) == min(n, 4)
    assert most <= 4 * 4 + 3  # the kept ones, and those in the hands of the loop
    gaps = np.diff(numbers)
    assert gaps.size == 0 or gaps.max() - gaps.min() <= max(1, n // 4)  # within one stride, of 2 * count steps or more


def test_no_frames_is_an_error():
    for nothing in ([], iter(())):
        with pytest.raises(RecordingError, match="has no frames"):
            pick(nothing, 4, lambda frame: frame)


def test_labels_tell_returns_from_false_ones_and_without_them_the_neighbours_do(handmade):
    labelled = handmade.make_frame(range_m=600.0, false_returns=40)
    bare = handmade.make_frame(range_m=600.0, false_returns=40, labelled=False)
    truth = labelled.labels.target >= 0
    assert not (find_target_returns(labelled) & ~truth).any()
    assert (find_target_returns(labelled) == (labelled.valid & truth)).all()
    kept = find_target_returns(bare)
    far_off = bare.valid & ~truth
    assert far_off.sum() > 30
    assert (kept & ~truth).sum() <= 0.1 * far_off.sum()
    assert (kept & truth).sum() > 0.95 * (bare.valid & truth).sum()


def test_sighted_falls_back_until_something_is_seen(handmade):
    frame = handmade.make_frame(range_m=900.0, n=32, labelled=False, photons_at_km=0.0, false_returns=1)
    assert (find_target_pixels(frame) == frame.valid).all()
    frame = handmade.make_frame(range_m=900.0, n=32, labelled=False, photons_at_km=0.0, false_returns=0)
    assert find_target_pixels(frame).all()


def test_a_glimpse_measures_the_target(handmade):
    frame = handmade.make_frame(range_m=800.0)
    thumbnail = Thumbnail.of(frame)
    # The satellite of frames_for_tests reaches 6.5 m from its origin.
    assert abs(thumbnail.median_m - thumbnail.true_range_m) < 6.5
    assert thumbnail.returns == frame.valid.sum()
    # Pixels of a flat focal plane of 2.5 degrees and 128 columns: 2 tan(1.25 deg) / 128 in the middle.
    assert pixel_rad(frame) == pytest.approx(2 * np.tan(np.pi * 1.25 / 180) / 128, rel=1e-5)
    assert thumbnail.pixel_m == pytest.approx(thumbnail.median_m * pixel_rad(frame))
    dark = dataclasses.replace(thumbnail, on_target=np.zeros_like(thumbnail.on_target))
    assert np.isnan(dark.median_m)
    assert dark.pixel_m == pytest.approx(thumbnail.true_range_m * pixel_rad(frame))
